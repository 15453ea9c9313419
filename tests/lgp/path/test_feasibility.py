"""How far a hand gets at most: never less than what a random posture reaches, and not much more."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lgp
from lgp.kinematics.world import World
from lgp.path.feasibility import ReachBound, Rectangle, span
from lgp.scene.scene_file import read_scene
from tests.support.lgp_worlds import HUMAN_ONLY, human_world, needs_robots, screwdriver_world

LEVEL = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def reached(world: World, hand: str, n: int) -> tuple[ReachBound, np.ndarray]:
    """Return the span of a hand, and by how much (n,) random postures go beyond it."""
    found = span(world, world.scene.hands[hand])
    q = np.random.default_rng(0).uniform(world.lower, world.upper, (n, world.nq))
    points = world.at(q, [hand]).position[:, 0]
    return found, np.array([found.beyond(Rectangle(point, np.zeros(2), LEVEL)) for point in points])


@needs_robots
@pytest.mark.parametrize("hand", ["baxter.left", "human.right_hand"])
def test_no_posture_goes_beyond_the_span(hand: str) -> None:
    found, beyond = reached(screwdriver_world(), hand, 4000)
    assert beyond.max() <= 1e-9
    assert beyond.max() > -0.15 * found.length


def test_a_turned_human_has_its_own_span() -> None:
    found, beyond = reached(human_world(), "human.left_hand", 4000)
    assert found.slides.shape == (3, 3)
    assert beyond.max() <= 1e-9


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3), st.floats(0.0, 0.5), st.floats(0.0, 3.1))
def test_the_distance_of_a_top_is_a_lower_bound(centre: list[float], half: float, yaw: float) -> None:
    sides = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0]])
    top = Rectangle(np.array(centre), np.array([half, 0.5 * half]), sides)
    box = ReachBound(np.zeros(3), np.eye(3), np.array([-0.1, -0.1, -0.2]), np.array([0.1, 0.1, 0.0]), 0.0)
    rng = np.random.default_rng(1)
    spots = top.centre + (rng.uniform(-1, 1, (3000, 2)) * top.halves) @ sides
    roots = rng.uniform(box.lower, box.upper, (3000, 3))
    nearest = np.linalg.norm(spots - roots, axis=1).min()
    assert box.beyond(top) <= nearest + 1e-9
    near = top.nearest(np.clip(top.nearest(np.zeros(3)), box.lower, box.upper))
    assert box.beyond(top) >= np.linalg.norm(near - np.clip(near, box.lower, box.upper)) - 0.02


def far_away(distance: float) -> lgp.Plan:
    table = {**HUMAN_ONLY["tables"]["near"], "position": [0.3 + distance, 0.1]}  # type: ignore[index]
    initial = ["on_table(box)", "free(human.right_hand)"]
    return lgp.plan(read_scene({**HUMAN_ONLY, "initial": initial, "tables": {"near": table}}), cost=None, slices=4)


def test_a_table_beyond_every_span_is_refused_without_solving() -> None:
    found = far_away(1.9)
    assert not found.feasible
    assert found.reason.startswith("phase 1, grasp(1, human.right_hand, box): human.right_hand stays at least 0.2")
    assert found.reason.endswith("away from box on table.near, however its joints are stretched")


def test_a_table_within_the_span_is_left_to_the_solver() -> None:
    assert far_away(1.5).feasible
