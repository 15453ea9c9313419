"""Tables that robots carry: where they and what rests on them are, with derivatives, and which links can carry one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.collision.distances import Collisions
from lgp.errors import SceneError, WorldError
from lgp.kinematics.attachments import fixed_on, placed
from lgp.kinematics.cost_terms import ConfigurationMoment
from lgp.kinematics.features import logarithm
from lgp.kinematics.modes import KinematicSwitch, ModeSequence
from lgp.kinematics.world import World
from lgp.path.action_constraints import PlannedMoment
from lgp.scene.scene_file import load_scene, read_scene
from tests.support.carried_tray import DRIVEN, TRAY, tray_values
from tests.support.gantry import BOX, HEIGHT, TABLES
from tests.support.paths import ROOT
from tests.support.says import says

ON_TRAY = BOX | {"on": "table.tray", "at": [0.1, 0.05, 20]}
STEP = 1e-6


def world_of(folder: Path, **changes: Any) -> World:
    return World(read_scene(tray_values(folder, **changes)))


def test_what_rests_on_a_tray_goes_where_its_robot_goes(tmp_path: Path) -> None:
    world = world_of(tmp_path, objects={"box": ON_TRAY})
    box = fixed_on(world.scene.tables["table.tray"], world.scene.objects["box"])
    at = world.at(np.array([[0.0, 0.5, 1.0, 0.2], [DRIVEN, -0.5, 1.0, 0.0]]), ["table.tray"])
    pose = box.pose(at, np.zeros(0))
    # The tray is turned by 90 deg: its x is the y of the bridge.
    np.testing.assert_allclose(pose.position, [[-0.05, 1.1, HEIGHT + 0.04], [DRIVEN - 0.05, 1.1, HEIGHT + 0.04]])
    np.testing.assert_allclose(logarithm(pose.rotation)[:, 2], np.radians(110.0))
    assert at.table("table.tray", 1).position == pytest.approx((DRIVEN, 1.0))
    assert at.table("table.tray", 1).yaw == pytest.approx(90.0)
    assert at.table("table.a") is world.scene.tables["table.a"]


def test_slopes_of_a_placement_on_a_tray_are_those_of_differences() -> None:
    world = World(load_scene(ROOT / "examples" / "scenes" / "waiter.toml"))
    table, bottle = world.scene.tables["table.tray"], world.scene.objects["bottle"]
    place, z = placed(table, bottle, 0), np.array([0.05, -0.1, 0.7])
    rng = np.random.default_rng(0)
    q = world.initial_configuration + 0.1 * rng.standard_normal(world.nq)

    def pose(q: Any, z: Any) -> Any:
        return place.pose(world.at(q[None], ["table.tray"]), z)

    here = pose(q, z)
    moved = [pose(q + STEP * unit, z) for unit in np.eye(world.nq)]
    moved += [pose(q, z + STEP * unit) for unit in np.eye(3)]
    slopes = np.concatenate([here.by_q[0], here.by_variables[0]], axis=1)
    for column, there in enumerate(moved):
        turned = logarithm(there.rotation @ np.swapaxes(here.rotation, 1, 2))[0]
        change = np.concatenate([there.position[0] - here.position[0], turned]) / STEP
        np.testing.assert_allclose(slopes[:, column], change, atol=1e-5)
    fit = place.fit(world.at(q[None], ["table.tray"]), here.rotation[0], here.position[0], 0)
    np.testing.assert_allclose(fit, z)


def test_a_switch_at_a_tray_is_about_the_joints_of_its_robot_too(tmp_path: Path) -> None:
    values = tray_values(tmp_path, objects={"box": ON_TRAY})
    other = values["robots"]["gantry"] | {"position": [0.0, 3.0, 0.0]}
    values["robots"] = {"gantry": values["robots"]["gantry"], "other": other}
    world = World(read_scene(values | {"initial": [*values["initial"], "free(other.hand)"]}))
    modes = ModeSequence(world, [KinematicSwitch("grasp", "other.hand", "box")])
    assert modes.acting(0) == ("other.hand", "table.tray")
    assert set(modes.frames) == {"other.hand", "table.tray"}


def test_moments_of_actions_and_cost_terms_know_where_a_tray_is(tmp_path: Path) -> None:
    world = world_of(tmp_path, objects={"box": ON_TRAY})
    q = np.array([[DRIVEN, 0.0, 1.0, 0.0]])
    modes = ModeSequence(world, [KinematicSwitch("grasp", "gantry.hand", "box")])
    for moment in (PlannedMoment(modes, 0, 0, q, np.zeros(modes.size)), ConfigurationMoment(world, q)):
        tray = moment.place("table.tray")
        np.testing.assert_allclose(tray.position, [[DRIVEN, 1.0, HEIGHT]])
        assert tray.jacobian[0, 0, 0] == 1.0


def test_a_tray_meets_tables_but_not_what_carries_it(tmp_path: Path) -> None:
    world = world_of(tmp_path)
    collisions = Collisions(world)
    pairs = {frozenset(collisions.shapes[side].name for side in pair) for pair in collisions.pairs}
    assert {frozenset(("table.tray", "table.a")), frozenset(("table.tray", "gantry.tool"))} <= pairs
    carried = Collisions(World(load_scene(ROOT / "examples" / "scenes" / "waiter.toml")))
    pairs = {frozenset(carried.shapes[side].name for side in pair) for pair in carried.pairs}
    assert not {frozenset(("table.tray", name)) for name in ("waiter.deck", "waiter.cart", "waiter.cart/2")} & pairs
    assert frozenset(("table.tray", "waiter.fore")) in pairs


def test_other_heights_of_a_tray_are_those_of_another_world(tmp_path: Path) -> None:
    world = world_of(tmp_path)
    higher = world.with_scene(world.scene.with_heights({"tray": 1.1}))
    at = higher.at(higher.initial_configuration[None], ["table.tray"])
    assert at.table("table.tray").height == pytest.approx(1.1)
    assert world.with_scene(world.scene.with_heights({"a": 0.9})).model is world.model


@pytest.mark.parametrize(
    ("frame", "facts"),
    [
        ("gantry.tool", ("table.tray is on gantry.tool", "gantry.tilt tilts it", "lock the joint")),
        ("gantry.tip", ("table.tray is on gantry.tip", "gantry.tilt tilts it")),
        ("gantry.brigde", ("table.tray is on 'gantry.brigde'", "gantry.bridge")),
    ],
)
def test_links_that_cannot_carry_a_table_are_named(tmp_path: Path, frame: str, facts: tuple[str, ...]) -> None:
    with pytest.raises(WorldError) as error:
        world_of(tmp_path, tables={**TABLES, "tray": TRAY | {"frame": frame}})
    says(error, *facts)


@pytest.mark.parametrize("frame", ["gantry.tip", "tipp"])
def test_a_frame_of_a_hand_is_one_of_its_robot(tmp_path: Path, frame: str) -> None:
    values = tray_values(tmp_path)
    values["robots"]["gantry"]["hands"]["hand"]["frame"] = frame
    with pytest.raises(WorldError) as error:
        World(read_scene(values))
    says(error, "gantry.hand: frame is", repr(frame), "of gantry", "did you mean 'tip'")


@pytest.mark.parametrize(
    ("changes", "facts"),
    [
        ({"frame": "gantri.bridge"}, ("tables.tray", "'gantri.bridge'", "of no robot", "gantry")),
        ({"frame": "gantry"}, ("tables.tray", "'gantry'", "of no robot")),
        ({"frame": "bridge"}, ("tables.tray", "'bridge'", "ROBOT.LINK")),
        ({"clearance": 0.3}, ("tables.tray", "frame and clearance")),
    ],
)
def test_wrong_keys_of_a_carried_table_are_named(
    tmp_path: Path, changes: dict[str, Any], facts: tuple[str, ...]
) -> None:
    values = tray_values(tmp_path, tables={**TABLES, "tray": TRAY | changes})
    with pytest.raises(SceneError) as error:
        read_scene(values)
    says(error, *facts)


def test_a_plan_puts_a_box_on_a_tray(tmp_path: Path) -> None:
    values = tray_values(tmp_path, goal=["placed(box, table.tray)"])
    values["robots"]["gantry"]["joints"] = {"z": 1.3}
    plan = lgp.plan(read_scene(values), cost=None)
    assert [action.partition("(")[0] for action in plan.actions] == ["grasp", "place"]
    assert not lgp.audit_plan(plan).faults
    plan.save(tmp_path / "plan")
    assert lgp.Plan.load(tmp_path / "plan").scene.tables["table.tray"].frame == "gantry.bridge"
