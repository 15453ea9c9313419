"""The tracked world as a scene, from which a motion or a plan can start."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from collections.abc import Set as AbstractSet
from typing import Any

import numpy as np

from lgp.errors import LgpError
from lgp.execution.predicates import TOGETHER, evaluate_predicate, grasped
from lgp.execution.tracking import TrackedPose, TrackedWorld
from lgp.kinematics.attachments import UPRIGHT, resting
from lgp.kinematics.features import exponential, logarithm
from lgp.logic.task import Atom, Task
from lgp.scene.model import Scene, Table
from lgp.scene.scene_file import read_scene
from reba.arrays import Array

PERSISTENT = ("placed", "screwed")
"""Predicates that stay true once the plan has made them true."""


class ObjectUnavailable(LgpError):
    """No motion can start with an object: it is lost from tracking, moves, or is neither in a hand nor on a table."""


def scene_now(scene: Scene, view: TrackedWorld, nominal: AbstractSet[Atom], atoms: Iterable[Atom]) -> Scene:
    """Return a scene with its objects at their tracked poses and the initial atoms `atoms`, see `atoms_now`.

    `nominal` are the atoms that hold by the plan.

    Raises:
        ObjectUnavailable: an object is lost, moves, or is neither in a hand nor on a table.
    """
    values: dict[str, Any] = copy.deepcopy(dict(scene.values))
    for name in scene.objects:
        values["objects"][name] = _placed(scene, view, name, carrier(view, name, nominal), values["objects"][name])
    values["initial"] = [str(atom) for atom in atoms]
    return _joined(read_scene(values, scene.name), values)


def atoms_now(view: TrackedWorld, task: Task, nominal: AbstractSet[Atom]) -> tuple[Atom, ...]:
    """Return the atoms that hold: by geometry where they have any, else by the plan (`nominal`).

    Atoms of `PERSISTENT` predicates that hold by the plan are kept whatever is seen.
    """
    carriers = {name: carrier(view, name, nominal) for name in view.world.scene.objects}
    atoms = []
    for atom in task.atoms:
        state = evaluate_predicate(view, atom, nominal)
        if state.holds is None or (atom.predicate in PERSISTENT and not state.holds):
            holds = atom in nominal
        elif atom.predicate == "grasped":
            hand, object_name = atom.arguments
            holds = carriers[object_name] == hand
        elif atom.predicate in ("on_table", "placed"):
            holds = state.holds and not carriers[atom.arguments[0]]
        elif atom.predicate == "free":
            holds = state.holds and atom.arguments[0] not in carriers.values()
        else:
            holds = state.holds
        if holds:
            atoms.append(atom)
    return tuple(atoms)


def carrier(view: TrackedWorld, object_name: str, nominal: AbstractSet[Atom]) -> str:
    """Return the hand that carries an object, "" if none; of several at the object, the one that does by the plan.

    A hand at an object that stands on a table carries it if it does so by the plan, or if its gripper is closed and by
    the plan no hand holds the object in place. A hand that has another object by the plan carries no second one.
    """
    on_any_table = view.seen(object_name) is not None and view.table_under(object_name)
    held = any(atom.predicate in ("held", "holding") and atom.arguments[-1] == object_name for atom in nominal)
    has = {atom.arguments[0]: atom.arguments[1] for atom in nominal if atom.predicate == "grasped"}
    for hand in sorted(view.world.scene.hands, key=lambda one: has.get(one) != object_name):
        likely = not on_any_table or (hand in view.now.closed and not held)
        if (
            has.get(hand, object_name if likely else "") == object_name
            and grasped(view, hand, object_name, nominal).holds
        ):
            return hand
    return ""


def in_hand(hand: TrackedPose, at: TrackedPose) -> tuple[Array, Array]:
    """Return rotation (3, 3) and position (3,) of an object in the frame of a hand."""
    return hand.rotation.T @ at.rotation, hand.rotation.T @ (at.position - hand.position)


def levelled(at: TrackedPose, inclined: float) -> TrackedPose:
    """Return a pose with one of its axes exactly vertical, if that is within `inclined` [rad] of it."""
    nearest = int(np.argmax(np.abs(at.rotation[2])))
    axis = np.cross(at.rotation[:, nearest], [0.0, 0.0, np.sign(at.rotation[2, nearest])])
    sine = float(np.linalg.norm(axis))
    if not 0.0 < sine <= np.sin(inclined):
        return at
    return TrackedPose(exponential(axis / sine * np.arcsin(sine)) @ at.rotation, at.position, at.time)


def on_table(table: Table, at: TrackedPose) -> tuple[float, float, float, str]:
    """Return x, y [m], yaw [deg] on the top of a table and the axis that points upwards of an object on it."""
    up = max(UPRIGHT, key=lambda axis: float(at.rotation[2, "xyz".index(axis)]))
    yaw = np.radians(table.yaw)
    top = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    x, y = top.T @ (at.position[:2] - np.array(table.position))
    turned = top.T @ (at.rotation @ UPRIGHT[up].T)[:2, 0]
    return float(x), float(y), float(np.degrees(np.arctan2(turned[1], turned[0]))), up


def _joined(scene: Scene, values: dict[str, Any]) -> Scene:
    """Return a scene in which parts within `TOGETHER` of the relative position of their joint stand there exactly.

    A screw action requires the exact position, which people do not reach.
    """
    for joint in scene.assemblies:
        base, other = (scene.objects[name] for name in joint.parts)
        if base.hand or other.hand or base.on != other.on or base.up != "z" or other.up != "z":
            continue
        table = scene.tables[base.on]
        rotation, position = resting(table, base, *base.at[:2], np.radians(base.at[2]))
        goal = position + rotation @ np.array(joint.position)
        if np.linalg.norm(goal - resting(table, other, *other.at[:2], np.radians(other.at[2]))[1]) <= TOGETHER:
            yaw = np.radians(joint.yaw)
            turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
            x, y, turned, _ = on_table(table, TrackedPose(rotation @ turn, goal, 0.0))
            values["objects"][other.name]["at"] = [x, y, turned]
    return read_scene(values, scene.name)


def _placed(scene: Scene, view: TrackedWorld, name: str, hand: str, values: dict[str, Any]) -> dict[str, Any]:
    """Return the scene values of an object at its tracked pose, in a hand or (`hand` "") on a table."""
    at = view.mean(name)
    if at is None:
        raise ObjectUnavailable(f"{name} is lost from tracking; bring it into view of the tracker")
    kept = {key: value for key, value in values.items() if key not in ("at", "hand", "in_hand", "up")}
    if hand:
        rotation, position = in_hand(view.hand(hand), levelled(view.now.objects[name], view.tolerances.inclined))
        vector = np.degrees(logarithm(rotation[None])[0])
        return kept | {"hand": hand, "in_hand": [*position.tolist(), *vector.tolist()]}
    table = view.table_under(name)
    if not table:
        raise ObjectUnavailable(f"{name} is neither in a hand nor on a table; put it back on a table")
    if not view.rests(name):
        raise ObjectUnavailable(f"{name} moves; let it come to rest")
    x, y, yaw, up = on_table(view.table(table), at)
    half = np.array(scene.tables[table].size) / 2.0
    spot = np.clip([x, y], -half, half).tolist()
    return kept | {"on": table, "at": [*spot, yaw], "up": up}
