"""Where collision shapes are at many points of a sequence, and how points fixed to them move, all at once.

Every shape is rigid in a carrier: a frame of an agent, the hand or carried table that has its object, or the world.
Its pose there depends on the phase, and for an object on the variables of its attachment; the rest is a product of
stacked arrays. Legs that are solved from the pelvis have closed forms of their own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lgp.collision.shapes import CollisionShape, along
from lgp.kinematics.attachments import Attachment
from lgp.kinematics.features import cross, exponential, exponential_with_slope, logarithm
from lgp.kinematics.leg_ik import LegSegments
from lgp.kinematics.modes import ModeSequence, jaw_opening
from lgp.kinematics.world import Kinematics, World
from reba.arrays import Array, Flags, Indices


class ShapePlacements:
    """The shapes of a world along a sequence; a row is one shape at one point.

    Attributes:
        frames: frames whose placements are needed.
    """

    def __init__(self, world: World, modes: ModeSequence, shapes: Sequence[CollisionShape]) -> None:
        self.world, self.modes, self.shapes = world, modes, tuple(shapes)
        moving = [shape.frame for shape in shapes if shape.frame]
        self._grounds = [self._ground(shape) for shape in shapes]
        self.frames = tuple(dict.fromkeys([*moving, *modes.frames, *filter(None, self._grounds)]))
        # The world is the last carrier: it stands still, and no joint moves it.
        number = {name: at for at, name in enumerate(self.frames)} | {"": len(self.frames)}
        phases = range(len(modes.switches) + 1)
        self._carriers = np.array([[number[self._carrier(shape, phase)] for shape in shapes] for phase in phases])
        self._supports = np.array([*map(world.support, self.frames), np.zeros(world.nq)])
        self._model_supports = np.array([*map(world.model_support, self.frames), np.zeros(world.model.nq)])
        self._rotation, self._position = self._in_carriers(len(phases))
        self._set_attachments(len(phases))
        self._leg = np.array([bool(shape.leg) for shape in shapes])

    def poses(
        self, kinematics: Kinematics, phases: Indices, z: Array, slices: Indices, shapes: Indices
    ) -> tuple[Array, Array]:
        """Return rotations (m, 3, 3) and centres (m, 3) [m] of rows: shapes (m,) in slices (m,) of n.

        Args:
            kinematics: of n slices, with `frames`, or those of the shapes (`frames_of`).
            phases: (n,) of the slices.
            z: (nz,).
        """
        of_phase, of_frame = phases[slices], self._of_frames(kinematics)
        carriers = self._carriers[of_phase, shapes]
        parent, origin = of_frame[0][slices, carriers], of_frame[1][slices, carriers]
        rotation, position = self._rotation[of_phase, shapes], self._position[of_phase, shapes]
        if len(self._members):
            number = self._attachment[of_phase, shapes]
            rows = np.flatnonzero(number >= 0)
            turned, away = self._attached(z)[:2]
            position[rows] = away[number[rows]] + (turned[number[rows]] @ position[rows, :, None])[..., 0]
            rotation[rows] = turned[number[rows]] @ rotation[rows]
        rotations, centres = parent @ rotation, origin + (parent @ position[..., None])[..., 0]
        legs = self._leg[shapes]
        for shape in np.unique(shapes[legs]) if legs.any() else ():
            rows = np.flatnonzero(shapes == shape)
            start, end = self._leg_ends(self.shapes[shape], kinematics, slices[rows])
            rotations[rows], centres[rows] = along(end - start), (start + end) / 2.0
        return rotations, centres

    def speeds(
        self,
        kinematics: Kinematics,
        phases: Indices,
        z: Array,
        slices: Indices,
        shapes: Indices,
        points: Array,
        normals: Array,
    ) -> tuple[Array, Array]:
        """Return the derivatives (m, nq), (m, nz) along normals (m, 3) of points (m, 3) fixed to the shapes of rows."""
        of_phase = phases[slices]
        wrench = np.concatenate([normals, np.cross(points, normals)], axis=1)
        along_all = (wrench[:, None] @ kinematics.model_spatial[slices])[:, 0]
        carriers = self._carriers[of_phase, shapes]
        by_q = self.world.by_configuration(along_all * self._model_supports[carriers])
        by_variables = np.zeros((len(slices), self.modes.size))
        number = self._attachment[of_phase, shapes]
        rows = np.flatnonzero(number >= 0)
        if len(rows) and self.modes.size:
            own, normal = number[rows], normals[rows, None]
            rotation, position = self._of_frames(kinematics)
            parent, origin = rotation[slices[rows], carriers[rows]], position[slices[rows], carriers[rows]]
            turned, away, turns, arm = self._attached(z)
            # About the grip, where the object turns: its middle is `arm` from there.
            lever = points[rows] - origin - (parent @ (away + arm)[own, :, None])[..., 0]
            slope = (normal @ parent) @ self._offset_by[own] - (normal @ parent @ turned[own]) @ self._arm_by[own]
            by_variables[rows] = (slope + (np.cross(lever, normals[rows])[:, None] @ parent) @ turns[own])[:, 0]
        for shape in np.unique(shapes[self._leg[shapes]]):
            rows = np.flatnonzero(shapes == shape)
            moved = self._leg_speeds(self.shapes[shape], kinematics.rows(slices[rows]), points[rows])
            by_q[rows] = (normals[rows, None] @ moved)[:, 0]
        return by_q, by_variables

    def jacobians(self, kinematics: Kinematics, slices: Indices, carriers: Indices, points: Array) -> Array:
        """Return the Jacobians (m, 6, nq) of points (m, 3) fixed to carriers (m,)."""
        jacobian = kinematics.model_spatial[slices] * self._model_supports[carriers, None]
        jacobian[:, :3] += cross(jacobian[:, 3:], points)
        return self.world.by_configuration(jacobian)

    def frames_of(self, shapes: Indices) -> tuple[str, ...]:
        """Return the frames whose placements some shapes need, in all phases."""
        carriers = np.unique(self._carriers[:, shapes])
        own = [self.frames[number] for number in carriers if number < len(self.frames)]
        grounds = (self._grounds[shape] for shape in np.unique(shapes)) if any(self._grounds) else ()
        return tuple(dict.fromkeys([*own, *filter(None, grounds)]))

    def carriers(self, phases: Indices, shapes: Indices) -> Indices:
        """Return the carriers (m,) of shapes (m,) in phases (m,): numbers of frames, then the world's."""
        return np.asarray(self._carriers[phases, shapes])

    def joints(self, shape: int, phase: int) -> Flags:
        """Return (nq,) whether each joint moves a shape in a phase."""
        return np.asarray(self._supports[self._carriers[phase, shape]] > 0.0)

    def _ground(self, shape: CollisionShape) -> str:
        """Return the frame that the sole below a part of a leg stands in, "" for the floor."""
        return self.world.scene.humans[shape.owner].ground if shape.leg else ""

    def _carrier(self, shape: CollisionShape, phase: int) -> str:
        if shape.owner not in self.world.scene.objects:
            return shape.frame
        attachment = self.modes.attachment(shape.owner, phase)
        return attachment.parent if attachment.base is None else ""

    def _in_carriers(self, phases: int) -> tuple[Array, Array]:
        """Return poses (K + 1, B, 3, 3) and (K + 1, B, 3) of all shapes in their carriers, or in their objects.

        Jaws are open, or closed on what the hand has.
        """
        rotation = np.tile(np.array([shape.rotation for shape in self.shapes]), (phases, 1, 1, 1))
        position = np.tile(np.array([shape.position for shape in self.shapes]), (phases, 1, 1))
        for number, shape in enumerate(self.shapes):
            if shape.jaw is None:
                continue
            (closed, shut), (opened, wide) = shape.jaw.closed, shape.jaw.opened
            for phase in range(phases):
                share = jaw_opening(self.modes, shape.jaw.hand, phase, shape.jaw.width)
                rotation[phase, number] = closed @ exponential(share * logarithm(closed.T @ opened))
                position[phase, number] = shut + share * (wide - shut)
        return rotation, position

    def _set_attachments(self, phases: int) -> None:
        """Stack the A attachments of all objects, and number them for each phase and shape; -1 without."""
        self._members: list[Attachment] = []
        numbers: dict[int, int] = {}
        self._attachment = np.full((phases, len(self.shapes)), -1, np.intp)
        for phase in range(phases):
            for number, shape in enumerate(self.shapes):
                if shape.owner in self.world.scene.objects:
                    one = self.modes.attachment(shape.owner, phase)
                    if id(one) not in numbers:
                        numbers[id(one)] = len(self._members)
                        self._members.append(one)
                    self._attachment[phase, number] = numbers[id(one)]
        count, nz = len(self._members), self.modes.size
        self._turns, self._offset_by, self._arm_by = (np.zeros((count, 3, nz)) for _ in range(3))
        self._base, self._centre = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
        for number, one in enumerate(self._members):
            # Turns about the axes of the parent of each attachment: those of its table, which is in the world.
            if one.base is not None:
                self._base[number], self._centre[number] = one.base
            self._turns[number, :, one.variables] = one.turns
            self._offset_by[number, :, one.variables] = self._base[number] @ one.offset_by
            self._arm_by[number, :, one.variables] = one.arm_by
        self._facing = np.array([one.facing for one in self._members]).reshape(-1, 3, 3)
        self._offset, self._arm = (
            np.array([getattr(one, name) for one in self._members]).reshape(-1, 3) for name in ("offset", "arm")
        )

    def _attached(self, z: Array) -> tuple[Array, Array, Array, Array]:
        """Return rotation (A, 3, 3) and position (A, 3) of every attached object in its carrier, the rotation by the
        variables (A, 3, nz), and the way (A, 3) from the middle of the object to the point that it turns about."""
        turn, slope = exponential_with_slope(self._turns @ z)
        turned = self._base @ turn @ self._facing
        arm = (turned @ (self._arm + self._arm_by @ z)[..., None])[..., 0]
        offset = (self._base @ self._offset[..., None])[..., 0] + self._offset_by @ z
        return turned, self._centre + offset - arm, self._base @ slope @ self._turns, arm

    def _of_frames(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """Return rotations (n, F + 1, 3, 3) and positions (n, F + 1, 3) of all carriers that are known."""
        own = [number for number, name in enumerate(self.frames) if name in kinematics.index]
        at = [kinematics.index[self.frames[number]] for number in own]
        n, count = len(kinematics), len(self.frames) + 1
        rotation, position = np.zeros((n, count, 3, 3)), np.zeros((n, count, 3))
        rotation[:, own], rotation[:, -1] = kinematics.rotation[:, at], np.eye(3)
        position[:, own] = kinematics.position[:, at]
        return rotation, position

    def _leg_ends(self, body: CollisionShape, kinematics: Kinematics, rows: Indices | slice) -> tuple[Array, Array]:
        """Return both ends (n, 3) of a part of a leg that is solved in closed form."""
        at = kinematics.index[body.frame]
        legs = self._legs(body, kinematics, rows)
        return legs.ends(body.leg, kinematics.rotation[rows, at], kinematics.position[rows, at])

    def _legs(self, body: CollisionShape, kinematics: Kinematics, rows: Indices | slice) -> LegSegments:
        """Return the legs of the person that a part of a leg belongs to, standing where they do in some rows."""
        person, ground = self.world.scene.humans[body.owner], self._ground(body)
        if not ground:
            return LegSegments(person)
        at = kinematics.index[ground]
        return LegSegments(person, (kinematics.rotation[rows, at], kinematics.position[rows, at]))

    def _leg_speeds(self, body: CollisionShape, kinematics: Kinematics, points: Array) -> Array:
        """Return the Jacobians (n, 3, nq) of points on such a part, up to rotations about its own axis."""
        side, _, segment = body.leg.partition(" ")
        at = kinematics.index[body.frame]
        legs, ground = self._legs(body, kinematics, slice(None)), self._ground(body)
        hip = legs.hip(side, kinematics.rotation[:, at], kinematics.position[:, at])
        start, end = self._leg_ends(body, kinematics, slice(None))
        share = np.einsum("ni,ni->n", points - start, end - start) / np.sum((end - start) ** 2, axis=1)
        share = np.clip(share, 0.0, 1.0)[:, None, None]
        of_hip = kinematics.point_jacobian(body.frame, hip)[:, :3]
        bends, of_ankle = legs.knee_by_hip(side, hip), np.zeros_like(of_hip)
        if ground:
            # The leg moves with the ground, and bends as the hip moves relative to it.
            knee = legs.knee(side, hip)
            of_ankle, carried, at_hip = (
                kinematics.point_jacobian(ground, point)[:, :3] for point in (legs.ankle(side), knee, hip)
            )
            of_knee = carried + bends @ (of_hip - at_hip)
        else:
            of_knee = bends @ of_hip
        first, second = (of_hip, of_knee) if segment == "thigh" else (of_knee, of_ankle)
        return np.asarray((1.0 - share) * first + share * second)
