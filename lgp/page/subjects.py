"""What is looked at in each action: the person, the limbs that move, and the object where it is taken or put."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from lgp.motion import Motion
from lgp.page.shots import Shot, Subject, shots
from lgp.world.scene import Human, Scene, Thing

Array = NDArray[np.float64]

AROUND = 0.1
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
        names = [name for name in (switch.thing, switch.other) if name]
        points = [part[::steps, at, :3, 3] for at in taking]
        points += [_corners(part[::steps, frames[name], :3, 3], AROUND) for name in names]
        spots = [_spots(scene.things[name], part[-1, frames[name]]) for name in names]
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
    ends = [[*one.position[:2], one.position[2] + up] for one in people for up in (0.0, one.stature - AROUND)]
    return _corners(np.array(ends).reshape(-1, 3), AROUND)


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


def _spots(thing: Thing, place: Array) -> Array:
    """Return the middle and two points near the ends of an object (3, 3)."""
    along = np.zeros((3, 3))
    along[1:, int(np.argmax(thing.size))] = 0.4 * max(thing.size) * np.array([1.0, -1.0])
    return np.asarray(along @ place[:3, :3].T + place[:3, 3])
