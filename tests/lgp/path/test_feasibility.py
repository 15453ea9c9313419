"""Reach bounds: never less than what a random posture reaches, and not much more."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lgp
from lgp.kinematics.world import World
from lgp.path.feasibility import ReachBound, Rectangle, reach_bound
from lgp.scene.scene_file import read_scene
from tests.support.lgp_worlds import HUMAN_ONLY, human_world, needs_robots, screwdriver_world
from tests.support.robot_files import arm_world
from tests.support.says import says

BASE = {"x": [-1.0, 1.0], "y": [-0.5, 0.5]}
LEVEL = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def reached(world: World, hand: str, n: int) -> tuple[ReachBound, np.ndarray]:
    """Return the reach bound of a hand, and the distances (n,) of its random postures beyond it [m]."""
    bound = reach_bound(world, world.scene.hands[hand])
    q = np.random.default_rng(0).uniform(world.lower, world.upper, (n, world.nq))
    points = world.at(q, [hand]).position[:, 0]
    return bound, np.array([bound.distance_beyond(Rectangle(point, np.zeros(2), LEVEL)) for point in points])


@needs_robots
@pytest.mark.parametrize("hand", ["baxter.left", "human.right_hand"])
def test_no_posture_is_beyond_the_reach_bound(hand: str) -> None:
    bound, beyond = reached(screwdriver_world(), hand, 4000)
    assert beyond.max() <= 1e-9
    assert beyond.max() > -0.15 * bound.length


@pytest.mark.parametrize(
    ("robot", "slides"), [({}, 1), ({"locked": ["lift"]}, 0), ({"locked": ["lift"], "base": BASE}, 2)]
)
def test_no_posture_of_a_robot_on_slides_is_beyond_its_reach_bound(
    tmp_path: Path, robot: dict[str, Any], slides: int
) -> None:
    bound, beyond = reached(arm_world(tmp_path, **robot), "arm.tcp", 4000)
    assert len(bound.slides) == slides
    assert beyond.max() <= 1e-9
    assert beyond.max() > -0.3 * bound.length


def test_a_turned_human_has_its_own_reach_bound() -> None:
    bound, beyond = reached(human_world(), "human.left_hand", 4000)
    assert bound.slides.shape == (3, 3)
    assert beyond.max() <= 1e-9


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3), st.floats(0.0, 0.5), st.floats(0.0, 3.1))
def test_the_distance_of_a_rectangle_is_a_lower_bound(centre: list[float], half: float, yaw: float) -> None:
    sides = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0]])
    area = Rectangle(np.array(centre), np.array([half, 0.5 * half]), sides)
    box = ReachBound(np.zeros(3), np.eye(3), np.array([-0.1, -0.1, -0.2]), np.array([0.1, 0.1, 0.0]), 0.0)
    rng = np.random.default_rng(1)
    spots = area.centre + (rng.uniform(-1, 1, (3000, 2)) * area.halves) @ sides
    roots = rng.uniform(box.lower, box.upper, (3000, 3))
    nearest = np.linalg.norm(spots - roots, axis=1).min()
    assert box.distance_beyond(area) <= nearest + 1e-9
    near = area.nearest(np.clip(area.nearest(np.zeros(3)), box.lower, box.upper))
    assert box.distance_beyond(area) >= np.linalg.norm(near - np.clip(near, box.lower, box.upper)) - 0.02


def far_away(distance: float) -> lgp.Plan:
    table = {**HUMAN_ONLY["tables"]["near"], "position": [0.3 + distance, 0.1]}  # type: ignore[index]
    initial = ["on_table(box)", "free(human.right_hand)"]
    return lgp.plan(read_scene({**HUMAN_ONLY, "initial": initial, "tables": {"near": table}}), cost=None, slices=4)


def test_a_table_beyond_reach_is_refused_without_solving() -> None:
    plan = far_away(1.9)
    assert not plan.feasible
    says(
        plan.reason,
        "phase 1, grasp(1, human.right_hand, box)",
        "human.right_hand cannot reach",
        "box on table.near",
        "0.2",
    )


def test_a_table_within_the_reach_bound_is_decided_by_the_solver() -> None:
    assert far_away(1.5).feasible
