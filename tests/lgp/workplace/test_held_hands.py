"""Postures with held hands: derivatives, hands in place, soles on the floor, balance."""

import numpy as np
import pytest

import dreba
import reba
from lgp.path.ergonomics import Ergonomics
from lgp.workplace.balance import Balance
from lgp.workplace.body_fit import fit_body, person
from lgp.workplace.held_hands import TOLERANCE, TURN, Aim, HeldHands, Hold
from lgp.workplace.postures import hold_of
from reba.posture.columns import COLUMNS, INDEX

HANDS = ("left_hand", "right_hand")
WORLD = person(1.75, "male")
ERGONOMICS = Ergonomics(WORLD, dreba.load("convex"))
BALANCE = Balance(WORLD, 5.0, HANDS)
POSTURE = {"trunk_flexion": 40.0, "trunk_side_bend": 0.0, "trunk_twist": 0.0, "neck_flexion": 5.0, "knee_flexion": 20.0,
           "upper_arm_flexion": 60.0, "upper_arm_abduction": 5.0, "lower_arm_flexion": 40.0, "wrist_flexion": 0.0,
           "wrist_deviation": 0.0, "wrist_twist": 0.0}  # fmt: skip


@pytest.fixture(scope="module")
def hold() -> Hold:
    angles = reba.angle_table(POSTURE)[0]
    return hold_of(WORLD, fit_body(WORLD, angles, BALANCE).q, HANDS, ~np.isnan(angles), seated=False)


def test_derivatives_are_those_of_differences(hold):
    problem = HeldHands(ERGONOMICS, BALANCE, hold, Aim(np.full(22, -5.0), np.full(22, 5.0)))
    q = np.random.default_rng(1).uniform(WORLD.lower, WORLD.upper)
    q[WORLD.column["human.pelvis_z"]] = -0.1
    x = np.append(q, [0.1, 0.2, 0.3])[None]
    model = problem.linearise(x, np.zeros((1, 6)), np.zeros((1, 8)))
    steps = 1e-6 * np.eye(x.shape[1])
    differences = [
        np.stack([(problem.evaluate(x + step)[at] - problem.evaluate(x - step)[at])[0] / 2e-6 for step in steps], -1)
        for at in range(3)
    ]
    assert model.gradient[0, :-3] == pytest.approx(differences[0][:-3], abs=1e-5)
    assert model.eq_jac[0] == pytest.approx(differences[1], abs=1e-6)
    assert model.in_jac[0] == pytest.approx(differences[2], abs=1e-6)


def test_hands_are_in_place_and_the_body_stands(hold):
    problem = HeldHands(ERGONOMICS, BALANCE, hold)
    moved = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.2], [-0.1, 0.1, 0.3], [0.0, 0.0, 3.0]])
    starts = np.tile(hold.q, (len(moved), 1))
    q, holds = problem.project(problem.solve(starts, moved), moved)
    assert holds.tolist() == [True, True, True, False]
    kinematics = WORLD.at(q[:3], [*(f"human.{hand}" for hand in HANDS), *BALANCE.frames])
    for at, hand in enumerate(HANDS):
        place = kinematics.placement(f"human.{hand}")
        assert place.position == pytest.approx(hold.places[at] + moved[:3], abs=TOLERANCE)
        cosine = (np.einsum("bij,ij->b", place.rotation, hold.rotations[at]) - 1.0) / 2.0
        assert np.degrees(np.arccos(cosine)).max() <= TURN + 0.5
    assert BALANCE.beyond(kinematics)[0].max() <= TOLERANCE
    assert ERGONOMICS.posture.leg_shortfall(q[:3])[0].max() <= TOLERANCE
    # Higher work is better for a bent person.
    assert problem.cost(q)[1] < problem.cost(hold.q[None])[0]


def test_what_was_not_measured_does_not_move():
    angles = reba.angle_table({"trunk_flexion": 40.0, "upper_arm_flexion": 60.0, "lower_arm_flexion": 40.0})[0]
    hold = hold_of(WORLD, fit_body(WORLD, angles, BALANCE).q, HANDS, ~np.isnan(angles), seated=False)
    assert not hold.turns.any()
    problem = HeldHands(ERGONOMICS, BALANCE, hold)
    up = np.array([[0.0, 0.0, 0.2]])
    q, holds = problem.project(problem.solve(problem.project(hold.q[None], up)[0], up), up)
    assert holds.all()
    moved = ERGONOMICS.posture.angles(q)[0] - ERGONOMICS.posture.angles(hold.q[None])[0]
    for name in COLUMNS:
        if name.startswith(("wrist", "neck", "shoulder", "trunk_twist", "trunk_side")):
            assert moved[INDEX[name]] == pytest.approx(0.0, abs=0.1), name


def test_a_seat_holds_the_pelvis():
    angles = reba.angle_table(POSTURE)[0]
    fit = fit_body(WORLD, angles, BALANCE, standing=False)
    hold = hold_of(WORLD, fit.q, HANDS, ~np.isnan(angles), seated=True)
    problem = HeldHands(ERGONOMICS, BALANCE, hold)
    up = np.array([[0.0, 0.0, 0.15]])
    q, holds = problem.project(problem.solve(hold.q[None], up), up)
    assert holds.all()
    for name in ("pelvis_x", "pelvis_y", "pelvis_z", "pelvis_yaw"):
        assert q[0, WORLD.column[f"human.{name}"]] == fit.q[WORLD.column[f"human.{name}"]]
