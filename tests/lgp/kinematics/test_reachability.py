"""Inverse kinematics in batches, and the map of the screwdriver scene."""

from __future__ import annotations

import numpy as np

from lgp.kinematics.ik import least_squares
from lgp.kinematics.reachability import reach, reachability, transport_reachability
from tests.support.lgp_worlds import anywhere, human_world, needs_robots, screwdriver_world


def test_least_squares_finds_the_nearest_point_of_a_box() -> None:
    targets = np.array([[0.5, 0.2], [3.0, 0.0], [0.0, -9.0]])

    def residuals(x: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return x - targets[which], np.tile(np.eye(2), (len(x), 1, 1))

    x, left = least_squares(residuals, np.zeros((3, 2)), np.full(2, -1.0), np.full(2, 1.0))
    np.testing.assert_allclose(x, [[0.5, 0.2], [1.0, 0.0], [0.0, -1.0]], atol=1e-3)
    np.testing.assert_allclose(left, [0.0, 2.0, 8.0], atol=1e-3)


def test_every_point_a_hand_can_be_at_is_found_again() -> None:
    for legs in ("planted", "solved"):
        world = human_world(legs)
        q = np.tile(world.initial_configuration, (12, 1))
        arm = [column for name, column in world.column.items() if "right" in name and "hip" not in name]
        arm = [column for column in arm if not any(part in world.joints[column] for part in ("knee", "ankle"))]
        q[:, arm] = anywhere(world, 12)[:, arm]
        points = world.at(q, ["human.right_hand"]).position[:, 0]
        hand = world.scene.hands["human.right_hand"]
        assert reach(world, hand, points, 6, np.random.default_rng(0)).max() < 1e-3


def test_far_points_are_missed_by_how_far_they_are() -> None:
    world = human_world()
    hand = world.scene.hands["human.right_hand"]
    miss = reach(world, hand, np.array([[5.0, 0.0, 1.0], [6.0, 0.0, 1.0]]), 3, np.random.default_rng(0))
    assert miss[0] > 2.0
    assert miss[1] > miss[0] + 0.5


@needs_robots
def test_human_and_robot_reach_all_three_tables_and_only_the_robot_the_start() -> None:
    world = screwdriver_world()
    found = reachability(world, heights=(0.6, 1.1, 1.6))
    shares = found.shares()
    three = ["table.left", "table.center", "table.right"]
    human = shares.loc["human.right_hand"]
    assert human.loc[three].min(axis=None) == 1.0
    assert human.loc["table.start"].max() == 0.0
    robot = found.data[found.data["hand"].str.startswith("baxter")]
    either = robot.groupby(["table", "height", "x", "y"])["reached"].max()
    assert either.groupby("table").mean().loc[three].min() == 1.0
    assert shares.loc[("baxter.right", "table.start")].max() == 1.0


@needs_robots
def test_the_right_arm_carries_the_screwdriver_to_every_table_at_every_height() -> None:
    world = screwdriver_world()
    found = transport_reachability(world, "screwdriver", heights=(0.6, 1.6), spots=2, attempts=4)
    right = found[found["hand"] == "baxter.right"]
    assert right.groupby(["table", "height"])["reached"].max().all()
    assert not found[found["hand"] == "baxter.left"]["reached"].any()
