"""A program written in other units, or seen from elsewhere, has the same optimum."""

from dataclasses import replace

import pytest

import dreba
from lgp.kinematics.world import World
from lgp.path.bounds import PathBounds
from lgp.path.costs import Weights
from lgp.path.ergonomics import Ergonomics
from lgp.planner import follow, parse_sequence, task_of
from lgp.scene.scene_file import load_scene

pytestmark = pytest.mark.slow
SECONDS = 2.5
"""Phases of 5 s instead of 2 s: accelerations cost this to the -3, a second of score as much with weight^-4."""
HEIGHTS = {"left": 1.4277, "center": 1.0092, "right": 1.1496}
LINES = (
    "grasp(baxter.right, screwdriver)",
    "place(baxter.right, screwdriver, table.right)",
    "grasp(human.right_hand, screwdriver)",
)


@pytest.fixture(scope="module")
def world() -> World:
    return World(load_scene("screwdriver").with_heights(HEIGHTS))


@pytest.fixture(scope="module")
def ergonomics(world: World) -> Ergonomics:
    return Ergonomics(world, dreba.load("quadratic"))


def cost_of(world: World, ergonomics: Ergonomics, weights: Weights, collisions: bool) -> float:
    bounds = PathBounds(world, ergonomics, weights, collisions=collisions)
    return follow(bounds, parse_sequence(task_of(world.scene), LINES)).cost


def _scaled(acceleration: float, per_second: float) -> Weights:
    """Return the default weights, those of accelerations and of what is counted per second times a factor each."""
    one = Weights()
    return Weights(acceleration * one.acceleration, per_second * one.ergonomics, per_second * one.time)


@pytest.mark.parametrize("collisions", [False, True])
def test_units_of_cost_do_not_change_the_optimum(world: World, ergonomics: Ergonomics, collisions: bool) -> None:
    cost = cost_of(world, ergonomics, Weights(), collisions)
    scaled = cost_of(world, ergonomics, _scaled(7.0, 7.0), collisions) / 7.0
    assert scaled == pytest.approx(cost, rel=1e-5)


def test_units_of_time_do_not_change_the_optimum(world: World, ergonomics: Ergonomics) -> None:
    """Without collisions: bodies draw back within a third of a second, whatever the length of a phase."""
    long = world.with_scene(replace(world.scene, phase_seconds=world.scene.phase_seconds * SECONDS))
    slow = cost_of(long, ergonomics, _scaled(1.0, SECONDS**-4), False) * SECONDS**3
    assert slow == pytest.approx(cost_of(world, ergonomics, Weights(), False), rel=1e-5)
