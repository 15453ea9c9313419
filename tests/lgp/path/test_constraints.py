"""Leg reach: one smooth constraint for both legs, its gradient and curvature."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

import lgp
from lgp.kinematics.posture import PostureMap
from lgp.path.leg_reach import BLEND, LegConstraints, LegReachConstraint
from lgp.path.phases import Phases
from tests.support.lgp_worlds import human_world


@pytest.fixture(scope="module")
def standing() -> tuple[np.ndarray, LegReachConstraint]:
    world = human_world("solved")
    assert world.scene.human is not None
    legs, rng = LegReachConstraint(world, world.scene.human), np.random.default_rng(0)
    q = np.tile(world.initial_configuration, (40, 1))
    q[:, legs.columns] += 0.02 * rng.normal(size=(40, len(legs.columns)))
    q[:5, legs.columns] = world.initial_configuration[legs.columns]
    return q, legs


def test_one_constraint_bounds_the_reach_of_both_legs(standing: tuple[np.ndarray, LegReachConstraint]) -> None:
    q, legs = standing
    both = PostureMap(human_world("solved")).leg_shortfall(q)[0]
    value, _ = legs.evaluate(q)
    assert (value >= both.max(axis=1)).all()
    assert (value <= both.max(axis=1) + BLEND * np.log(2.0) + 1e-12).all()


def test_leg_reach_has_its_stated_gradient_and_convex_curvature(
    standing: tuple[np.ndarray, LegReachConstraint],
) -> None:
    q, legs = standing
    _, slope = legs.evaluate(q)
    for at, column in enumerate(legs.columns):
        step = np.zeros(q.shape[1])
        step[column] = 1e-7
        difference = (legs.evaluate(q + step)[0] - legs.evaluate(q - step)[0]) / 2e-7
        assert slope[:, at] == pytest.approx(difference, abs=1e-5)
    assert np.linalg.eigvalsh(legs.curvature(q)).min() > -1e-9


def test_a_leg_that_is_too_short_between_slices_becomes_a_row() -> None:
    world = human_world("solved")
    assert world.scene.human is not None
    start, slices = world.initial_configuration, 6
    rows = LegConstraints(world, cast(Phases, SimpleNamespace(total=slices)), start, world.scene.human)
    none = np.zeros(0)
    assert rows.add_violated(np.tile(start, (slices, 1)), none) == 0
    # The pelvis goes 40 cm to the side and comes back, low enough in each slice alone.
    columns = [world.column[f"human.pelvis_{name}"] for name in ("x", "z")]
    path = np.tile(start, (slices, 1))
    path[:, columns] += [(0.2, -0.05), (0.4, -0.3), (0.38, -0.1), (0.2, -0.05), (0.05, 0.02), (0.01, 0.01)]
    count = rows.add_violated(path, none)
    assert count == len(rows) == len(rows.names()) == len(rows.blocks(0)) > 0
    assert rows.add_violated(path, none) == 0
    value, gradients = rows.evaluate(path, none), rows.gradients(path, none)
    assert (value > 5e-4).all()
    way = np.zeros(path.shape)  # joints that rest would not do so beside the path
    way[:, columns] = np.random.default_rng(0).normal(size=(slices, 2))
    difference = (rows.evaluate(path + 1e-7 * way, none) - rows.evaluate(path - 1e-7 * way, none)) / 2e-7
    along = [
        gradient @ way.ravel()[unknowns] for gradient, (_, unknowns) in zip(gradients, rows.blocks(0), strict=True)
    ]
    assert along == pytest.approx(difference, abs=1e-5)


def test_a_person_who_leans_too_far_at_the_start_comes_back_and_acts() -> None:
    world = human_world("solved")
    assert world.scene.human is not None
    legs = LegReachConstraint(world, world.scene.human)
    start = world.initial_configuration.copy()
    start[world.column["human.pelvis_z"]] = 0.0
    while legs.evaluate(start[None])[0][0] < 0.005:
        start[world.column["human.pelvis_x"]] += 0.002
    assert legs.evaluate(start[None])[0][0] < 0.01, "as a tracker may see someone with straight legs"
    plan = lgp.plan(world.scene, cost=None, start=start, depth=1)
    assert plan.feasible, plan.reason
    assert legs.evaluate(plan.path)[0].max() < 1e-6
    # Only until the first slice, and no more than at the start.
    rows = LegConstraints(world, cast(Phases, SimpleNamespace(total=3)), start, world.scene.human)
    assert rows.add_violated(np.tile(start, (3, 1)), np.zeros(0)) == 2
    higher = start.copy()
    higher[world.column["human.pelvis_x"]] += 0.02
    assert rows.add_violated(np.tile(higher, (3, 1)), np.zeros(0)) == 1
