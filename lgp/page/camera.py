"""Where the eye is, so that all of a scene is in the picture; the page does the same for the size of its window."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lgp.motion import Motion
from lgp.scene.model import Human, Scene, SceneObject
from reba.arrays import Array

ANGLE = 30.0
"""[deg] Height of what the camera sees."""
ROOM = 1.08
"""How much wider the picture is than what must be in it."""
NEAREST = 0.3
"""[m] From the eye to what it sees, at least."""


class Camera(NamedTuple):
    """An eye (3,) that looks at a target (3,), up along z."""

    eye: Array
    target: Array


def framed(points: Array, towards: Array, aspect: float, angle: float = ANGLE) -> Camera:
    """Return the nearest camera that sees all points.

    Args:
        points: (n, 3) [m].
        towards: (3,) unit vector from the scene to the eye, not straight up.
        aspect: width by height of the picture.
        angle: height of the picture [deg].

    >>> camera = framed(np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]), np.array([1.0, 0.0, 0.0]), 1.0, 90.0)
    >>> camera.eye.round(2).tolist()
    [1.08, 0.0, 0.0]
    """
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    up = np.cross(towards, right)
    across, above, near = points @ right, points @ up, points @ towards
    tall = np.tan(np.radians(angle) / 2.0)
    # Planes through the eye bound the picture: of all points, the outermost of each side decides.
    needed = max(
        float(((offset + slope * near).max() - (offset - slope * near).min()) / (2.0 * slope))
        for offset, slope in ((across, tall * aspect), (above, tall))
    )
    centre = float(near.mean())
    eye = max(centre + ROOM * (needed - centre), float(near.max()) + NEAREST)
    target = _middle(across, eye - near) * right + _middle(above, eye - near) * up + centre * towards
    return Camera(target + (eye - centre) * towards, target)


def _middle(offset: Array, depth: Array) -> float:
    """Return where the eye must be for points at (n,) offsets and depths [m] to be in the middle of the picture."""
    middle = float(offset.max() + offset.min()) / 2.0
    for _ in range(8):
        seen = (offset - middle) / depth
        high, low = int(seen.argmax()), int(seen.argmin())
        # The eye from which the outermost two are seen equally far aside.
        middle = float((offset[high] * depth[low] + offset[low] * depth[high]) / (depth[low] + depth[high]))
    return middle


AROUND = np.radians([-150, -130, -110, -90, -70, -50, -30, 30, 50, 70, 90, 110, 130, 150])
"""Directions of the eye that are tried, from the line human - robot, counter-clockwise seen from above."""
ABOVE = np.radians([16, 28, 42])
"""Elevations of the eye that are tried."""
BEST = np.radians([75, 22])
"""What is tried first: from the side, a little in front of the human, and a little from above."""
CLEAR = 0.06
"""[m] What is nearer than this to the line of sight may hide what lies behind."""
NEAR = 0.15
"""[m] What is nearer than this to what is looked at belongs to it."""
HIDDEN, ODD, TURN = 3.0, 0.6, 0.5
"""Prices of a hidden spot, of each radian away from `BEST`, and of each radian away from the former shot."""


@dataclass(frozen=True, eq=False)
class Shot:
    """What is in the picture, (n, 3) points [m], and the unit vector (3,) from there to the eye."""

    points: Array
    towards: Array


@dataclass(frozen=True, eq=False)
class Subject:
    """What a shot is of.

    Attributes:
        points: (n, 3) that must be in the picture.
        spots: (m, 3) that should not be hidden.
        solid: (k, 3) points all over what may hide them.
    """

    points: Array
    spots: Array
    solid: Array


def shots(subjects: Sequence[Subject], ahead: float) -> tuple[Shot, ...]:
    """Return a shot of each subject; a later one keeps its direction as long as that shows enough.

    Args:
        subjects: in the order in which they are seen.
        ahead: direction of the line human - robot [rad].
    """
    found: list[Shot] = []
    for subject in subjects:
        former = found[-1].towards if found else None
        prices = [
            (_price(subject, _unit(ahead + around, above), around, above, former), around, above)
            for around in AROUND.tolist()
            for above in ABOVE.tolist()
        ]
        _, around, above = min(prices)
        found.append(Shot(subject.points, _unit(ahead + around, above)))
    return tuple(found)


def _price(subject: Subject, towards: Array, around: float, above: float, former: Array | None) -> float:
    odd = abs(abs(around) - BEST[0]) + 2.0 * abs(above - BEST[1])
    turned = 0.0 if former is None else float(np.arccos(np.clip(former @ towards, -1.0, 1.0)))
    return HIDDEN * hidden(subject.spots, subject.solid, towards) + ODD * odd + TURN * turned


def hidden(spots: Array, solid: Array, towards: Array) -> float:
    """Return the share of (m, 3) spots that (k, 3) points hide from an eye far away in a direction (3,).

    >>> hidden(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.01]]), np.array([1.0, 0.0, 0.0]))
    1.0
    """
    if not len(spots):
        return 0.0
    covered = 0
    for spot in spots:
        away = solid - spot
        depth = away @ towards
        aside = np.linalg.norm(away - depth[:, None] * towards, axis=1)
        covered += bool(((depth > NEAR) & (aside < CLEAR)).any())
    return covered / len(spots)


def _unit(around: float, above: float) -> Array:
    return np.array([np.cos(around) * np.cos(above), np.sin(around) * np.cos(above), np.sin(above)])


PERSON_MARGIN = 0.1
"""[m] Of an object, a head or feet, this much around the middle is in the picture."""
MOVES = 0.02
"""[m] A frame that moves less than this in an action does not take part."""


def shots_of(
    motion: Motion, frames: Mapping[str, int], place: Array, solid: Sequence[Array], steps: int
) -> tuple[Shot, ...]:
    """Return the shots of the start and of each action.

    Args:
        motion: of the plan.
        frames: name of a frame -> its number.
        place: (T, F, 4, 4) of the frames [m].
        solid: for the start and the end of each action, (k, 3) points all over the bodies [m].
        steps: every so many moments are looked at.
    """
    scene, length = motion.plan.scene, motion.phases.slices
    whole = np.concatenate([place[::steps, :, :3, 3].reshape(-1, 3), solid[0]])
    found = [Subject(whole, np.zeros((0, 3)), solid[0])]
    for number, switch in enumerate(motion.phases.switches):
        part = place[number * length : (number + 1) * length + 1]
        moving = np.ptp(part[:, :, :3, 3], axis=0).max(axis=1) > MOVES
        taking = [at for name, at in frames.items() if moving[at] or name.startswith("human.")]
        names = [name for name in (switch.object_name, switch.other) if name]
        points = [part[::steps, at, :3, 3] for at in taking]
        points += [_corners(part[::steps, frames[name], :3, 3], PERSON_MARGIN) for name in names]
        spots = [_spots(scene.objects[name], part[-1, frames[name]]) for name in names]
        if switch.table:
            points.append(_tops(scene, switch.table))
        found.append(Subject(np.concatenate([*points, _people(scene)]), np.concatenate(spots), solid[number + 1]))
    return shots(found, ahead(scene))


def ahead(scene: Scene) -> float:
    """Return the direction from the human to the robots [rad], the way the human faces without robots."""
    person = scene.human
    if person is None:
        return 0.0
    robots = [robot.position[:2] for robot in scene.robots.values()]
    away = np.mean(robots, axis=0) - person.position[:2] if robots else np.zeros(2)
    return float(np.radians(person.yaw) if np.linalg.norm(away) < 1e-6 else np.arctan2(away[1], away[0]))


def _people(scene: Scene) -> Array:
    """Return points around feet and heads (n, 3)."""
    people = [agent for agent in scene.agents if isinstance(agent, Human)]
    ends = [[*one.position[:2], one.position[2] + up] for one in people for up in (0.0, one.stature - PERSON_MARGIN)]
    return _corners(np.array(ends).reshape(-1, 3), PERSON_MARGIN)


def _corners(points: Array, half: float) -> Array:
    """Return the corners (8 n, 3) of cubes around (n, 3) points."""
    signs = np.array([[x, y, z] for x in (-half, half) for y in (-half, half) for z in (-half, half)])
    return np.asarray((points[:, None] + signs).reshape(-1, 3))


def _tops(scene: Scene, name: str) -> Array:
    """Return the corners of a table top (4, 3)."""
    table = scene.tables[name]
    half = max(table.size) / 2.0
    x, y = table.position
    return np.array([[x + a, y + b, table.height] for a in (-half, half) for b in (-half, half)])


def _spots(thing: SceneObject, place: Array) -> Array:
    """Return the middle and two points near the ends of an object (3, 3)."""
    along = np.zeros((3, 3))
    along[1:, int(np.argmax(thing.size))] = 0.4 * max(thing.size) * np.array([1.0, -1.0])
    return np.asarray(along @ place[:3, :3].T + place[:3, 3])
