"""Bodies of an audit: the person and robots where kinematics of their own put them, and how deep they are."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lgp.audit.agents import person_model, robot_model
from lgp.audit.audit import audit_plan, bodies_of
from lgp.audit.contacts import allowed_depths
from lgp.audit.joint_tree import about, attached, place, values_of
from lgp.audit.neighbours import drawn_into_each_other
from lgp.audit.penetration import deepest, penetration
from lgp.audit.replay import replay
from lgp.audit.robot_file import robot_file
from lgp.audit.samples import Samples
from lgp.audit.shapes import ball, box, capsule, cylinder, mesh
from lgp.collision.scene_shapes import collision_shapes
from lgp.errors import WorldError
from lgp.kinematics.human import human_model
from lgp.kinematics.world import World
from lgp.plan_record import Plan
from lgp.scene.model import Human, Robot
from lgp.scene.scene_file import load_scene
from tests.support.gantry import BELOW, BOX, GRIP, JOINTS, START, TAKE, carried, made_plan, scene_values, through
from tests.support.lgp_worlds import anywhere, human_world, needs_robots, screwdriver_world
from tests.support.robot_files import LIFT_ARM, arm_world
from tests.support.says import says

TURN = about(np.array([0.6, 0.0, 0.8]), np.array([0.7]))[0]


def agreement(world: World) -> float:
    """Return the largest difference [m] of grip points and capsule joints from those of a world."""
    q = anywhere(world, 20)
    worst = 0.0
    for agent in world.scene.agents:
        model = person_model(agent) if isinstance(agent, Human) else robot_model(agent)  # type: ignore[arg-type]
        values = values_of(model.joints, dict(zip(world.joints, q.T, strict=True)), model.fixed)
        turned, at = attached(*place(model.joints, model.rotation, model.position, values, len(q)),
                              list(model.hands.values()))  # fmt: skip
        kinematics = world.at(q, list(model.hands))
        for number, hand in enumerate(model.hands):
            placed = kinematics.placement(hand)
            worst = max(worst, float(np.abs(at[number] - placed.position).max()))
            worst = max(worst, float(np.abs(turned[number] - placed.rotation).max()))
    return worst


@pytest.mark.parametrize("legs", ["solved", "planted", "locked"])
def test_the_person_stands_where_pinocchio_has_them(legs: str) -> None:
    assert agreement(human_world(legs)) < 1e-12


@needs_robots
def test_robots_stand_where_pinocchio_has_them() -> None:
    assert agreement(screwdriver_world()) < 1e-12
    panda = load_scene("screwdriver_panda")
    assert agreement(World(panda)) < 1e-12


@pytest.mark.parametrize("rotation", [[0, 90, 0], [180, 0, 0], [10, -20, 200]])
def test_a_hand_whose_axes_are_not_those_of_its_frame(rotation: list[float], tmp_path: Path) -> None:
    hands = {"own": {"frame": "l5", "reach": 0.12, "rotation": rotation}, "tcp": {"frame": "tcp"}}
    world = arm_world(tmp_path, hands=hands)
    assert agreement(world) < 1e-12
    frames = world.at(anywhere(world, 5), ["arm.tcp", "arm.own"])
    same = [
        np.allclose(frames.placement(hand).position, frames.placement("arm.own").position)
        for hand in ("arm.tcp", "arm.own")
    ]
    assert same == [rotation == [0, 90, 0], True], "the link `tcp` is there, its z along x of the link before it"
    turns = frames.placement("arm.tcp").rotation.transpose(0, 2, 1) @ frames.placement("arm.own").rotation
    np.testing.assert_allclose(turns, turns[:1].repeat(5, axis=0), atol=1e-12)


@pytest.mark.parametrize(
    "hand", [{"frame": "l5"}, {"frame": "tcp", "reach": 0.1}, {"frame": "tcp", "rotation": [0, 0, 9]}]
)
def test_a_hand_is_not_named_as_a_link_elsewhere(hand: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(WorldError) as error:
        arm_world(tmp_path, hands={"tcp": hand})
    says(error, "arm.tcp", "is a link or joint of arm elsewhere", "another name")


@pytest.mark.parametrize(("frame", "hint"), [("tcpp", "did you mean 'tcp'"), ("wrong", "tcp, tcp_joint")])
def test_a_frame_that_is_not_there_is_answered_by_those_that_are(frame: str, hint: str, tmp_path: Path) -> None:
    with pytest.raises(WorldError) as error:
        arm_world(tmp_path, hands={"hand": {"frame": frame}})
    says(error, f"arm.hand: frame is {frame!r}, expected a link or joint of arm", hint)


@pytest.mark.parametrize("locked", [[], ["l5", "fl"], ["*"]])
def test_links_may_have_the_names_of_joints(locked: list[str], tmp_path: Path) -> None:
    named = {"lift": "l0", "pan": "l1", "shoulder": "l2", "elbow": "l3", "level": "l4", "wrist": "l5", "f1": "fl"}
    urdf = LIFT_ARM.replace('"tcp_joint"', '"tcp"').replace('"f2"', '"fr"')
    for joint, link in named.items():
        for tag in ("<joint name", "<mimic joint"):
            urdf = urdf.replace(f'{tag}="{joint}"', f'{tag}="{link}"')
    world = arm_world(tmp_path, urdf, locked=locked, hands={"own": {"frame": "l5"}, "tcp": {"frame": "tcp"}})
    free = [] if locked == ["*"] else [f"arm.{name}" for name in named.values() if name not in locked]
    assert sorted(world.joints) == sorted(free)
    assert agreement(world) < 1e-12


def test_joints_that_follow_another_and_limits_are_those_of_the_urdf(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    model = robot_model(plan.scene.robots["gantry"])
    joints = {joint.name: joint for joint in model.joints}
    assert joints["gantry.jaw2"].follows == ("gantry.jaw1", 1.0, 0.0)
    assert (joints["gantry.z"].lower, joints["gantry.z"].upper, joints["gantry.z"].speed) == (0.0, 3.0, 4.0)
    assert set(human_model(1.75, "male").names[1:]) == {
        joint.name.removeprefix("human.")
        for joint in person_model(human_world().scene.human).joints  # type: ignore[arg-type]
    }


@pytest.mark.parametrize(
    ("one", "other", "away", "depth"),
    [
        (ball(0.05), box((0.4, 0.4, 0.1)), (0.0, 0.0, 0.08), 0.02),
        (ball(0.05), ball(0.04), (0.03, 0.04, 0.0), 0.04),
        (capsule(0.04, 0.3), ball(0.05), (0.06, 0.0, 0.1), 0.03),
        (box((0.1, 0.1, 0.1)), box((0.2, 0.2, 0.2)), (0.13, 0.0, 0.02), 0.02),
        (cylinder(0.06, 0.2), box((0.2, 0.2, 0.2)), (0.15, 0.0, 0.0), 0.01),
        (cylinder(0.06, 0.2), box((0.2, 0.2, 0.2)), (0.0, 0.05, 0.17), 0.03),
        (ball(0.05), box((0.4, 0.4, 0.1)), (0.0, 0.0, 0.11), 0.0),
    ],
)
def test_the_depth_of_simple_bodies(one: Any, other: Any, away: tuple[float, float, float], depth: float) -> None:
    at = TURN @ np.array(away)
    assert penetration(one, TURN, at, other, TURN, np.zeros(3)) == pytest.approx(depth, abs=2e-5)
    assert penetration(other, TURN, np.zeros(3), one, TURN, at) == pytest.approx(depth, abs=2e-5)


def test_the_depth_of_boxes_is_the_least_overlap_along_their_axes() -> None:
    rng = np.random.default_rng(5)
    deep = 0
    for _ in range(200):
        sizes, away = rng.uniform(0.02, 0.5, (2, 3)), rng.normal(0.0, 0.2, 3)
        one, other = (about(axis / np.linalg.norm(axis), rng.uniform(0, 3, 1))[0] for axis in rng.normal(size=(2, 3)))
        axes = [*one.T, *other.T, *(np.cross(a, b) for a in one.T for b in other.T)]
        overlaps = [
            (np.abs(one.T @ axis) @ sizes[0] / 2 + np.abs(other.T @ axis) @ sizes[1] / 2 - abs(axis @ away))
            / np.linalg.norm(axis)
            for axis in axes
        ]
        depth = penetration(box(sizes[0]), one, np.zeros(3), box(sizes[1]), other, away)
        assert depth == pytest.approx(max(min(overlaps), 0.0), abs=1e-6)
        deep += depth > 0.01
    assert deep > 50


def bracket() -> Any:
    """Return an L of two plates, 1 m along x and along z and 0.1 m thick, as one mesh with its middle."""
    corners = np.array([[0, 0], [1, 0], [1, 0.1], [0.1, 0.1], [0.1, 1], [0, 1]], float)
    vertices = np.array([[x, y, z] for y in (0.0, 0.2) for x, z in corners])
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]
    sides = [[k, (k + 1) % 6, (k + 1) % 6 + 6] for k in range(6)] + [[k, (k + 1) % 6 + 6, k + 6] for k in range(6)]
    return mesh(vertices, np.array(faces + [[c + 6, b + 6, a + 6] for a, b, c in faces] + [s[::-1] for s in sides]))


def test_a_mesh_is_its_triangles_and_not_its_hull() -> None:
    shape, middle = bracket()
    inside_hull = np.array([0.3, 0.1, 0.3]) - middle
    assert penetration(shape, np.eye(3), np.zeros(3), ball(0.05), np.eye(3), inside_hull) == 0.0
    near_plate = np.array([0.5, 0.1, 0.13]) - middle
    assert penetration(shape, np.eye(3), np.zeros(3), ball(0.05), np.eye(3), near_plate) == pytest.approx(
        0.02, abs=1e-6
    )
    within = np.array([0.5, 0.1, 0.05]) - middle
    assert shape.surrounds(within)
    assert not shape.surrounds(inside_hull)
    # A ball whose middle is 2 cm behind the surface is deeper in than its triangles.
    behind = np.array([0.5, 0.1, 0.08]) - middle
    assert penetration(shape, np.eye(3), np.zeros(3), ball(0.05), np.eye(3), behind) >= 0.07 - 1e-6
    # Wholly inside of the plate, where it crosses no triangle.
    assert penetration(shape, np.eye(3), np.zeros(3), ball(0.01), np.eye(3), within) > 0.01


def with_person(folder: Path, **changes: Any) -> dict[str, Any]:
    """Return the scene of the gantry with a person on the other side of the room, standing upright."""
    upright = {f"{side}_elbow_{axis}": 0 for side in ("left", "right") for axis in "Z"}
    human = {"stature": 1.75, "position": [0.0, 2.0], "hands": ["right_hand"], "joints": upright}
    return scene_values(folder, human=human) | changes


def person_plan(values: dict[str, Any], path: Any, start: Any) -> Plan:
    """Return a plan in which the gantry moves, and the person stands still."""
    return made_plan(values, ["grasp(1, gantry.hand, box)"], path, np.array(start), JOINTS)


def palm_middle(plan: Plan) -> Any:
    """Return the middle (3,) [m] of the right palm."""
    bodies, _, position, _ = bodies_of(replay(Samples.of(plan)))
    return position[next(n for n, body in enumerate(bodies) if body.name == "human.right_palm")][0]


def test_a_hand_in_a_gripper(tmp_path: Path) -> None:
    """The ball of the gripper passes the palm of the person at a known distance beside its middle."""
    values = with_person(tmp_path)
    still = through(START, TAKE, each=(10,))
    x, y, z = palm_middle(person_plan(values, still, START))
    path = still.copy()
    path[3] = (x + 0.05 + 0.02 - 0.012, y, z, 0.0)
    audit = audit_plan(person_plan(values, path, START))
    contact = next(one for one in audit.contacts if one.pair == ("human.right_palm", "gantry.tool"))
    assert contact.pair_class == "person/robot"
    assert contact.depth == pytest.approx(0.012, abs=2e-3)  # the capsule of the palm is not quite upright
    assert contact.time == pytest.approx(0.8, abs=0.05)
    assert audit.hands.value is not None
    assert audit.hands.of == ("human.right_hand", "gantry.hand")


def test_jaws_are_open_until_they_take_something(tmp_path: Path) -> None:
    """A finger meets the palm only where its jaw is open."""
    plan = carried(tmp_path)
    run = replay(Samples.of(plan))
    bodies, _, position, _ = bodies_of(run)
    finger = position[next(n for n, body in enumerate(bodies) if body.name == "gantry.f1")][:, 1]
    at = int(run.samples.switches[0])
    assert finger[: at + 1] == pytest.approx(0.04 + 0.005)
    assert finger[at + 1 : run.samples.switches[1] + 1] == pytest.approx(0.03 + 0.005)  # the box is 6 cm wide
    values = with_person(tmp_path)
    still = through(START, TAKE, each=(10,))
    x, y, z = palm_middle(person_plan(values, still, START))
    path = still.copy()
    path[3] = (x, y - 0.04 - 0.005, z + 0.10, 0.0)
    pairs = {one.pair for one in audit_plan(person_plan(values, path, START)).contacts}
    assert ("human.right_palm", "gantry.f1") in pairs
    assert ("human.right_palm", "gantry.f2") not in pairs


def test_a_robot_that_does_not_move_has_a_hand_too(tmp_path: Path) -> None:
    """The box that it holds out all the time is 1 cm in the ball of its gripper."""
    values = with_person(tmp_path)
    values["robots"]["gantry"] |= {"locked": ["*"], "joints": {"z": 1.5}}
    values["objects"] = {"box": {"size": [0.1, 0.06, 0.12], "mass": 1, "on": "table.a", "hand": "gantry.hand"}}
    values |= {"initial": ["grasped(gantry.hand, box)"], "goal": ["grasped(gantry.hand, box)"]}
    path = np.zeros((10, 1))
    plan = made_plan(values, ["release(1, gantry.hand, box)"], path, np.zeros(1), ["human.right_wrist_Z"])
    audit = audit_plan(plan)
    assert audit.clean, audit.faults


def test_jaws_that_do_not_open_as_wide_as_an_object_are_named(tmp_path: Path) -> None:
    assert audit_plan(carried(tmp_path)).unaudited == ()
    wide = {"box": {**BOX, "size": [0.1, 0.12, 0.08]}}
    text = "whether the jaws of gantry.hand can hold box: it is 12.0 cm wide across them and they open 8.0 cm"
    text += "; the freedom of the hand and the grips of the object say how it is taken"
    assert audit_plan(carried(tmp_path, objects=wide)).unaudited == (text,)


@pytest.mark.parametrize("legs", ["solved", "planted", "locked"])
def test_a_leg_in_the_edge_of_a_table(tmp_path: Path, legs: str) -> None:
    """A straight shank of 6 cm radius is 25 mm in the edge of a low table in front of it."""
    names = {"pelvis_z": 0.0} | {f"{side}_{joint}": 0.0 for side in ("left", "right")
                                 for joint in ("hip_Z", "knee_Z", "ankle_Z")}  # fmt: skip
    human = {"stature": 1.75, "position": [0.0, 2.0], "hands": ["right_hand"], "legs": legs, "joints": names}
    low = {"low": {"position": [0.035 + 0.2, 2.0], "size": [0.4, 1.0], "height": 0.3}}
    values = scene_values(tmp_path, human=human)
    values["tables"] = values["tables"] | low
    audit = audit_plan(person_plan(values, through(START, TAKE, each=(10,)), START))
    legs_in = {one.pair: one.depth for one in audit.contacts}
    assert legs_in == {
        (f"human.{side}_shank", "table.low"): pytest.approx(0.025, abs=1e-4) for side in ("left", "right")
    }


def test_a_leg_that_is_too_short(tmp_path: Path) -> None:
    values = with_person(tmp_path)
    path = np.column_stack([through(START, TAKE, each=(10,)), np.linspace(0.0, 0.12, 10)])
    joints = (*JOINTS, "human.pelvis_x")
    plan = made_plan(values, ["grasp(1, gantry.hand, box)"], path, np.array([*START, 0.0]), joints)
    faults = [fault for fault in audit_plan(plan).faults if fault.kind == "feet"]
    assert [fault.what.split(" is ")[0] for fault in faults] == ["the left leg of human", "the right leg of human"]
    leg = float(np.linalg.norm([0.12, 0.8676])) - 0.8676  # thigh and shank of 1.75 m, at the rest height about
    assert faults[0].amount == pytest.approx(leg, abs=5e-3)
    assert faults[0].time == pytest.approx(2.0)


def test_planted_soles_that_move(tmp_path: Path) -> None:
    human = {"stature": 1.75, "position": [0.0, 2.0], "hands": ["right_hand"], "legs": "planted"}
    values = scene_values(tmp_path, human=human)
    knee = np.column_stack([through(START, TAKE, each=(10,)), np.linspace(0.2, 0.5, 10)])
    joints = (*JOINTS, "human.left_knee_Z")
    plan = made_plan(values, ["grasp(1, gantry.hand, box)"], knee, np.array([*START, 0.2]), joints)
    assert any(fault.kind == "feet" and "human.left_sole" in fault.what for fault in audit_plan(plan).faults)


def test_a_person_s_joint_that_is_too_fast(tmp_path: Path) -> None:
    values = with_person(tmp_path)
    wrist = np.zeros(10)
    wrist[5:] = 1.2
    path = np.column_stack([through(START, TAKE, each=(10,)), wrist])
    plan = made_plan(values, ["grasp(1, gantry.hand, box)"], path, np.array([*START, 0.0]),
                     (*JOINTS, "human.right_wrist_Z"))  # fmt: skip
    fault = next(fault for fault in audit_plan(plan).faults if fault.kind == "speed")
    # From rest to rest in one slice: 1.5 times the mean speed, less the coarseness of ten samples.
    assert fault.amount == pytest.approx(1.5 * np.degrees(1.2) / 0.2 / 360.0, rel=0.02)
    assert fault.time == pytest.approx(1.1, abs=0.021)


ASSEMBLY = {
    "parts": ["box", "lid"], "position": [0.0, 0.0, 0.05], "yaw": 0.0,
    "screw": [0.0, 0.0, 0.06], "along": [0, 0, -1], "tool": 0.1,
}  # fmt: skip


def screwed(folder: Path, lid_at: float) -> Plan:
    """Return a plan that screws a lid, which already lies on the other side of the box, with the tool over it."""
    table = {"a": {"position": [0, 0], "size": [0.4, 0.4], "height": 0.8},
             "shelf": {"position": [0, 0], "size": [0.1, 0.06], "height": 0.88, "thickness": 0.001}}  # fmt: skip
    objects = {"box": {"size": [0.1, 0.06, 0.08], "mass": 1, "on": "table.a"},
               "lid": {"size": [0.1, 0.06, 0.02], "mass": 1, "on": "table.shelf", "at": [lid_at, 0, 0]}}  # fmt: skip
    values = scene_values(folder, tables=table, objects=objects, joints=[ASSEMBLY], domain="toolbox",
                          initial=["on_table(box)", "on_table(lid)", "free(gantry.hand)"],
                          goal=["screwed(box, lid)"])  # fmt: skip
    end = (0.0, 0.0, 0.84 + 0.06 + 0.1 + 0.1, 0.0)
    return made_plan(values, ["screw(1, gantry.hand, box, lid)"], through(START, end, each=(10,)), np.array(START))


def test_a_screw_of_parts_that_stand_as_assembled(tmp_path: Path) -> None:
    faults = [fault for fault in audit_plan(screwed(tmp_path, 0.0)).faults if fault.kind != "contact"]
    assert faults == []
    texts = [fault.what for fault in audit_plan(screwed(tmp_path, 0.004)).faults if fault.kind != "contact"]
    assert texts == ["screw(1, gantry.hand, box, lid): lid is 4.0 mm from its place beside box"]


def test_a_hand_that_moves_while_it_holds(tmp_path: Path) -> None:
    values = scene_values(tmp_path, goal=["holding(gantry.hand, box)"], domain="toolbox")
    path = np.concatenate([through(START, TAKE, each=(10,)), through(TAKE, (0, 0.02, GRIP, 0.1), each=(10,))])
    actions = ["hold(1, gantry.hand, box)", "release(2, gantry.hand, box)"]
    plan = made_plan(values, actions, path, np.array(START))
    texts = [str(fault) for fault in audit_plan(plan).faults]
    moved = 1000 * np.hypot(0.02 + BELOW * np.sin(0.1), BELOW * (1 - np.cos(0.1)))
    assert "gantry.hand turns 5.7 deg while it holds box at 4.00 s" in texts
    assert f"gantry.hand moves {moved:.1f} mm while it holds box at 4.00 s" in texts
    assert "the goal holding(gantry.hand, box) does not hold at 4.00 s" in texts


def test_a_robot_without_bodies_is_named(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    file = Path(plan.scene.robots["gantry"].model)
    file.with_name("bare.urdf").write_text(re.sub("<collision>.*?</collision>", "", file.read_text(), flags=re.DOTALL))
    robot = replace(plan.scene.robots["gantry"], model=str(file.with_name("bare.urdf")))
    audit = audit_plan(replace(plan, scene=replace(plan.scene, robots={"gantry": robot})))
    assert audit.unaudited == ("gantry: its URDF has no <collision>, so it has no body",)
    assert audit.clean


def test_a_link_whose_mesh_is_not_there_is_named(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    file = Path(plan.scene.robots["gantry"].model)
    file.write_text(file.read_text().replace('<sphere radius="0.05"/>', '<mesh filename="tool.stl"/>'))
    robot_file.cache_clear()
    audit = audit_plan(plan)
    assert audit.unaudited == ("gantry: link 'tool' has no body, because its mesh 'tool.stl' is not there",)


@needs_robots
def test_bodies_that_a_urdf_draws_into_each_other_are_neighbours() -> None:
    robot = load_scene("screwdriver").robots["baxter"]
    model = robot_model(robot)
    assert model.file is not None
    names = [body.name.removeprefix("baxter.") for body, _ in model.parts]
    drawn = {(names[one], names[other]) for one, other in drawn_into_each_other(model.file)}
    assert ("right_upper_elbow_visual", "right_lower_elbow") in drawn
    assert not {pair for pair in drawn if {"torso", "pedestal"} & set(pair)}


@pytest.mark.slow
@needs_robots
def test_what_is_left_out_first_would_not_be_found_either() -> None:
    """The audit agrees with all pairs in all samples, without any box around them."""
    for name in ("screwdriver", "screwdriver_panda"):
        scene = load_scene(name)
        rng = np.random.default_rng(3)
        world = World(scene)
        ends = np.clip(world.initial_configuration + rng.normal(0, 0.25, (2, world.nq)), world.lower, world.upper)
        path = through(world.initial_configuration, *ends, each=(5, 5))
        robot = next(iter(scene.robots.values()))
        assert isinstance(robot, Robot)
        action = f"grasp(1, {robot.hands[-1].full}, screwdriver)"
        plan = Plan(scene, True, "given", "", world.joints, world.initial_configuration, {}, (action,),
                    np.arange(1, 11) * 0.2, np.zeros(10, np.intp), path)  # fmt: skip
        run = replay(Samples.of(plan))
        bodies, rotation, position, pairs = bodies_of(run)
        allowed = allowed_depths(run, bodies)
        quick = {one.pair: one.depth for one in deepest(bodies, rotation, position, pairs, allowed)}
        slow: dict[tuple[int, int], float] = {}
        for one, other in map(tuple, pairs.tolist()):
            for sample in range(0, run.samples.count):
                depth = penetration(bodies[one].shape, rotation[one, sample], position[one, sample],
                                    bodies[other].shape, rotation[other, sample], position[other, sample])  # fmt: skip
                most = allowed.get((one, other))
                if depth > (0.0 if most is None else most[sample]):
                    slow[one, other] = max(slow.get((one, other), 0.0), depth)
        assert len(slow) > 3
        assert quick == pytest.approx(slow)


def test_every_pair_that_can_meet_is_looked_at(tmp_path: Path) -> None:
    values = with_person(tmp_path)
    run = replay(Samples.of(person_plan(values, through(START, TAKE, each=(10,)), START)))
    bodies, _, _, pairs = bodies_of(run)
    looked = {frozenset((bodies[one].name, bodies[other].name)) for one, other in pairs.tolist()}
    for one, other in combinations(bodies, 2):
        fixed = one.kind == other.kind == "table"
        if one.owner != other.owner and not fixed:
            assert frozenset((one.name, other.name)) in looked
    own = {tuple(sorted(pair)) for pair in looked if all(name.startswith("human.") for name in pair)}
    assert ("human.abdomen", "human.right_forearm") in own
    assert ("human.left_palm", "human.right_upper_arm") in own
    assert ("human.head", "human.trunk") not in own
    assert frozenset(("gantry.f1", "gantry.f2")) not in looked


def test_a_mesh_with_a_corner_of_many_neighbours_has_a_hull() -> None:
    around = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    rim = np.stack([0.1 * np.cos(around), 0.1 * np.sin(around), np.zeros(400)], axis=1)
    cone = np.concatenate([rim, [[0.0, 0.0, 0.2], [0.0, 0.0, 0.0]]])
    after = (np.arange(400) + 1) % 400
    faces = [(one, other, 400) for one, other in enumerate(after)] + [(o, n, 401) for n, o in enumerate(after)]
    shape, middle = mesh(cone, np.array(faces))
    below = np.array([0.0, 0.0, -0.03])
    depth = penetration(shape, np.eye(3), middle, ball(0.05), np.eye(3), below)
    assert depth == pytest.approx(0.02, abs=1e-3)


def test_a_hand_that_acts_on_nothing_is_a_hand_too(tmp_path: Path) -> None:
    """The left hand of a person whose right hand alone acts: its grip point keeps away from a gripper as well."""
    values = with_person(tmp_path)
    assert values["human"].get("hands", ["right_hand"]) == ["right_hand"]
    plan = person_plan(values, through(START, TAKE, each=(10,)), START)
    assert "human.left_hand" in Samples.of(plan).hands
    shapes = collision_shapes(World(plan.scene))
    assert {"grip point of human.left_hand", "grip point of human.right_hand"} <= {shape.name for shape in shapes}
