"""A start in which bodies are in each other."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import lgp
from lgp.collision.start_check import check_start, start_penetrations
from lgp.errors import WorldError
from lgp.kinematics.world import World
from lgp.scene.model import Scene
from lgp.scene.scene_file import load_scene, read_scene
from tests.support.lgp_worlds import HUMAN_ONLY, human_world, needs_robots
from tests.support.says import says


def in_the_table() -> World:
    """Return a world in which a table reaches 5 cm into the abdomen of the person."""
    scene = human_world().scene
    name, table = next(iter(scene.tables.items()))
    deeper = dataclasses.replace(table, position=(table.size[0] / 2.0 + 0.05, 0.0), height=1.0)
    return World(dataclasses.replace(scene, tables={**scene.tables, name: deeper}, objects={}))


def test_the_pairs_are_named_the_deepest_first_and_refused() -> None:
    world = in_the_table()
    pairs = start_penetrations(world, world.initial_configuration)
    assert "human.abdomen" in {pairs[0].first, pairs[0].second}
    assert [pair.depth for pair in pairs] == sorted((pair.depth for pair in pairs), reverse=True)
    with pytest.raises(WorldError) as error:
        check_start(world, world.initial_configuration)
    says(error, "at the start", "mm inside", "accept the start")


def test_a_pair_is_named_once() -> None:
    """A palm and a table edge that cross have several points at which they are in each other."""
    person = {"stature": 1.6, "sex": "female", "hands": ["right_hand"]}
    table = {"position": [0.5, 0.0], "size": [0.35, 0.5], "height": 0.95}
    world = World(read_scene(HUMAN_ONLY | {"human": person, "tables": {"near": table}}))
    pairs = start_penetrations(world, world.initial_configuration)
    assert {frozenset((one.first, one.second)) for one in pairs} == {
        frozenset((f"human.{side}_palm", "table.near")) for side in ("left", "right")
    }
    assert len(pairs) == 2


def blocked() -> Scene:
    """Return a scene in which a table reaches into the person, who does not act."""
    scene = load_scene("screwdriver")
    table = dataclasses.replace(scene.tables["table.center"], position=(0.2, 0.0), height=1.0)
    return dataclasses.replace(scene, tables={**scene.tables, "table.center": table})


@needs_robots
def test_a_plan_refuses_such_a_start_unless_it_is_accepted() -> None:
    scene = dataclasses.replace(blocked(), goal=("grasped(baxter.right, screwdriver)",))
    with pytest.raises(WorldError):
        lgp.plan(scene, cost=None)
    plan = lgp.plan(scene, cost=None, accept_start=True)
    assert plan.feasible
    assert plan.residuals["start_penetration"] > 0.01


@needs_robots
def test_where_the_goal_holds_nothing_moves_and_the_depth_is_stated() -> None:
    plan = lgp.plan(dataclasses.replace(blocked(), goal=("placed(screwdriver, table.start)",)), cost=None)
    assert plan.feasible
    assert plan.residuals["start_penetration"] > 0.01


@pytest.mark.parametrize("side", ["left", "right"])
def test_an_upper_arm_is_kept_from_the_own_body(side: str) -> None:
    world = human_world()
    assert start_penetrations(world, world.initial_configuration) == ()
    inwards = world.initial_configuration.copy()
    inwards[world.column[f"human.{side}_shoulder_X"]] = np.radians(-30.0)
    pairs = {frozenset((one.first, one.second)): one.depth for one in start_penetrations(world, inwards)}
    for part, depth in (("abdomen", 0.1058), ("trunk", 0.0721)):
        assert pairs[frozenset((f"human.{side}_upper_arm", f"human.{part}"))] == pytest.approx(depth, abs=2e-4)
