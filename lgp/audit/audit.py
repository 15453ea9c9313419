"""The audit of a plan."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np

from lgp.audit.agents import AgentModel
from lgp.audit.contacts import allowed_depths
from lgp.audit.faults import HANDS_ROUNDING, TOUCHING, Audit, Depth, Extreme, Fault
from lgp.audit.jaws import carriers, jaw_values, too_wide
from lgp.audit.joint_tree import BASE, turned
from lgp.audit.joints import beyond_limits, fastest, feet_leave
from lgp.audit.neighbours import neighbours
from lgp.audit.penetration import deepest
from lgp.audit.replay import Replay, replay
from lgp.audit.samples import Samples
from lgp.audit.shapes import OBJECT, OBSTACLE, PERSON, ROBOT, TABLE, Body, Shape, box, cylinder, mesh_of
from lgp.audit.withdrawals import in_the_way
from lgp.errors import LgpError
from lgp.kinematics.mesh_file import read_mesh
from lgp.plan_record import Plan
from lgp.scene.model import Obstacle, Scene, Table
from lgp.scene.surroundings import fixed_bodies
from reba.arrays import Array, Indices
from reba.checks import Allowed, accepts

PLAN = Allowed("a plan, as `lgp.plan` returns it", lambda value: isinstance(value, Plan))


@accepts(LgpError, plan=PLAN)
def audit_plan(plan: Plan) -> Audit:
    """Return what an independent look at a plan finds.

    The actions are replayed, the motion is sampled ten times a slice with the interpolation that the plan states, and
    all bodies are measured against each other: capsules of the person, legs included, the <collision> geometry of
    robots, jaws as far open as they are, tables and objects. Nothing of the planner's collision checks is used.

    Raises:
        LgpError: the plan is no whole one: its phases do not fit its actions, or it names what its scene does not have.

    Example:
        >>> import lgp
        >>> scene = lgp.load_scene("screwdriver", {"goal": ["placed(screwdriver, table.start)"]})
        >>> lgp.audit_plan(lgp.plan(scene, cost=None)).samples  # the goal holds already: the start alone
        1
    """
    samples = Samples.of(plan)
    run = replay(samples)
    contacts = tuple(_contacts(run))
    hands, near = _nearest_hands(run)
    speed, fast = fastest(samples)
    deepest_first = sorted(contacts, key=lambda one: -one.depth)
    faults = [
        Fault("contact", f"{one.pair[0]} is {1000 * one.depth:.1f} mm in {one.pair[1]}", one.depth, one.time)
        for one in deepest_first
        if one.depth > TOUCHING
    ]
    faults += [*run.faults, *near, *in_the_way(run), *fast, *beyond_limits(samples), *feet_leave(samples)]
    notes = [note for model in samples.models for note in (*model.notes, *too_wide(run, model))]
    return Audit(samples.count, tuple(deepest_first), hands, speed, tuple(faults), (*notes, *run.unaudited))


def _contacts(run: Replay) -> Iterator[Depth]:
    """Yield pairs of bodies that are in each other at some time, each at its deepest; parts of one link are one."""
    bodies, rotation, position, pairs = bodies_of(run)
    of_pair: dict[frozenset[str], Depth] = {}
    for one in deepest(bodies, rotation, position, pairs, allowed_depths(run, bodies)):
        time = float(run.samples.times[one.sample])
        depth = Depth(*_classified(*(bodies[number] for number in one.pair)), one.depth, time)
        key = frozenset(depth.pair)
        if key not in of_pair or of_pair[key].depth < depth.depth:
            of_pair[key] = depth
    yield from of_pair.values()


ORDER = (PERSON, ROBOT, OBJECT, TABLE, OBSTACLE)
"""Kinds of bodies in the names of the classes of pairs."""


def _classified(one: Body, other: Body) -> tuple[str, tuple[str, str]]:
    """Return the class of a pair, `person/table` or `robot with itself`, and the names in its order."""
    first, second = sorted((one, other), key=lambda body: ORDER.index(body.kind))
    pair_class = f"{one.kind} with itself" if one.owner == other.owner else f"{first.kind}/{second.kind}"
    return pair_class, (first.name, second.name)


def bodies_of(run: Replay) -> tuple[list[Body], Array, Array, Indices]:
    """Return all m bodies, their poses (m, T, 3, 3), (m, T, 3) [m], and the pairs (k, 2) that can meet."""
    samples, scene = run.samples, run.scene
    bodies: list[Body] = []
    rotations, positions = [], []
    joined: set[tuple[int, int]] = set()
    for model in samples.models:
        jaws = jaw_values(run, model)
        own, rotation, position = samples.bodies(model, jaws)
        own = _with_hands(model, own, set(samples.moved))
        first = len(bodies)
        joined |= {(first + one, first + other) for one, other in neighbours(model, own, set(jaws))}
        bodies += own
        rotations.append(rotation)
        positions.append(position)
    for body, rotation, position in (*_tables(samples), *_obstacles(scene), *_objects(run)):
        bodies.append(body)
        rotations.append(np.broadcast_to(rotation, (1, samples.count, 3, 3)))
        positions.append(np.broadcast_to(position, (1, samples.count, 3)))
    pairs = [
        pair
        for pair in combinations(range(len(bodies)), 2)
        if pair not in joined and not _never_meet(*(bodies[number] for number in pair))
    ]
    return bodies, np.concatenate(rotations), np.concatenate(positions), np.array(pairs, np.intp).reshape(-1, 2)


def _never_meet(one: Body, other: Body) -> bool:
    """Return whether two bodies never move, or one is a table that the other carries."""
    carried = TABLE in (one.kind, other.kind) and (one.owner, one.joint) == (other.owner, other.joint)
    return carried or all(body.joint == BASE and body.kind in (TABLE, OBSTACLE, ROBOT) for body in (one, other))


def _tables(samples: Samples) -> Iterator[tuple[Body, Array, Array]]:
    for name, table in samples.plan.scene.tables.items():
        top = samples.tops.get(name)
        turn, position = _standing(table) if top is None else (top.rotation, top.position)
        below = position - table.thickness / 2.0 * turn[..., 2]
        owner, joint = (name, BASE) if top is None else (top.robot, top.joint)
        yield Body(name, TABLE, owner, joint, box((*table.size, table.thickness))), turn, below


def _standing(table: Table) -> tuple[Array, Array]:
    angle = np.radians(table.yaw)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    return turn, np.array([*table.position, table.height])


def _obstacles(scene: Scene) -> Iterator[tuple[Body, Array, Array]]:
    for name, item in fixed_bodies(scene).items():
        turn = turned(item.rotation)
        shape, middle = _obstacle_shape(item)
        yield Body(name, OBSTACLE, name, BASE, shape), turn, np.array(item.position) + turn @ middle


def _obstacle_shape(item: Obstacle) -> tuple[Shape, Array]:
    """Return the shape of an obstacle and where its middle is (3,) [m]."""
    if item.shape == "box":
        return box(item.size), np.zeros(3)
    if item.shape == "cylinder":
        return cylinder(item.size[0] / 2.0, item.size[2]), np.zeros(3)
    return mesh_of(read_mesh(Path(item.file)), np.array(item.size))


def _objects(run: Replay) -> Iterator[tuple[Body, Array, Array]]:
    for name, item in run.scene.objects.items():
        yield Body(name, OBJECT, name, BASE, box(item.size)), *run.poses[name]


def _with_hands(model: AgentModel, bodies: Sequence[Body], moved: set[str]) -> list[Body]:
    """Return the bodies of a robot with the hands that they belong to: what the last joint before a hand carries."""
    if not bodies or bodies[0].kind == PERSON:
        return list(bodies)
    carrying = carriers(model, moved)
    return [
        Body(body.name, body.kind, body.owner, body.joint, body.shape,
             frozenset(hand for hand, joint in carrying.items() if joint != BASE and joint in model.chain(body.joint)))
        for body in bodies
    ]  # fmt: skip


def _nearest_hands(run: Replay) -> tuple[Extreme, list[Fault]]:
    """Return the least distance of the grip points of two hands, and a fault for each pair that comes too near."""
    least, faults = Extreme(), []
    for one, other in combinations(run.samples.hands, 2):
        distance = np.linalg.norm(run.samples.hands[one][1] - run.samples.hands[other][1], axis=1)
        at = int(distance.argmin())
        value, time = float(distance[at]), float(run.samples.times[at])
        if least.value is None or value < least.value:
            least = Extreme(value, (one, other), time)
        if value < run.scene.hand_clearance - HANDS_ROUNDING:
            expected = f"expected {1000 * run.scene.hand_clearance:.3g} mm or more"
            what = f"the grip points of {one} and {other} are {1000 * value:.1f} mm from each other, {expected}"
            faults.append(Fault("hands", what, value, time))
    return least, faults
