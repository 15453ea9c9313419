"""Configuration [rad] -> posture table [deg] and its Jacobian, for the true score and the surrogate alike.

The definitions are those of `reba.posture.angles`, for the joints of human.urdf as the profile human_description reads
them, with a known pose of the pelvis. Most columns are single joint angles; trunk inclination, trunk twist and the
direction of the upper arms are differentiated in closed form.

The definition is discontinuous in two places: within 30 deg of the pure sideways direction
(`reba.posture.angles.CONE`) the flexion of an upper arm is its elevation, and flexion wraps by 360 deg for an arm held
straight backwards, which no shoulder reaches. `smooth=True` blends flexion and elevation over a band around the edge of
the cone and equals the definition outside it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from lgp.errors import WorldError
from lgp.kinematics.human import joint_names
from lgp.kinematics.leg_ik import knees
from lgp.kinematics.world import World
from lgp.scene.model import Human
from reba.arrays import Array, Indices
from reba.posture.angles import CONE
from reba.posture.columns import COLUMNS, INDEX, SIDES
from reba.readers.recording.profile import find_profile

Turn = tuple[int, float, str]
"""An elementary rotation: axis 0, 1 or 2, its sign, the joint."""
BAND = (np.sin(np.radians(CONE / 2)), np.sin(np.radians(CONE * 1.5)))
"""Length of the unit arm projected on the sagittal plane: limits between which elevation blends into flexion."""
STEP = 1e-6
"""[rad, m] Of the forward differences that give the second derivatives of the angles."""
PELVIS = ("pelvis_x", "pelvis_y", "pelvis_z", "pelvis_yaw", "pelvis_tilt")


@cache
def chain(name: str) -> tuple[Turn, ...]:
    """Return the elementary rotations of a chain of the profile human_description, parent first, in ISB axes."""
    return tuple((turn.axis, turn.sign, turn.name) for turn in find_profile("human_description").chains[name])


@cache
def joint_angles() -> dict[str, tuple[str, float, float]]:
    """Return column -> (joint, sign, offset [deg]) of the columns that are one joint angle, from the same profile."""
    columns = {}
    for column, terms in find_profile("human_description").columns.items():
        joint = next(term for term in terms if term.name)
        columns[column] = (joint.name, joint.sign, sum(term.sign * term.degrees for term in terms if not term.name))
    # Neck flexion is about -z, side bend about x, twist about y; the girdle is raised about -x.
    (_, flexion, z), (_, bend, x), (_, twist, y) = chain("head")
    columns |= {"neck_flexion": (z, -flexion, 0.0), "neck_side_bend": (x, bend, 0.0), "neck_twist": (y, twist, 0.0)}
    for side in SIDES:
        ((_, raised, joint_name),) = chain(f"clavicle_{side}")
        columns[f"shoulder_elevation_{side}"] = (joint_name, -raised, 0.0)
    return columns


GroupAngles = Callable[[Array, bool], tuple[Array, Array]]
"""(joints (j, n), smooth) -> angles (r, n) [deg] and slopes (r, j, n) [deg/rad]."""


@dataclass(frozen=True)
class _Group:
    """Angles that depend on some joints together.

    Attributes:
        names: of the j joints; `moving` are the places of those that are not locked, `local` their places in `columns`.
        rows: of the posture table.
    """

    names: tuple[str, ...]
    rows: Indices
    moving: Indices
    local: Indices
    angles: GroupAngles


class PostureMap:
    """The posture table of a person of a world; Jacobians are by `columns`, the k columns of q that move the person.

    Args:
        person: of the scene, by default its first one.

    Raises:
        WorldError: the world has no human.

    Example:
        >>> from lgp.scene.scene_file import load_scene
        >>> world = World(load_scene("screwdriver"))
        >>> angles, jacobian = PostureMap(world).evaluate(world.initial_configuration[None])
        >>> angles.shape, round(float(angles[0, INDEX["trunk_flexion"]]), 6) + 0.0
        ((1, 22), 0.0)
    """

    def __init__(self, world: World, person: Human | None = None) -> None:
        body = person or world.scene.human
        if body is None:
            raise WorldError("the scene has no human, so there is no posture; add a [human] table")
        self.body = body
        self.columns = world.columns(body.name)
        full = {name: f"{body.name}.{name}" for name in joint_names()}
        self._local = {
            name: int(np.searchsorted(self.columns, world.column[joint]))
            for name, joint in full.items()
            if joint in world.column
        }
        self._locked = {name: world.initial_values[joint] for name, joint in full.items()}
        self._linear, self._offset = np.zeros((len(COLUMNS), len(self.columns))), np.zeros(len(COLUMNS))
        for column, (joint, sign, offset) in joint_angles().items():
            row = INDEX[column]
            self._offset[row] = offset
            if joint in self._local:
                self._linear[row, self._local[joint]] = sign * 180.0 / np.pi
            else:
                self._offset[row] += sign * float(np.degrees(self._locked[joint]))
        self._groups = self._make_groups()

    def angles(self, q: Array) -> Array:
        """Return the posture angles (n, 22) [deg] of configurations (n, nq), exactly as `reba` defines them."""
        return self.evaluate(q)[0]

    def evaluate(self, q: Array, smooth: bool = False) -> tuple[Array, Array]:
        """Return posture angles (n, 22) [deg] and their Jacobian (n, 22, k) [deg/rad] by `columns`.

        Args:
            q: (n, nq) configurations of the world [rad, m].
            smooth: blend flexion and elevation of arms held sideways, so that the angles are differentiable.
        """
        own = np.asarray(q, dtype=float)[:, self.columns]
        angles = own @ self._linear.T + self._offset
        jacobian = np.empty((len(own), *self._linear.shape))
        jacobian[:] = self._linear
        for group in self._groups:
            for one, (values, slopes) in zip(group, self._group_angles(group, own, smooth), strict=True):
                angles[:, one.rows] = values.T
                jacobian[:, one.rows[:, None], one.local] = slopes[:, one.moving].transpose(2, 0, 1)
        return angles, jacobian

    def curvature(self, q: Array, weights: Array) -> list[tuple[Indices, Array]]:
        """Return sum_i weights_i d2 angle_i (n, m, m) of smooth angles for weights (n, 22), with their places in
        `columns` (m,); by forward differences. Other joints have no curvature."""
        own = np.asarray(q, dtype=float)[:, self.columns]
        blocks = []
        for group in self._groups:
            steps = len(group[0].names)
            values = np.repeat(self._group_values(group, own)[:, None], steps + 1, axis=1)
            values[range(steps), range(1, steps + 1)] += STEP
            count = len(own) * len(group)
            _, slopes = group[0].angles(values.reshape(steps, -1), True)
            change = slopes.reshape(*slopes.shape[:2], steps + 1, count)
            change = (change[:, :, 1:] - change[:, :, :1]) / STEP
            for number, one in enumerate(group):
                part = change[..., number * len(own) : (number + 1) * len(own)]
                hessian = np.einsum("nr,rijn->nij", weights[:, one.rows], part)[:, one.moving][:, :, one.moving]
                blocks.append((one.local, 0.5 * (hessian + np.swapaxes(hessian, 1, 2))))
        return blocks

    def _group_values(self, group: tuple[_Group, ...], own: Array) -> Array:
        """Return the joints of a group (j, n times its sides), side after side."""
        return np.concatenate([np.array([self._value(own, name) for name in one.names]) for one in group], axis=1)

    def _group_angles(self, group: tuple[_Group, ...], own: Array, smooth: bool) -> list[tuple[Array, Array]]:
        """Return angles (r, n) and slopes (r, j, n) of each side of a group."""
        values, slopes = group[0].angles(self._group_values(group, own), smooth)
        return list(zip(np.split(values, len(group), axis=1), np.split(slopes, len(group), axis=2), strict=True))

    def _make_groups(self) -> list[tuple[_Group, ...]]:
        """Return the groups of angles that are not linear in the joints; sides of one kind are evaluated at once."""
        trunk = ((2, -1.0, "pelvis_tilt"), *chain("thorax"))
        arms = {side: (*chain(f"clavicle_{side}"), *chain(f"upper_arm_{side}")[:-1]) for side in SIDES}
        flexion = [f"upper_arm_{part}" for part in ("flexion", "abduction")]
        # The last joint of the upper arm turns about the arm's own axis and does not change its direction.
        by_shape: dict[tuple[tuple[int, float], ...], list[_Group]] = {}
        for side, turns in arms.items():
            rows = [f"{name}_{side}" for name in flexion]
            shape = tuple((axis, sign) for axis, sign, _ in turns)
            by_shape.setdefault(shape, []).append(self._group(turns, rows, partial(_arm, shape)))
        groups = [
            (self._group(trunk, ["trunk_flexion", "trunk_side_bend", "trunk_twist"], _trunk),),
            *map(tuple, by_shape.values()),
        ]
        if self.body.legs == "solved":
            joints = tuple((0, 1.0, name) for name in PELVIS)
            groups.append((self._group(joints, [f"knee_flexion_{side}" for side in SIDES], self._knees),))
        return groups

    def _group(self, turns: tuple[Turn, ...], rows: list[str], angles: GroupAngles) -> _Group:
        names = tuple(name for _, _, name in turns)
        moving = np.array([at for at, name in enumerate(names) if name in self._local], np.intp)
        local = np.array([self._local[names[at]] for at in moving], np.intp)
        return _Group(names, np.array([INDEX[row] for row in rows]), moving, local, angles)

    def leg_shortfall(self, q: Array) -> tuple[Array, Array]:
        """Return the missing leg length (n, 2) [m] for soles in place, and its Jacobian (n, 2, k).

        A constraint, <= 0, where the legs are "solved"; see `knees`.
        """
        own = np.asarray(q, dtype=float)[:, self.columns]
        _, _, beyond, by_pelvis = knees(self._pelvis(own), self.body.stature, self.body.sex)
        jacobian = np.zeros((len(own), 2, len(self.columns)))
        self._put(jacobian, slice(0, 2), PELVIS, by_pelvis)
        return beyond, jacobian

    def _value(self, own: Array, name: str) -> Array:
        return own[:, self._local[name]] if name in self._local else np.full(len(own), self._locked[name])

    def _pelvis(self, own: Array) -> Array:
        return np.stack([self._value(own, name) for name in PELVIS], axis=1)

    def _put(self, jacobian: Array, rows: slice, names: tuple[str, ...], by_names: Array) -> None:
        """Write derivatives (n, rows, len(names)) into the columns of the joints that are not locked."""
        for at, name in enumerate(names):
            if name in self._local:
                jacobian[:, rows, self._local[name]] = by_names[:, :, at]

    def _knees(self, values: Array, smooth: bool) -> tuple[Array, Array]:
        """Return the flexion of both knees (2, n) [deg] and its slopes (2, 5, n) by the joints of the pelvis (5, n)."""
        del smooth  # these angles are
        bend, by_pelvis, _, _ = knees(values.T, self.body.stature, self.body.sex)
        return np.degrees(bend.T), np.degrees(by_pelvis.transpose(1, 2, 0))


def _rotated(
    values: Array, turns: Sequence[tuple[int, float]], vector: tuple[float, float, float]
) -> tuple[Array, Array]:
    """Return a vector (3, n) of the last frame of a chain in the axes of the first, and derivatives (3, T, n).

    Args:
        values: (T, n) joint angles.
        turns: axis and sign of each of the T rotations.
    """
    signs = np.array([sign for _, sign in turns])
    cosine, sine = np.cos(values), np.sin(values) * signs[:, None]
    # The vector, and then its derivative by each turn: an outer turn rotates them alike.
    every = np.zeros((3, 1 + len(turns), values.shape[1]))
    every[:, 0] = np.array(vector)[:, None]
    for at in range(len(turns) - 1, -1, -1):
        axis, sign = turns[at]
        i, j = (axis + 1) % 3, (axis + 2) % 3
        first = every[i] * cosine[at] - every[j] * sine[at]
        every[j] = every[i] * sine[at] + every[j] * cosine[at]
        every[i] = first
        every[i, 1 + at], every[j, 1 + at] = -sign * every[j, 0], sign * every[i, 0]
    return every[:, 0], every[:, 1:]


def _trunk(values: Array, smooth: bool) -> tuple[Array, Array]:
    """Return flexion, side bend and twist (3, n) [deg] and slopes (3, 6, n) by pelvis tilt and the spine (6, n)."""
    del smooth  # these angles are
    thorax = [(axis, sign) for axis, sign, _ in chain("thorax")]
    # Pelvis tilt acts as one more lumbar joint; pelvis yaw turns the vertical reference frame as well.
    (x, y, z), (dx, dy, dz) = _rotated(values, [(2, -1.0), *thorax], (0.0, 1.0, 0.0))
    flat = np.hypot(x, y)
    by_flat = (x * dx + y * dy) / flat
    flexion, side_bend = _atan2(x, y, dx, dy), _atan2(z, flat, dz, by_flat)
    # The third row of the rotation pelvis -> thorax is the inverse rotation of the z axis.
    inverse = [(axis, -sign) for axis, sign in reversed(thorax)]
    (x, y, z), (dx, dy, dz) = _rotated(values[:0:-1], inverse, (0.0, 0.0, 1.0))
    twist, by_spine = _atan2(-x, z, -dx, dz)
    slopes = np.zeros((3, *values.shape))
    slopes[0], slopes[1], slopes[2, :0:-1] = flexion[1], side_bend[1], by_spine
    return np.stack([flexion[0], side_bend[0], twist]), slopes


def _arm(turns: Sequence[tuple[int, float]], values: Array, smooth: bool) -> tuple[Array, Array]:
    """Return flexion and abduction (2, n) [deg] and slopes (2, T, n) by girdle and shoulder (T, n)."""
    (x, y, z), (dx, dy, dz) = _rotated(values, turns, (0.0, -1.0, 0.0))
    flat, across = np.hypot(x, y), np.hypot(x, z)
    # Along a pure direction the projection has length 0 and no slope; its weight in the result is 0 there.
    by_flat = (x * dx + y * dy) / np.maximum(flat, 1e-12)
    by_across = (x * dx + z * dz) / np.maximum(across, 1e-12)
    forward, by_forward = _atan2(x, -y, dx, -dy)
    forward = np.where(forward < -90.0, forward + 360.0, forward)
    raised, by_raised = _atan2(across, -y, by_across, -dy)
    if smooth:
        share, by_share = _blend(flat)
    else:
        share, by_share = (flat > np.sin(np.radians(CONE))).astype(float), np.zeros_like(flat)
    flexion = share * forward + (1.0 - share) * raised
    slopes = share * by_forward + (1.0 - share) * by_raised + by_share * by_flat * (forward - raised)
    abduction, by_abduction = _atan2(z, flat, dz, by_flat)
    return np.stack([flexion, abduction]), np.stack([slopes, by_abduction])


def _atan2(y: Array, x: Array, dy: Array, dx: Array) -> tuple[Array, Array]:
    """Return atan2(y, x) [deg] (n,) and its derivatives (k, n) [deg/rad] from those of y and x (k, n)."""
    length = np.maximum(x * x + y * y, 1e-18)
    return np.degrees(np.arctan2(y, x)), np.degrees((x * dy - y * dx) / length)


def _blend(flat: Array) -> tuple[Array, Array]:
    """Return the quintic smoothstep from 0 to 1 over `BAND`, and its derivative by `flat`."""
    low, high = BAND
    t = np.clip((flat - low) / (high - low), 0.0, 1.0)
    return t**3 * (t * (6.0 * t - 15.0) + 10.0), 30.0 * t**2 * (t - 1.0) ** 2 / (high - low)
