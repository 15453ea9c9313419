"""Camera poses with all of a subject in the picture; the page repeats `framed` for the size of its window."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lgp.motion import Motion
from lgp.scene.model import Human, Scene, SceneObject, Table
from reba.arrays import Array

ANGLE = 30.0
"""[deg] Vertical field of view."""
ROOM = 1.08
"""Factor of the distance to the subject, for a margin around it."""
NEAREST = 0.3
"""[m] Smallest distance from the eye to the subject."""


class Camera(NamedTuple):
    """An eye (3,) that looks at a target (3,), up along z."""

    eye: Array
    target: Array


def framed(points: Array, towards: Array, aspect: float) -> Camera:
    """Return the nearest camera with all points in its field of view.

    Args:
        points: (n, 3) [m].
        towards: (3,) unit vector from the scene to the eye, not straight up.
        aspect: width by height of the picture.

    >>> camera = framed(np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]), np.array([1.0, 0.0, 0.0]), 1.0)
    >>> camera.eye.round(2).tolist()
    [4.03, 0.0, 0.0]
    """
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    up = np.cross(towards, right)
    across, above, near = points @ right, points @ up, points @ towards
    tall = np.tan(np.radians(ANGLE) / 2.0)
    # Each side of the picture is a plane through the eye, which the outermost point of that side determines.
    needed = max(
        float(((offset + slope * near).max() - (offset - slope * near).min()) / (2.0 * slope))
        for offset, slope in ((across, tall * aspect), (above, tall))
    )
    centre = float(near.mean())
    eye = max(centre + ROOM * (needed - centre), float(near.max()) + NEAREST)
    target = _middle(across, eye - near) * right + _middle(above, eye - near) * up + centre * towards
    return Camera(target + (eye - centre) * towards, target)


def _middle(offset: Array, depth: Array) -> float:
    """Return the offset of the eye [m] that centres points at (n,) offsets and depths [m] in the picture."""
    middle = float(offset.max() + offset.min()) / 2.0
    for _ in range(8):
        seen = (offset - middle) / depth
        high, low = int(seen.argmax()), int(seen.argmin())
        # The outermost two points are then at equal angles from the axis.
        middle = float((offset[high] * depth[low] + offset[low] * depth[high]) / (depth[low] + depth[high]))
    return middle


AROUND = np.radians([-150, -130, -110, -90, -70, -50, -30, 30, 50, 70, 90, 110, 130, 150])
"""[rad] Candidate directions of the eye from the line human - robot, counter-clockwise seen from above."""
ABOVE = np.radians([16, 28, 42])
"""[rad] Candidate elevations of the eye."""
PREFERRED = np.radians([75, 22])
"""[rad] Preferred direction and elevation: from the side, a little in front of the human and above."""
CLEARANCE = 0.06
"""[m] A solid point nearer than this to the line of sight occludes a keypoint."""
OWN_RADIUS = 0.15
"""[m] Solid points nearer than this in front of a keypoint belong to its object."""
OCCLUSION_WEIGHT, DIRECTION_WEIGHT, TURN_WEIGHT = 3.0, 0.6, 0.5
"""Costs of all keypoints occluded, of a radian away from `PREFERRED`, and of a radian away from the former shot."""


@dataclass(frozen=True, eq=False)
class Shot:
    """Points (n, 3) that are in the picture [m], and the unit vector (3,) from there to the eye."""

    points: Array
    towards: Array


@dataclass(frozen=True, eq=False)
class Subject:
    """The subject of a shot.

    Attributes:
        points: (n, 3) that must be in the picture [m].
        keypoints: (m, 3) that should not be occluded [m].
        solid: (k, 3) surface points of all bodies [m].
    """

    points: Array
    keypoints: Array
    solid: Array


def shots(subjects: Sequence[Subject], ahead: float) -> tuple[Shot, ...]:
    """Return the shot of least cost of each subject; `ahead` [rad] is the direction from the first person to others.

    A change of direction has a cost too, so that the view is steady.
    """
    chosen: list[Shot] = []
    for subject in subjects:
        former = chosen[-1].towards if chosen else None
        costs = [
            (_cost(subject, _unit(ahead + around, above), around, above, former), around, above)
            for around in AROUND.tolist()
            for above in ABOVE.tolist()
        ]
        _, around, above = min(costs)
        chosen.append(Shot(subject.points, _unit(ahead + around, above)))
    return tuple(chosen)


def _cost(subject: Subject, towards: Array, around: float, above: float, former: Array | None) -> float:
    off = abs(abs(around) - PREFERRED[0]) + 2.0 * abs(above - PREFERRED[1])
    turned = 0.0 if former is None else float(np.arccos(np.clip(former @ towards, -1.0, 1.0)))
    occluded = occluded_share(subject.keypoints, subject.solid, towards)
    return OCCLUSION_WEIGHT * occluded + DIRECTION_WEIGHT * off + TURN_WEIGHT * turned


def occluded_share(keypoints: Array, solid: Array, towards: Array) -> float:
    """Return the share of (m, 3) keypoints that (k, 3) solid points occlude from a distant eye in a direction (3,).

    >>> occluded_share(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.01]]), np.array([1.0, 0.0, 0.0]))
    1.0
    """
    if not len(keypoints):
        return 0.0
    covered = 0
    for keypoint in keypoints:
        away = solid - keypoint
        depth = away @ towards
        aside = np.linalg.norm(away - depth[:, None] * towards, axis=1)
        covered += bool(((depth > OWN_RADIUS) & (aside < CLEARANCE)).any())
    return covered / len(keypoints)


def _unit(around: float, above: float) -> Array:
    return np.array([np.cos(around) * np.cos(above), np.sin(around) * np.cos(above), np.sin(above)])


PERSON_MARGIN = 0.1
"""[m] Margin around objects, heads and feet in the picture."""
MIN_MOVEMENT = 0.02
"""[m] A frame that moves less than this in an action does not take part in it."""


def shots_of(
    motion: Motion, frames: Mapping[str, int], place: Array, solid: Sequence[Array], steps: int
) -> tuple[Shot, ...]:
    """Return the shots of the start and of each phase.

    Args:
        frames: name of a frame -> its number.
        place: (T, F, 4, 4) poses of the frames [m].
        solid: (k, 3) surface points of all bodies [m], at the start and at the end of each phase.
        steps: stride of the moments that must be in the picture.
    """
    scene, length = motion.plan.scene, motion.phases.slices
    whole = np.concatenate([place[::steps, :, :3, 3].reshape(-1, 3), solid[0]])
    subjects = [Subject(whole, np.zeros((0, 3)), solid[0])]
    for number, first in enumerate(motion.phases.switched):
        switches = motion.phases.switches[first : first + np.count_nonzero(motion.phases.phase_of == number)]
        part = place[number * length : (number + 1) * length + 1]
        moving = np.ptp(part[:, :, :3, 3], axis=0).max(axis=1) > MIN_MOVEMENT
        taking = [at for name, at in frames.items() if moving[at] or name.partition(".")[0] in scene.humans]
        names = [name for switch in switches for name in (switch.object_name, switch.other) if name]
        points = [part[::steps, at, :3, 3] for at in taking]
        points += [_corners(part[::steps, frames[name], :3, 3], PERSON_MARGIN) for name in names]
        keypoints = [_keypoints(scene.objects[name], part[-1, frames[name]]) for name in names]
        tops = [(scene.tables[switch.table], frames.get(switch.table)) for switch in switches if switch.table]
        points += [_top(table) if at is None else _top(table.top) + part[-1, at, :3, 3] for table, at in tops]
        visible = np.concatenate([*points, _people(scene)])
        subjects.append(Subject(visible, np.concatenate(keypoints), solid[number + 1]))
    return shots(subjects, ahead(scene))


def ahead(scene: Scene) -> float:
    """Return the direction from the first person to all other agents [rad]; alone that in which the person faces."""
    person = scene.human
    if person is None:
        return 0.0
    others = [agent.position[:2] for agent in scene.agents if agent is not person]
    away = np.mean(others, axis=0) - person.position[:2] if others else np.zeros(2)
    return float(np.radians(person.yaw) if np.linalg.norm(away) < 1e-6 else np.arctan2(away[1], away[0]))


def _people(scene: Scene) -> Array:
    """Return points around feet and heads (n, 3) [m]."""
    people = [agent for agent in scene.agents if isinstance(agent, Human)]
    ends = [[*one.position[:2], one.position[2] + up] for one in people for up in (0.0, one.stature - PERSON_MARGIN)]
    return _corners(np.array(ends).reshape(-1, 3), PERSON_MARGIN)


def _corners(points: Array, half: float) -> Array:
    """Return the corners (8 n, 3) of cubes around (n, 3) points."""
    signs = np.array([[x, y, z] for x in (-half, half) for y in (-half, half) for z in (-half, half)])
    return np.asarray((points[:, None] + signs).reshape(-1, 3))


def _top(table: Table) -> Array:
    """Return the corners of a square around the top of a table (4, 3)."""
    half = max(table.size) / 2.0
    x, y = table.position
    return np.array([[x + a, y + b, table.height] for a in (-half, half) for b in (-half, half)])


def _keypoints(scene_object: SceneObject, place: Array) -> Array:
    """Return the centre and two points near the ends of an object (3, 3) [m]."""
    along = np.zeros((3, 3))
    along[1:, int(np.argmax(scene_object.size))] = 0.4 * max(scene_object.size) * np.array([1.0, -1.0])
    return np.asarray(along @ place[:3, :3].T + place[:3, 3])
