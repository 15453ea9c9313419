"""Configuration [rad] -> posture table [deg] and its Jacobian: one mapping for the true score and the surrogate.

Same definitions as `reba.posture.angles` for the joints of human.urdf with the pose of the pelvis known. Most columns
are joint angles; inclination and twist of the trunk and the direction of the upper arms are not and are differentiated
in closed form.

Kinks of the definition: the flexion of an upper arm is its elevation within 30 deg of the pure sideways direction
(`reba.posture.angles.CONE`), a jump on the edge of that cone, and it turns by 360 deg for an arm held straight
backwards (out of reach of a shoulder). `smooth=True` blends the two over a band of the cone instead; it is the
definition elsewhere.
"""

from __future__ import annotations

import numpy as np

from lgp.errors import WorldError
from lgp.kinematics.human import joint_names
from lgp.kinematics.leg_ik import knees
from lgp.kinematics.world import World
from reba.arrays import Array
from reba.posture.angles import CONE
from reba.posture.columns import COLUMNS, INDEX, SIDES

Step = tuple[int, float, str]
"""An elementary turn: axis 0, 1 or 2, its sense, the joint that turns."""
IN_PELVIS: tuple[Step, ...] = (
    (2, -1.0, "middle_lumbar_Z"),
    (0, 1.0, "middle_lumbar_X"),
    (2, -1.0, "middle_thoracic_Z"),
    (0, 1.0, "middle_thoracic_X"),
    (1, 1.0, "middle_thoracic_Y"),
)
"""Pelvis to thorax, in ISB axes."""
IN_THORAX: tuple[Step, ...] = ((0, -1.0, "clavicle_joint_X"), (2, 1.0, "shoulder_Z"), (0, -1.0, "shoulder_X"))
"""Thorax to upper arm of the right side, and of the left one in a mirror; turning about its own axis moves no arm."""
DIRECT: dict[str, tuple[str, float, float]] = {
    "neck_flexion": ("middle_cervical_Z", 1.0, 0.0),
    "neck_side_bend": ("middle_cervical_X", 1.0, 0.0),
    "neck_twist": ("middle_cervical_Y", 1.0, 0.0),
    "knee_flexion": ("knee_Z", 1.0, 0.0),
    "shoulder_elevation": ("clavicle_joint_X", 1.0, 0.0),
    "lower_arm_flexion": ("elbow_Z", 1.0, 0.0),
    "wrist_flexion": ("wrist_Z", 1.0, 0.0),
    "wrist_deviation": ("wrist_X", -1.0, 0.0),
    "wrist_twist": ("elbow_Y", 1.0, -90.0),
}
"""Columns that are joint angles: joint, sense, offset [deg] (as the profile human_description)."""
BAND = (np.sin(np.radians(CONE / 2)), np.sin(np.radians(CONE * 1.5)))
"""Length of the arm's shadow on the sagittal plane between which the smooth flexion blends elevation and flexion."""
PELVIS = ("pelvis_x", "pelvis_y", "pelvis_z", "pelvis_yaw", "pelvis_tilt")


class PostureMap:
    """The posture table of the human of a world.

    Attributes:
        columns: columns of q that move the human, (k,); Jacobians are by these.

    Raises:
        WorldError: the world has no human.

    Example:
        >>> from lgp.kinematics.world import World                            # doctest: +SKIP
        >>> posture = PostureMap(World(load_scene("screwdriver")))       # doctest: +SKIP
        >>> angles, jacobian = posture.evaluate(world.initial_configuration[None])       # doctest: +SKIP
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
        self._held = {name: world.initial_values[f"human.{name}"] for name in joint_names()}
        self._linear, self._offset = np.zeros((len(COLUMNS), len(self.columns))), np.zeros(len(COLUMNS))
        for column, (joint, sense, offset) in DIRECT.items():
            for side in SIDES:
                name = joint if joint.startswith("middle") else f"{side}_{joint}"
                row = INDEX[column if joint.startswith("middle") else f"{column}_{side}"]
                self._offset[row] = offset
                if name in self._local:
                    self._linear[row, self._local[name]] = sense * 180.0 / np.pi
                else:
                    self._offset[row] += sense * float(np.degrees(self._held[name]))

    def angles(self, q: Array) -> Array:
        """Return the (n, 22) posture angles [deg] of (n, nq) configurations, exactly as `reba` reads them."""
        return self.evaluate(q)[0]

    def evaluate(self, q: Array, smooth: bool = False) -> tuple[Array, Array]:
        """Return (n, 22) posture angles [deg] and their Jacobian (n, 22, k) [deg/rad] by `columns`.

        Args:
            q: (n, nq) configurations of the world.
            smooth: blend flexion and elevation of arms held sideways, so that the angles have a derivative.
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

    def reach(self, q: Array) -> tuple[Array, Array]:
        """Return by how much [m] the legs are too short to keep the soles in place (n, 2), and the Jacobian (n, 2, k).

        To be kept <= 0 where the legs are "solved"; see `stance.knees`.
        """
        own = np.asarray(q, dtype=float)[:, self.columns]
        _, _, beyond, by_pelvis = knees(self._pelvis(own), self.body.stature, self.body.sex)
        jacobian = np.zeros((len(own), 2, len(self.columns)))
        self._put(jacobian, slice(0, 2), PELVIS, by_pelvis)
        return beyond, jacobian

    def _value(self, own: Array, name: str) -> Array:
        return own[:, self._local[name]] if name in self._local else np.full(len(own), self._held[name])

    def _pelvis(self, own: Array) -> Array:
        return np.stack([self._value(own, name) for name in PELVIS], axis=1)

    def _put(self, jacobian: Array, rows: slice, names: tuple[str, ...], by_names: Array) -> None:
        """Write (n, rows, len(names)) derivatives into the columns of the joints that move."""
        for at, name in enumerate(names):
            if name in self._local:
                jacobian[:, rows, self._local[name]] = by_names[:, :, at]

    def _chain(self, own: Array, steps: tuple[Step, ...], vector: tuple[float, float, float]) -> tuple[Array, Array]:
        """Return a vector (3, n) carried from the last frame to the first, and its derivatives (3, len(steps), n)."""
        carried = np.repeat(np.array(vector)[:, None], len(own), axis=1)
        slopes = np.zeros((3, len(steps), len(own)))
        for at, (axis, sense, name) in reversed(list(enumerate(steps))):
            angle = sense * self._value(own, name)
            cosine, sine = np.cos(angle), np.sin(angle)
            i, j = (axis + 1) % 3, (axis + 2) % 3
            for part in (carried, slopes):
                first = part[i] * cosine - part[j] * sine
                part[j] = part[i] * sine + part[j] * cosine
                part[i] = first
            slopes[i, at], slopes[j, at] = -sense * carried[j], sense * carried[i]
        return carried, slopes

    def _trunk(self, own: Array, angles: Array, jacobian: Array) -> None:
        # The tilt of the pelvis turns forward as a lumbar joint does; its yaw turns the vertical frame with it.
        steps = ((2, -1.0, "pelvis_tilt"), *IN_PELVIS)
        (x, y, z), (dx, dy, dz) = self._chain(own, steps, (0.0, 1.0, 0.0))
        names = tuple(name for _, _, name in steps)
        flat = np.hypot(x, y)
        by_flat = (x * dx + y * dy) / flat
        row = INDEX["trunk_flexion"]
        angles[:, row], slopes = _atan2(x, y, dx, dy)
        self._put(jacobian, slice(row, row + 1), names, slopes.T[:, None, :])
        row = INDEX["trunk_side_bend"]
        angles[:, row], slopes = _atan2(z, flat, dz, by_flat)
        self._put(jacobian, slice(row, row + 1), names, slopes.T[:, None, :])
        # The third row of pelvis -> thorax is its inverse on the z axis.
        inverse = tuple((axis, -sense, name) for axis, sense, name in reversed(IN_PELVIS))
        (x, y, z), (dx, dy, dz) = self._chain(own, inverse, (0.0, 0.0, 1.0))
        row = INDEX["trunk_twist"]
        angles[:, row], slopes = _atan2(-x, z, -dx, dz)
        self._put(jacobian, slice(row, row + 1), tuple(name for _, _, name in inverse), slopes.T[:, None, :])

    def _arm(self, own: Array, side: str, smooth: bool, angles: Array, jacobian: Array) -> None:
        steps = tuple((axis, sense, f"{side}_{name}") for axis, sense, name in IN_THORAX)
        (x, y, z), (dx, dy, dz) = self._chain(own, steps, (0.0, -1.0, 0.0))
        flat, across = np.hypot(x, y), np.hypot(x, z)
        # At a pure direction the shadow has length 0 and no slope; nothing that is used then depends on it.
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
        names = tuple(name for _, _, name in steps)
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
    """Return a share that rises smoothly from 0 to 1 over `BAND`, and its derivative by `flat`."""
    low, high = BAND
    t = np.clip((flat - low) / (high - low), 0.0, 1.0)
    return t**3 * (t * (6.0 * t - 15.0) + 10.0), 30.0 * t**2 * (t - 1.0) ** 2 / (high - low)
