"""A person who may step: one standing place for each phase, in a region, for a cost."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.collision.placements import ShapePlacements
from lgp.collision.scene_shapes import collision_shapes
from lgp.errors import SceneError
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import World
from lgp.page.sentences import Instruction, instructions
from lgp.page.steps import with_steps
from lgp.scene.mobile_base import standing_from
from lgp.scene.scene_file import load_scene, read_scene
from tests.support.paths import ROOT
from tests.support.says import says

SCENE = ROOT / "examples" / "scenes" / "steps.toml"
PLACE = ("human.base_x", "human.base_y", "human.base_yaw")


@cache
def _plan(cost: float = 0.5) -> lgp.Plan:
    return lgp.plan(load_scene(SCENE, {"human.step.cost": cost}), cost=None, collisions=False)


def _places(plan: lgp.Plan) -> Any:
    return plan.path[:, [plan.joints.index(name) for name in PLACE]]


@pytest.mark.slow
def test_a_person_steps_first_and_stands_while_it_takes_and_puts() -> None:
    plan = _plan()
    assert plan.feasible, plan.reason
    places, each = _places(plan), len(plan.path) // 2
    for number in range(2):
        standing = places[number * each + standing_from(each) : (number + 1) * each]
        np.testing.assert_allclose(standing, np.broadcast_to(standing[-1], standing.shape), atol=1e-5)
    assert np.linalg.norm(places[-1, :2] - places[each - 1, :2]) > 0.5, "it steps between both tables"
    assert not {fault.kind for fault in lgp.audit_plan(plan).faults} & {"feet", "speed", "limit", "attachment"}


@pytest.mark.slow
def test_a_dearer_step_is_a_shorter_one() -> None:
    way = [np.abs(np.diff(_places(_plan(cost))[:, 1], prepend=0.0)).sum() for cost in (0.1, 10.0)]
    assert way[0] > way[1] > 0.2


@pytest.mark.slow
def test_no_plan_without_steps() -> None:
    values = dict(load_scene(SCENE).values)
    values["human"] = {key: value for key, value in values["human"].items() if key != "step"}
    plan = lgp.plan(read_scene(values), cost=None, collisions=False)
    assert not plan.feasible
    assert "short" in plan.reason


@pytest.mark.slow
def test_the_audit_sees_steps_where_a_person_has_to_stand() -> None:
    plan = _plan()
    path = plan.path.copy()
    path[-2, plan.joints.index("human.base_y")] += 0.05
    faults = [fault for fault in lgp.audit_plan(replace(plan, path=path)).faults if fault.kind == "feet"]
    assert any("steps by 0.05 m" in fault.what for fault in faults)


@pytest.mark.slow
def test_the_page_says_where_to_step() -> None:
    motion = lgp.Motion(_plan())
    ends = np.append(0, motion.phases.ends + 1)
    first, second = with_steps(instructions(motion.phases), motion.world, motion.path[ends])
    assert first.text.startswith("Step ")
    assert "m to the right" in first.text
    assert "m to the left" in second.text


def test_a_step_and_a_turn_are_said_in_their_order() -> None:
    world = World(load_scene(SCENE))
    path = np.tile(world.initial_configuration, (3, 1))
    path[1:, [world.column["human.base_y"], world.column["human.base_yaw"]]] = -0.5, np.radians(30.0)
    lines = [Instruction("Take the box.", "", True, "You", "box"), Instruction("Wait.", "", True, "You", "box")]
    said = [line.text for line in with_steps(lines, world, path)]
    assert said == ["Step 0.50 m to the right, then turn 30 deg to the left. Take the box.", "Wait."]


def test_legs_follow_the_place_and_its_derivatives_are_right() -> None:
    world = World(load_scene(SCENE))
    modes = ModeSequence(world, [])
    shapes = collision_shapes(world)
    legs = np.array([number for number, shape in enumerate(shapes) if shape.leg], np.intp)
    placements = ShapePlacements(world, modes, shapes)
    frames = placements.frames_of(legs)
    assert "human.base_yaw" in frames
    rng = np.random.default_rng(3)
    q = world.initial_configuration[None].copy()
    q[0, [world.column[name] for name in PLACE]] = rng.uniform(-0.2, 0.2, 3)
    rows, phases = np.zeros(len(legs), np.intp), np.zeros(1, np.intp)

    def centres(at: Any) -> Any:
        return placements.poses(world.at(at, frames), phases, np.zeros(0), rows, legs)[1]

    middle = centres(q)
    kinematics = world.at(q, frames)
    step = 1e-6
    for axis in np.eye(3):
        normals = np.broadcast_to(axis, middle.shape).copy()
        slope, _ = placements.speeds(kinematics, phases, np.zeros(0), rows, legs, middle, normals)
        for column in range(world.nq):
            moved = q.copy()
            moved[0, column] += step
            numeric = (centres(moved) - middle) @ axis / step
            np.testing.assert_allclose(slope[:, column], numeric, atol=2e-4)


def test_legs_that_cannot_step_are_refused() -> None:
    values = dict(load_scene(SCENE).values)
    values["human"] = {**values["human"], "legs": "planted"}
    with pytest.raises(SceneError) as error:
        read_scene(values)
    says(error, "planted", '"solved"', "leave out")
