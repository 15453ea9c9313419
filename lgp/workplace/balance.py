"""The centre of mass of a standing person, for a batch of postures, and how far it is beyond the feet."""

from __future__ import annotations

from typing import Final

import numpy as np

from lgp.kinematics.human import ISB, PELVIS, offset, sided
from lgp.kinematics.leg_ik import LegSegments
from lgp.kinematics.world import Kinematics, World
from lgp.scene.body_measures import lengths, table
from reba.arrays import Array
from reba.posture.columns import SIDES

HEEL: Final = 0.15
"""Share of the foot's length behind the ankle that bears the body without falling (a choice)."""
TOES: Final = 0.55
"""The same in front of the ankle (a choice): the ankle is a quarter of the foot from the heel, and toes bear little."""
MASS_INDEX: Final = 24.0
"""[kg/m^2] Body mass over stature squared, which says how much a load in the hands counts (a choice)."""


class Balance:
    """The centre of mass of the human of a world, whose soles are in place, with a load in the hands.

    Args:
        world: its human has solved legs and stands at the origin.
        load: [kg], in equal shares in the `hands`.

    Attributes:
        lower, upper: (2,) x and y between which the centre of mass is above the feet [m].
        frames: that `World.at` must be asked for.
    """

    def __init__(self, world: World, load: float, hands: tuple[str, ...]) -> None:
        human = world.scene.human
        assert human is not None
        self.segments = LegSegments(human)
        measures = lengths(human.stature, human.sex)
        body = MASS_INDEX * human.stature**2
        held = load if hands else 0.0
        scale = body / (body + held)
        self._points: list[tuple[str, Array, float]] = []
        for name, entry in table()["masses"].items():
            for side in SIDES if "{side}" in name else ("right",):
                parent = sided(entry["after"], side)
                centre = entry["centre"] * offset(entry, measures, side, "to")
                if parent == "pelvis":  # has the axes of the world, its children those of a segment
                    parent, centre = PELVIS, ISB @ centre
                self._points.append((f"human.{parent}", centre, scale * entry[human.sex]))
        self._points += [(f"human.{hand}", np.zeros(3), held / (body + held) / len(hands)) for hand in hands if held]
        self._legs = {
            name: (entry["centre"], scale * entry[human.sex]) for name, entry in table()["leg_masses"].items()
        }
        foot, out = measures["foot_length"], measures["half_hips"]
        self.lower, self.upper = np.array([-HEEL * foot, -out]), np.array([TOES * foot, out])
        self.frames = tuple(dict.fromkeys([*(frame for frame, _, _ in self._points), f"human.{PELVIS}"]))

    def evaluate(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """Return x and y (n, 2) [m] of the centre of mass, and the Jacobian (n, 2, nq)."""
        pelvis = kinematics.index[f"human.{PELVIS}"]
        rotation, position = kinematics.rotation[:, pelvis], kinematics.position[:, pelvis]
        points = [
            kinematics.position[:, kinematics.index[frame]] + kinematics.rotation[:, kinematics.index[frame]] @ centre
            for frame, centre, _ in self._points
        ]
        (thigh, of_thigh), (shank, of_shank) = self._legs["thigh"], self._legs["shank"]
        at_knee = of_thigh * thigh + of_shank * (1.0 - shank)
        total, bent = np.zeros((len(kinematics), 3)), []
        for side in SIDES:
            hip = self.segments.hip(side, rotation, position)
            knee, by_hip = self.segments.knee(side, hip), self.segments.knee_by_hip(side, hip)
            _, ankle = self.segments.ends(f"{side} shank", rotation, position)
            total += at_knee * knee + (of_shank * shank + self._legs["foot"][1]) * ankle
            points.append(hip)
            bent.append(at_knee * by_hip @ kinematics.point_jacobian(f"human.{PELVIS}", hip)[:, :3])
        shares = np.array([*(share for _, _, share in self._points), *[of_thigh * (1.0 - thigh)] * len(SIDES)])
        placed = np.stack(points, axis=1)
        total += np.einsum("p,npi->ni", shares, placed)
        slope = self._moved(kinematics, shares, placed) + sum(bent)
        return total[:, :2], slope[:, :2]

    def _moved(self, kinematics: Kinematics, shares: Array, points: Array) -> Array:
        """Return the Jacobian (n, 3, nq) of the sum of points (n, P, 3) with shares (P,), of all at once."""
        world = kinematics.world
        frames = [*(frame for frame, _, _ in self._points), *[f"human.{PELVIS}"] * len(SIDES)]
        masks = shares[:, None] * np.array([world.model_support(frame) for frame in frames])
        spatial = kinematics.model_spatial
        arms = np.einsum("npi,pk->nik", points, masks)
        turned = np.cross(spatial[:, 3:], arms, axis=1)
        return world.by_configuration(spatial[:, :3] * masks.sum(axis=0) + turned)

    def beyond(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """Return how far the centre of mass is beyond the feet (n, 4) [m], <= 0 above them, and the Jacobian."""
        centre, slope = self.evaluate(kinematics)
        return (
            np.concatenate([centre - self.upper, self.lower - centre], axis=1),
            np.concatenate([slope, -slope], axis=1),
        )
