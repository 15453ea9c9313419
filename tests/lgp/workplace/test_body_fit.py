"""The planner's body takes measured postures, with its centre of mass above its feet."""

import numpy as np
import pytest

import reba
from lgp.errors import SceneError
from lgp.workplace.balance import Balance
from lgp.workplace.body_fit import fit_body, person
from tests.support.paths import DATASETS

WORLD = person(1.75, "male")
HANDS = ("left_hand", "right_hand")


@pytest.mark.parametrize("load", [0.0, 12.0])
def test_the_jacobian_of_the_centre_of_mass_is_that_of_differences(load):
    balance = Balance(WORLD, load, HANDS)
    q = np.random.default_rng(1).uniform(WORLD.lower, WORLD.upper)[None]
    q[0, WORLD.column["human.pelvis_z"]] = -0.2  # knees that are neither straight nor out of reach

    def place(step):
        return balance.evaluate(WORLD.at(q + step, balance.frames))[0][0]

    differences = np.stack([(place(step) - place(-step)) / 2e-6 for step in 1e-6 * np.eye(WORLD.nq)], axis=1)
    assert balance.evaluate(WORLD.at(q, balance.frames))[1][0] == pytest.approx(differences, abs=1e-8)


@pytest.mark.parametrize("sex", ["male", "female"])
def test_masses_add_up_and_a_load_in_front_moves_the_centre_forward(sex):
    world = person(1.7, sex)
    standing = world.initial_configuration[None]
    empty, loaded = (Balance(world, load, HANDS) for load in (0.0, 10.0))
    total = sum(share for *_, share in empty._points) + 2 * sum(share for _, share in empty._legs.values())
    assert total == pytest.approx(1.0, abs=0.003)
    places = [balance.evaluate(world.at(standing, balance.frames))[0][0] for balance in (empty, loaded)]
    assert empty.lower[0] < places[0][0] < places[1][0] < empty.upper[0]
    assert places[0][1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", ["balancing_keypoints.trc", "simulated_palletising.mcap"])
def test_the_body_takes_the_postures_of_a_recording(name):
    angles = reba.score(reba.read(DATASETS / name)).angles
    balance = Balance(WORLD, 0.0, ())
    chosen = np.linspace(0, len(angles) - 1, 6).astype(int)
    away = np.abs([fit_body(WORLD, angles[frame], balance).away for frame in chosen])
    assert np.nanmean(away) < 0.3
    assert np.nanmax(away) < 5.0  # of a knee, as one foot is off the floor


def test_left_and_right_are_mirrored():
    posture = reba.angle_table(
        {"trunk_flexion": 30.0, "trunk_twist": 15.0, "upper_arm_flexion_left": 70.0, "lower_arm_flexion_left": 40.0}
    )[0]
    mirror = reba.angle_table(
        {"trunk_flexion": 30.0, "trunk_twist": -15.0, "upper_arm_flexion_right": 70.0, "lower_arm_flexion_right": 40.0}
    )[0]
    balance = Balance(WORLD, 0.0, HANDS)
    hands = []
    for one in (posture, mirror):
        fit = fit_body(WORLD, one, balance)
        names = [f"human.{hand}" for hand in HANDS]
        hands.append(WORLD.at(fit.q[None], names).position[0])
    assert hands[0] == pytest.approx(hands[1][::-1] * (1.0, -1.0, 1.0), abs=2e-3)


def test_a_stature_out_of_range_is_refused():
    with pytest.raises(SceneError):
        person(2.5, "male")
