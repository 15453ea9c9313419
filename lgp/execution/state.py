"""The tracked world as a scene: what a motion or a whole plan can begin from."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lgp.errors import LgpError
from lgp.execution.observation import Sighting, View
from lgp.execution.recognise import grasped, recognise
from lgp.logic import Task
from lgp.logic.atom import Atom
from lgp.world.holders import UPRIGHT
from lgp.world.rotations import logarithm
from lgp.world.scene import Scene, Table
from lgp.world.scene_file import read_scene

Array = NDArray[np.float64]


class OutOfPlace(LgpError):
    """An object is where no motion can begin: lost from tracking, or neither in a hand nor on a table."""


def scene_now(scene: Scene, view: View, kept: Iterable[str] = (), atoms: Iterable[Atom] | None = None) -> Scene:
    """Return a scene with its objects where they are seen.

    Args:
        scene: who and what is there.
        view: the tracked world.
        kept: objects that hands only keep where they stand, see `kept_still`.
        atoms: what holds, see `atoms_now`; the scene's own by default.

    Raises:
        OutOfPlace: an object is lost, or neither in a hand nor on a table.
    """
    values: dict[str, Any] = copy.deepcopy(dict(scene.values))
    for name in scene.things:
        hand = "" if name in kept else carrier(view, name)
        values["objects"][name] = _placed(scene, view, name, hand, values["objects"][name])
    if atoms is not None:
        values["initial"] = [str(atom) for atom in atoms]
    return read_scene(values, scene.name)


def atoms_now(view: View, task: Task, state: int) -> tuple[Atom, ...]:
    """Return the atoms that hold: seen where they have geometry, else as the plan has them.

    `placed` is kept as it is where an object lies on no table: it says where it was put last.
    """
    believed = set(task.holding(state))
    found = []
    for atom in task.atoms:
        verdict = recognise(view, atom)
        lasting = atom.predicate in ("placed", "screwed")
        if verdict is None or verdict.holds is None or (lasting and not verdict.holds):
            holds = atom in believed
        else:
            holds = verdict.holds
        if holds:
            found.append(atom)
    return tuple(found)


def carrier(view: View, thing: str) -> str:
    """Return the hand that has an object, "" if none."""
    lies = view.seen(thing) is not None and view.table_under(thing)
    for hand in view.world.scene.hands:
        if grasped(view, hand, thing).holds and not (lies and hand not in view.now.closed):
            return hand
    return ""


def kept_still(task: Task, state: int) -> frozenset[str]:
    """Return the objects that a hand only keeps where they stand."""
    return frozenset(atom.arguments[-1] for atom in task.holding(state) if atom.predicate in ("held", "holding"))


def in_hand(hand: Sighting, at: Sighting) -> tuple[Array, Array]:
    """Return rotation (3, 3) and position (3,) of an object in the frame of a hand."""
    return hand.rotation.T @ at.rotation, hand.rotation.T @ (at.position - hand.position)


def on_table(table: Table, at: Sighting) -> tuple[float, float, float, str]:
    """Return x, y [m], yaw [deg] on the top of a table and the axis that points upwards of an object on it."""
    up = max(UPRIGHT, key=lambda axis: float(at.rotation[2, "xyz".index(axis)]))
    yaw = np.radians(table.yaw)
    top = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    x, y = top.T @ (at.position[:2] - np.array(table.position))
    turned = top.T @ (at.rotation @ UPRIGHT[up].T)[:2, 0]
    return float(x), float(y), float(np.degrees(np.arctan2(turned[1], turned[0]))), up


def _placed(scene: Scene, view: View, name: str, hand: str, values: dict[str, Any]) -> dict[str, Any]:
    """Return the values of an object where it is seen."""
    at = view.mean(name)
    if at is None:
        raise OutOfPlace(f"{name} is lost from tracking; bring it back into sight")
    kept = {key: value for key, value in values.items() if key not in ("at", "hand", "in_hand", "up")}
    if hand:
        rotation, position = in_hand(view.hand(hand), view.now.things[name])
        vector = np.degrees(logarithm(rotation[None])[0])
        return kept | {"hand": hand, "in_hand": [*position.tolist(), *vector.tolist()]}
    table = view.table_under(name)
    if not table:
        raise OutOfPlace(f"{name} is neither in a hand nor on a table; put it back on a table")
    if not view.rests(name):
        raise OutOfPlace(f"{name} moves; let it come to rest")
    x, y, yaw, up = on_table(scene.tables[table], at)
    half = np.array(scene.tables[table].size) / 2.0
    spot = np.clip([x, y], -half, half).tolist()
    return kept | {"on": table, "at": [*spot, yaw], "up": up}
