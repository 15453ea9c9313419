"""Signed distances between collision shapes and their Jacobians, for pairs that are near each other.

Broad phase: bounding spheres, all slices at once, select (slice, pair) rows. Narrow phase: coal (GJK and EPA) gives
distance, nearest points and normal of each row. The derivative of the distance is the relative velocity of the nearest
points along the normal, exact where these points are unique.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import coal
import numpy as np

from lgp.collision.joined_links import NEAR, joined_links
from lgp.collision.obstacle_shapes import obstacle_shapes
from lgp.collision.scene_shapes import collision_shapes
from lgp.collision.shapes import CollisionShape, along
from lgp.kinematics.features import cross, exponential, logarithm, position_curvature
from lgp.kinematics.leg_ik import LegSegments
from lgp.kinematics.modes import ModeSequence, jaw_opening
from lgp.kinematics.world import Kinematics, World
from reba.arrays import Array, Indices


@dataclass(frozen=True)
class Distances:
    """Signed distances (m,) [m], negative in penetration, each of one pair in one slice.

    Attributes:
        by_q: Jacobian (m, nq).
        by_variables: Jacobian (m, nz) by the variables of the sequence.
    """

    slices: Indices
    pairs: Indices
    value: Array
    by_q: Array
    by_variables: Array


class Collisions:
    """The collision shapes of a world and the pairs that must not touch.

    Without `modes` the objects have their initial attachments.

    Attributes:
        pairs: (first, second) numbers of shapes.
        close: whether a pair is of links that keep no margin.
        frames: frames whose placements are needed.

    Example:
        >>> from lgp.scene.scene_file import load_scene
        >>> world = World(load_scene("screwdriver"))
        >>> collisions = Collisions(world)
        >>> kinematics = world.at(world.initial_configuration[None], collisions.frames)
        >>> slices, pairs = collisions.near_pairs(kinematics, [0], np.zeros(0), within=0.1)
        >>> bool(collisions.values(kinematics, [0], np.zeros(0), slices, pairs).min() > -1e-9)
        True
    """

    def __init__(self, world: World, modes: ModeSequence | None = None) -> None:
        self.world, self.modes = world, modes or ModeSequence(world, ())
        self.shapes = (*collision_shapes(world), *obstacle_shapes(world.scene))
        moving = [shape.frame for shape in self.shapes if shape.frame]
        self.frames = tuple(dict.fromkeys([*moving, *self.modes.frames]))
        self._radii = np.array([shape.radius for shape in self.shapes])
        self._halves = np.array([shape.half for shape in self.shapes])
        self._rims = np.array([shape.rim for shape in self.shapes])
        person = world.scene.human
        self._legs = None if person is None else LegSegments(person)
        self._fingers: dict[tuple[int, int], tuple[Array, Array]] = {}
        self._request = coal.DistanceRequest()
        self._request.enable_signed_distance = True
        own = joined_links(world, self.shapes, self._nearer)
        names = [shape.name for shape in self.shapes]
        self._set_pairs(
            (first, second)
            for first, second in combinations(range(len(self.shapes)), 2)
            if _may_meet(self.shapes[first], self.shapes[second])
            and frozenset((names[first], names[second])) not in own.joined
        )
        self.close = np.array([frozenset((names[one], names[other])) in own.close for one, other in self.pairs], bool)

    def _set_pairs(self, pairs: Iterable[tuple[int, int]]) -> None:
        self.pairs = tuple(pairs)
        self._sides = np.array(self.pairs, dtype=np.intp).reshape(-1, 2)
        kinds = np.array([shape.kind == "point" for shape in self.shapes])[self._sides]
        self._point_to_box = np.where(kinds.any(axis=1), kinds.argmax(axis=1), -1)

    def _nearer(self, pairs: Sequence[tuple[int, int]], q: Array) -> tuple[Indices, Indices]:
        """Return in how many configurations (n, nq) pairs of links are in each other, and nearer than `NEAR`."""
        self._set_pairs(pairs)
        kinematics, phases, z = self.world.at(q, self.frames), np.zeros(len(q), np.intp), np.zeros(self.modes.size)
        slices, rows = self.near_pairs(kinematics, phases, z, NEAR)
        distance = self.values(kinematics, phases, z, slices, rows)
        meet, near = (np.bincount(rows[distance < least], minlength=len(pairs)) for least in (0.0, NEAR))
        return meet.astype(np.intp), near.astype(np.intp)

    def name(self, pair: int) -> str:
        """Return the name of a pair for messages: `table.left and baxter.left_w2`."""
        return " and ".join(self.shapes[side].name for side in self.pairs[pair])

    def is_grip(self, pair: tuple[int, int]) -> bool:
        """Return whether one of two shapes is the grip point of a hand, which has no body."""
        return "grip" in {self.shapes[side].kind for side in pair}

    def near_pairs(
        self,
        kinematics: Kinematics,
        phases: Sequence[int] | Indices,
        z: Array,
        within: float,
        required: Array | None = None,
    ) -> tuple[Indices, Indices]:
        """Return slices (m,) and pairs (m,) that may be nearer than `within` [m] beyond the distance they must keep.

        Conservative: every pair that is nearer is among them. `phases` (n,) are those of the n slices, z is (nz,),
        `required` (n, pairs) [m] as of `lgp.collision.contacts`, 0 by default.
        """
        rotations, centres = self._poses(kinematics, np.asarray(phases), z)
        first, second = self._sides.T
        gaps = np.linalg.norm(centres[:, first] - centres[:, second], axis=2) - self._radii[first] - self._radii[second]
        reach = within + (np.zeros_like(gaps) if required is None else required)
        slices, pairs = np.nonzero(gaps < reach)
        close, nearest = np.ones(len(slices), dtype=bool), reach[slices, pairs]
        # Second test: the bounding sphere of each shape against the other's core, a segment or box with its rim.
        for one, other in ((0, 1), (1, 0)):
            sphere, core = self._sides[pairs, one], self._sides[pairs, other]
            away = centres[slices, sphere] - centres[slices, core]
            inside = np.abs(np.einsum("mji,mj->mi", rotations[slices, core], away)) - self._halves[core]
            gap = np.linalg.norm(np.maximum(inside, 0.0), axis=1) - self._rims[core] - self._radii[sphere]
            close &= gap < nearest
        return slices[close], pairs[close]

    def distances(
        self,
        kinematics: Kinematics,
        phases: Sequence[int] | Indices,
        z: Array,
        slices: Indices,
        pairs: Indices,
    ) -> Distances:
        """Return the signed distances and Jacobians of rows from `near_pairs`."""
        phase = np.asarray(phases)
        value, points, normals = self._closest(kinematics, phase, z, slices, pairs)
        by_q, by_variables = np.zeros((len(slices), self.world.nq)), np.zeros((len(slices), self.modes.size))
        for number, sense in ((0, -1.0), (1, 1.0)):
            which = self._sides[pairs, number]
            for side in np.unique(which):
                rows = np.flatnonzero(which == side)
                moved, varied = self._speeds(side, kinematics, phase, z, slices[rows], points[number, rows])
                by_q[rows] += sense * np.einsum("ni,nij->nj", normals[rows], moved)
                by_variables[rows] += sense * np.einsum("ni,nij->nj", normals[rows], varied)
        return Distances(slices, pairs, value, by_q, by_variables)

    def curvature(
        self,
        kinematics: Kinematics,
        phases: Sequence[int] | Indices,
        z: Array,
        slices: Indices,
        pairs: Indices,
        weights: Array,
    ) -> Array:
        """Return the sum of weights (m,) times the second derivatives of distances by q, (n, nq, nq) by slice.

        Of points fixed to both bodies along a fixed normal: what rolling on each other adds is left out.
        """
        phase, nq = np.asarray(phases), self.world.nq
        total = np.zeros((len(phase), nq, nq))
        _, points, normals = self._closest(kinematics, phase, z, slices, pairs)
        for number, sense in ((0, -1.0), (1, 1.0)):
            frames = [
                self._carrier(self._sides[pair, number], int(phase[at]))
                for at, pair in zip(slices.tolist(), pairs.tolist(), strict=True)
            ]
            for frame in set(frames) - {""}:
                rows = np.array([row for row, name in enumerate(frames) if name == frame], np.intp)
                columns = np.flatnonzero(self.world.support(frame))
                jacobian = kinematics.rows(slices[rows]).point_jacobian(frame, points[number, rows])[:, :, columns]
                curved = position_curvature(jacobian, sense * weights[rows, None] * normals[rows])
                np.add.at(total, (slices[rows, None, None], columns[:, None], columns), curved)
        return total

    def values(
        self,
        kinematics: Kinematics,
        phases: Sequence[int] | Indices,
        z: Array,
        slices: Indices,
        pairs: Indices,
    ) -> Array:
        """Return the signed distances (m,) [m] of rows, without Jacobians."""
        return self._closest(kinematics, np.asarray(phases), z, slices, pairs)[0]

    def _closest(
        self, kinematics: Kinematics, phases: Indices, z: Array, slices: Indices, pairs: Indices
    ) -> tuple[Array, Array, Array]:
        """Return the distances (m,) of rows, their nearest points (2, m, 3) and normals (m, 3)."""
        rotations, centres = self._poses(kinematics, phases, z)
        m = len(slices)
        value, points, normals = np.empty(m), np.empty((2, m, 3)), np.empty((m, 3))
        boxes = self._point_to_box[pairs]
        for point in (0, 1):
            rows = np.flatnonzero(boxes == point)
            ball, box = self._sides[pairs[rows], point], self._sides[pairs[rows], 1 - point]
            away, normal = _from_box(
                rotations[slices[rows], box],
                centres[slices[rows], ball] - centres[slices[rows], box],
                self._halves[box],
            )
            value[rows] = away - self._rims[ball]
            points[point, rows] = centres[slices[rows], ball] - self._rims[ball, None] * normal
            points[1 - point, rows] = centres[slices[rows], ball] - away[:, None] * normal
            normals[rows] = normal if point else -normal
        result, placed = coal.DistanceResult(), {}
        for row in np.flatnonzero(boxes < 0).tolist():
            at, sides = int(slices[row]), self.pairs[pairs[row]]
            for side in sides:
                if (at, side) not in placed:
                    placed[at, side] = coal.Transform3s(rotations[at, side], centres[at, side])
            result.clear()
            first, second = (self.shapes[side].shape for side in sides)
            value[row] = coal.distance(first, placed[at, sides[0]], second, placed[at, sides[1]], self._request, result)
            points[0, row], points[1, row] = result.getNearestPoint1(), result.getNearestPoint2()
            normals[row] = result.normal
        return value, points, normals

    def dependencies(self, pair: int, phase: int) -> tuple[Indices, Indices]:
        """Return the columns of q and of z that the distance of a pair depends on in a phase."""
        joints, variables = np.zeros(self.world.nq, dtype=bool), [np.zeros(0, np.intp)]
        for side in self.pairs[pair]:
            body = self.shapes[side]
            if body.owner in self.world.scene.objects:
                attachment = self.modes.attachment(body.owner, phase)
                variables.append(np.arange(attachment.variables.start, attachment.variables.stop))
            frame = self._carrier(side, phase)
            if frame:
                joints |= self.world.support(frame) > 0.0
        return np.flatnonzero(joints), np.concatenate(variables)

    def _carrier(self, side: int, phase: int) -> str:
        """Return the frame that a shape moves with in a phase, "" for the world."""
        body = self.shapes[side]
        if body.owner not in self.world.scene.objects:
            return body.frame
        parent = self.modes.attachment(body.owner, phase).parent
        return parent if parent in self.world.scene.hands else ""

    def _poses(self, kinematics: Kinematics, phases: Indices, z: Array) -> tuple[Array, Array]:
        """Return rotations (n, B, 3, 3) and centres (n, B, 3) [m] of all shapes."""
        n = len(kinematics)
        rotations, centres = np.empty((n, len(self.shapes), 3, 3)), np.empty((n, len(self.shapes), 3))
        for number, body in enumerate(self.shapes):
            if body.owner in self.world.scene.objects:
                for phase in np.unique(phases):
                    rows = np.flatnonzero(phases == phase)
                    pose = self.modes.pose(body.owner, int(phase), kinematics.rows(rows), z)
                    rotations[rows, number] = pose.rotation
                    centres[rows, number] = pose.position + pose.rotation @ body.position
            elif body.leg:
                start, end = self._leg_ends(body, kinematics)
                rotations[:, number], centres[:, number] = along(end - start), (start + end) / 2.0
            elif body.jaw is not None:
                at = kinematics.index[body.frame]
                for phase in np.unique(phases):
                    rows = np.flatnonzero(phases == phase)
                    rotation, position = self._finger(number, int(phase))
                    rotations[rows, number] = kinematics.rotation[rows, at] @ rotation
                    centres[rows, number] = kinematics.position[rows, at] + kinematics.rotation[rows, at] @ position
            elif body.frame:
                at = kinematics.index[body.frame]
                rotations[:, number] = kinematics.rotation[:, at] @ body.rotation
                centres[:, number] = kinematics.position[:, at] + kinematics.rotation[:, at] @ body.position
            else:
                rotations[:, number], centres[:, number] = body.rotation, body.position
        return rotations, centres

    def _finger(self, number: int, phase: int) -> tuple[Array, Array]:
        """Return the pose of a shape of a finger in the frame of its hand's joint: open, or closed on what it has."""
        if (number, phase) not in self._fingers:
            jaw = self.shapes[number].jaw
            assert jaw is not None
            share = jaw_opening(self.modes, jaw.hand, phase, jaw.width)
            (closed, shut), (opened, wide) = jaw.closed, jaw.opened
            turn = closed @ exponential(share * logarithm(closed.T @ opened))
            self._fingers[number, phase] = turn, shut + share * (wide - shut)
        return self._fingers[number, phase]

    def _speeds(
        self, side: int, kinematics: Kinematics, phases: Indices, z: Array, slices: Indices, points: Array
    ) -> tuple[Array, Array]:
        """Return the Jacobians (m, 3, nq) and (m, 3, nz) of points (m, 3) on a shape in the slices (m,)."""
        body, nz = self.shapes[side], self.modes.size
        by_q, by_variables = np.zeros((len(slices), 3, self.world.nq)), np.zeros((len(slices), 3, nz))
        if body.owner in self.world.scene.objects:
            for phase in np.unique(phases[slices]):
                rows = np.flatnonzero(phases[slices] == phase)
                pose = self.modes.pose(body.owner, int(phase), kinematics.rows(slices[rows]), z).with_all_variables(nz)
                moved = pose.jacobian[:, :3] + cross(pose.jacobian[:, 3:], points[rows] - pose.position)
                by_q[rows], by_variables[rows] = moved[:, :, : self.world.nq], moved[:, :, self.world.nq :]
        elif body.leg:
            by_q[:] = self._leg_speeds(body, kinematics.rows(slices), points)
        elif body.frame:
            by_q[:] = kinematics.rows(slices).point_jacobian(body.frame, points)[:, :3]
        return by_q, by_variables

    def _leg_ends(self, body: CollisionShape, kinematics: Kinematics) -> tuple[Array, Array]:
        """Return both ends (n, 3) of a part of a leg that is solved in closed form."""
        assert self._legs is not None
        at = kinematics.index[body.frame]
        return self._legs.ends(body.leg, kinematics.rotation[:, at], kinematics.position[:, at])

    def _leg_speeds(self, body: CollisionShape, kinematics: Kinematics, points: Array) -> Array:
        """Return the Jacobians (n, 3, nq) of points on such a part, up to rotations about its own axis."""
        assert self._legs is not None
        side, _, segment = body.leg.partition(" ")
        at = kinematics.index[body.frame]
        hip = self._legs.hip(side, kinematics.rotation[:, at], kinematics.position[:, at])
        start, end = self._leg_ends(body, kinematics)
        share = np.einsum("ni,ni->n", points - start, end - start) / np.sum((end - start) ** 2, axis=1)
        share = np.clip(share, 0.0, 1.0)[:, None, None]
        of_hip = kinematics.point_jacobian(body.frame, hip)[:, :3]
        of_knee = self._legs.knee_by_hip(side, hip) @ of_hip
        first, second = (of_hip, of_knee) if segment == "thigh" else (of_knee, np.zeros_like(of_knee))
        return np.asarray((1.0 - share) * first + share * second)


def _from_box(rotation: Array, offset: Array, half: Array) -> tuple[Array, Array]:
    """Return the signed distances (m,) [m] of points from boxes, and normals (m, 3) away from these.

    Args:
        rotation: (m, 3, 3) of the boxes.
        offset: (m, 3) from the middles of the boxes to the points [m].
        half: (m, 3) half sides [m].
    """
    local = np.einsum("mji,mj->mi", rotation, offset)
    beyond = np.abs(local) - half
    outside = np.maximum(beyond, 0.0)
    distance = np.linalg.norm(outside, axis=1)
    inside = distance == 0.0
    deepest = np.eye(3)[np.argmax(beyond, axis=1)]
    direction = np.where(inside[:, None], deepest, outside / np.where(inside, 1.0, distance)[:, None])
    normal = np.einsum("mij,mj->mi", rotation, direction * np.where(local < 0.0, -1.0, 1.0))
    return np.where(inside, beyond.max(axis=1), distance), normal


def _may_meet(first: CollisionShape, second: CollisionShape) -> bool:
    """Return whether two shapes can touch and are not of one limb of a person."""
    kinds = {first.kind, second.kind}
    if "grip" in kinds:
        return kinds in ({"grip"}, {"grip", "object"})
    if "point" in kinds:
        return first.owner != second.owner and bool(kinds & {"table", "object"})
    if "link" not in kinds:
        # Of two shapes that are not links, only objects move.
        return "object" in kinds
    if first.owner != second.owner or not first.branch:
        return True
    return first.branch != second.branch and (first.reaches or second.reaches)
