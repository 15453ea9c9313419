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

from functools import cache

import numpy as np

from lgp.errors import WorldError
from lgp.kinematics.human import joint_names
from lgp.kinematics.leg_ik import knees
from lgp.kinematics.world import World
from reba.arrays import Array
from reba.posture.angles import CONE
from reba.posture.columns import COLUMNS, INDEX, SIDES
from reba.readers.recording.profile import find_profile

Turn = tuple[int, float, str]
"""An elementary rotation: axis 0, 1 or 2, its sign, the joint."""
BAND = (np.sin(np.radians(CONE / 2)), np.sin(np.radians(CONE * 1.5)))
"""Length of the unit arm projected on the sagittal plane: limits between which elevation blends into flexion."""
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


class PostureMap:
    """The posture table of the human of a world; Jacobians are by `columns`, the k columns of q that move the human.

    Raises:
        WorldError: the world has no human.

    Example:
        >>> from lgp.scene.scene_file import load_scene
        >>> world = World(load_scene("screwdriver"))
        >>> angles, jacobian = PostureMap(world).evaluate(world.initial_configuration[None])
        >>> angles.shape, round(float(angles[0, INDEX["trunk_flexion"]]), 6) + 0.0
        ((1, 22), 0.0)
    """

    def __init__(self, world: World) -> None:
        if world.scene.human is None:
            raise WorldError("the scene has no human, so there is no posture; add a [human] table")
        self.body = world.scene.human
        self.columns = world.columns("human")
        self._local = {
            name: int(np.searchsorted(self.columns, world.column[f"human.{name}"]))
            for name in joint_names()
            if f"human.{name}" in world.column
        }
        self._locked = {name: world.initial_values[f"human.{name}"] for name in joint_names()}
        self._linear, self._offset = np.zeros((len(COLUMNS), len(self.columns))), np.zeros(len(COLUMNS))
        for column, (joint, sign, offset) in joint_angles().items():
            row = INDEX[column]
            self._offset[row] = offset
            if joint in self._local:
                self._linear[row, self._local[joint]] = sign * 180.0 / np.pi
            else:
                self._offset[row] += sign * float(np.degrees(self._locked[joint]))

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
        self._trunk(own, angles, jacobian)
        for side in SIDES:
            self._arm(own, side, smooth, angles, jacobian)
        if self.body.legs == "solved":
            self._knees(own, angles, jacobian)
        return angles, jacobian

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

    def _chain(self, own: Array, turns: tuple[Turn, ...], vector: tuple[float, float, float]) -> tuple[Array, Array]:
        """Return a vector (3, n) of the last frame in the axes of the first, and derivatives (3, len(turns), n)."""
        rotated = np.repeat(np.array(vector)[:, None], len(own), axis=1)
        slopes = np.zeros((3, len(turns), len(own)))
        for at, (axis, sign, name) in reversed(list(enumerate(turns))):
            angle = sign * self._value(own, name)
            cosine, sine = np.cos(angle), np.sin(angle)
            i, j = (axis + 1) % 3, (axis + 2) % 3
            for part in (rotated, slopes):
                first = part[i] * cosine - part[j] * sine
                part[j] = part[i] * sine + part[j] * cosine
                part[i] = first
            slopes[i, at], slopes[j, at] = -sign * rotated[j], sign * rotated[i]
        return rotated, slopes

    def _trunk(self, own: Array, angles: Array, jacobian: Array) -> None:
        # Pelvis tilt acts as one more lumbar joint; pelvis yaw turns the vertical reference frame as well.
        turns = ((2, -1.0, "pelvis_tilt"), *chain("thorax"))
        (x, y, z), (dx, dy, dz) = self._chain(own, turns, (0.0, 1.0, 0.0))
        names = tuple(name for _, _, name in turns)
        flat = np.hypot(x, y)
        by_flat = (x * dx + y * dy) / flat
        row = INDEX["trunk_flexion"]
        angles[:, row], slopes = _atan2(x, y, dx, dy)
        self._put(jacobian, slice(row, row + 1), names, slopes.T[:, None, :])
        row = INDEX["trunk_side_bend"]
        angles[:, row], slopes = _atan2(z, flat, dz, by_flat)
        self._put(jacobian, slice(row, row + 1), names, slopes.T[:, None, :])
        # The third row of the rotation pelvis -> thorax is the inverse rotation of the z axis.
        inverse = tuple((axis, -sign, name) for axis, sign, name in reversed(chain("thorax")))
        (x, y, z), (dx, dy, dz) = self._chain(own, inverse, (0.0, 0.0, 1.0))
        row = INDEX["trunk_twist"]
        angles[:, row], slopes = _atan2(-x, z, -dx, dz)
        self._put(jacobian, slice(row, row + 1), tuple(name for _, _, name in inverse), slopes.T[:, None, :])

    def _arm(self, own: Array, side: str, smooth: bool, angles: Array, jacobian: Array) -> None:
        # The last joint of the upper arm turns about the arm's own axis and does not change its direction.
        turns = (*chain(f"clavicle_{side}"), *chain(f"upper_arm_{side}")[:-1])
        (x, y, z), (dx, dy, dz) = self._chain(own, turns, (0.0, -1.0, 0.0))
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
        names = tuple(name for _, _, name in turns)
        for column, value, by_value in (("flexion", flexion, slopes), ("abduction", abduction, by_abduction)):
            row = INDEX[f"upper_arm_{column}_{side}"]
            angles[:, row] = value
            self._put(jacobian, slice(row, row + 1), names, by_value.T[:, None, :])

    def _knees(self, own: Array, angles: Array, jacobian: Array) -> None:
        bend, by_pelvis, _, _ = knees(self._pelvis(own), self.body.stature, self.body.sex)
        for at, side in enumerate(SIDES):
            row = INDEX[f"knee_flexion_{side}"]
            angles[:, row] = np.degrees(bend[:, at])
            self._put(jacobian, slice(row, row + 1), PELVIS, np.degrees(by_pelvis[:, at : at + 1]))


def _atan2(y: Array, x: Array, dy: Array, dx: Array) -> tuple[Array, Array]:
    """Return atan2(y, x) [deg] (n,) and its derivatives (k, n) [deg/rad] from those of y and x (k, n)."""
    length = np.maximum(x * x + y * y, 1e-18)
    return np.degrees(np.arctan2(y, x)), np.degrees((x * dy - y * dx) / length)


def _blend(flat: Array) -> tuple[Array, Array]:
    """Return the quintic smoothstep from 0 to 1 over `BAND`, and its derivative by `flat`."""
    low, high = BAND
    t = np.clip((flat - low) / (high - low), 0.0, 1.0)
    return t**3 * (t * (6.0 * t - 15.0) + 10.0), 30.0 * t**2 * (t - 1.0) ** 2 / (high - low)
