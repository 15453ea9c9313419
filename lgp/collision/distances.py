"""Signed distances between collision shapes and their Jacobians, for pairs that are near each other.

Broad phase: bounding spheres, all slices at once, select (slice, pair) rows. Narrow phase: coal (GJK and EPA) gives
distance, nearest points and normal of each row. The derivative of the distance is the relative velocity of the nearest
points along the normal, exact where these points are unique.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import coal
import numpy as np

from lgp.collision.joined_links import NEAR, joined_links
from lgp.collision.obstacle_shapes import obstacle_shapes
from lgp.collision.placements import ShapePlacements
from lgp.collision.scene_shapes import collision_shapes
from lgp.collision.shapes import CollisionShape
from lgp.kinematics.features import position_curvature
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import Kinematics, World
from reba.arrays import Array, Indices

ROUNDING = 1e-6
"""[m] Pairs that are so much too far apart are looked at, too."""


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


@dataclass(frozen=True)
class NearestPoints:
    """Signed distances (m,) [m] of pairs in some slices.

    Attributes:
        points: (2, m, 3) of both bodies, nearest to each other [m].
        normals: (m, 3) from the first body to the second.
    """

    slices: Indices
    pairs: Indices
    value: Array
    points: Array
    normals: Array

    def rows(self, which: Indices) -> NearestPoints:
        """Return some of the rows."""
        parts = self.slices[which], self.pairs[which], self.value[which]
        return NearestPoints(*parts, self.points[:, which], self.normals[which])


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
        self.placements = ShapePlacements(world, self.modes, self.shapes)
        self.frames = self.placements.frames
        self._radii = np.array([shape.radius for shape in self.shapes])
        self._halves = np.array([shape.half for shape in self.shapes])
        self._rims = np.array([shape.rim for shape in self.shapes])
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
        self._ball_to_box = np.where(kinds.any(axis=1), kinds.argmax(axis=1), -1)

    def _nearer(
        self, pairs: Sequence[tuple[int, int]], q: Array
    ) -> tuple[Indices, Indices, Callable[[Indices], Array]]:
        """Return configurations (m,) of (n, nq) and pairs (m,) of links that may be nearer than `NEAR`, and a function
        that gives the distances of some of these."""
        self._set_pairs(pairs)
        kinematics, phases, z = self.world.at(q, self.frames), np.zeros(len(q), np.intp), np.zeros(self.modes.size)
        slices, rows = self.near_pairs(kinematics, phases, z, NEAR)
        return slices, rows, lambda some: self.values(kinematics, phases, z, slices[some], rows[some])

    def name(self, pair: int) -> str:
        """Return the name of a pair for messages: `table.left and baxter.left_w2`."""
        return " and ".join(self.shapes[side].name for side in self.pairs[pair])

    def frames_of(self, pairs: Indices) -> tuple[str, ...]:
        """Return the frames whose placements the distances of some pairs need."""
        return self.placements.frames_of(np.unique(self._sides[pairs]))

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
        n, count = len(kinematics), len(self.shapes)
        rotations, centres = self.placements.poses(
            kinematics, np.asarray(phases), z, np.repeat(np.arange(n), count), np.tile(np.arange(count), n)
        )
        rotations, centres = rotations.reshape(n, count, 3, 3), centres.reshape(n, count, 3)
        first, second = self._sides.T
        # |a - b|^2 of all centres by one product; its rounding is far below `ROUNDING`.
        squares = np.einsum("nbi,nbi->nb", centres, centres)
        squared = squares[:, :, None] + squares[:, None] - 2.0 * centres @ np.swapaxes(centres, 1, 2)
        gaps = np.sqrt(np.maximum(squared[:, first, second], 0.0)) - self._radii[first] - self._radii[second] - ROUNDING
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
        self, kinematics: Kinematics, phases: Sequence[int] | Indices, z: Array, slices: Indices, pairs: Indices
    ) -> Distances:
        """Return the signed distances and Jacobians of rows from `near_pairs`."""
        nearest = self.nearest(kinematics, phases, z, slices, pairs)
        return Distances(slices, pairs, nearest.value, *self.gradients(kinematics, phases, z, nearest))

    def gradients(
        self, kinematics: Kinematics, phases: Sequence[int] | Indices, z: Array, nearest: NearestPoints
    ) -> tuple[Array, Array]:
        """Return the derivatives (m, nq) and (m, nz) of distances by the configuration and all variables."""
        sides = self._sides[nearest.pairs]
        (first_q, first_z), (second_q, second_z) = (
            self.placements.speeds(
                kinematics,
                np.asarray(phases),
                z,
                nearest.slices,
                sides[:, number],
                nearest.points[number],
                nearest.normals,
            )
            for number in (0, 1)
        )
        return second_q - first_q, second_z - first_z

    def curvature(
        self, kinematics: Kinematics, phases: Sequence[int] | Indices, nearest: NearestPoints, weights: Array
    ) -> Array:
        """Return the sum of weights (m,) times the second derivatives of distances by q, (n, nq, nq) by slice.

        Of points fixed to both bodies along a fixed normal: what rolling on each other adds is left out.
        """
        total = np.zeros((len(kinematics), self.world.nq, self.world.nq))
        for number, sense in ((0, -1.0), (1, 1.0)):
            carriers = self.placements.carriers(np.asarray(phases)[nearest.slices], self._sides[nearest.pairs, number])
            rows = np.flatnonzero((carriers < len(self.frames)) & (weights != 0.0))
            slices = nearest.slices[rows]
            jacobian = self.placements.jacobians(kinematics, slices, carriers[rows], nearest.points[number, rows])
            curved = position_curvature(jacobian, sense * weights[rows, None] * nearest.normals[rows])
            total += sum_by(curved, slices, len(total))
        return total

    def values(
        self, kinematics: Kinematics, phases: Sequence[int] | Indices, z: Array, slices: Indices, pairs: Indices
    ) -> Array:
        """Return the signed distances (m,) [m] of rows, without Jacobians."""
        return self.nearest(kinematics, phases, z, slices, pairs).value

    def nearest(
        self, kinematics: Kinematics, phases: Sequence[int] | Indices, z: Array, slices: Indices, pairs: Indices
    ) -> NearestPoints:
        """Return the signed distances of rows with their nearest points and normals."""
        m, sides, of_phase = len(slices), self._sides[pairs], np.asarray(phases)
        rotation, centre = self.placements.poses(kinematics, of_phase, z, np.tile(slices, 2), sides.T.ravel())
        rotation, centre = rotation.reshape(2, m, 3, 3), centre.reshape(2, m, 3)
        value, points, normals = np.empty(m), np.empty((2, m, 3)), np.empty((m, 3))
        boxes = self._ball_to_box[pairs]
        for ball in (0, 1):
            rows, box = np.flatnonzero(boxes == ball), 1 - ball
            rim, middle = self._rims[sides[rows, ball]], centre[ball, rows]
            away, normal = _from_box(rotation[box, rows], middle - centre[box, rows], self._halves[sides[rows, box]])
            value[rows] = away - rim
            points[ball, rows], points[box, rows] = middle - rim[:, None] * normal, middle - away[:, None] * normal
            normals[rows] = normal if ball else -normal
        rows = np.flatnonzero(boxes < 0)
        computed, result = np.empty((len(rows), 10)), coal.DistanceResult()
        bodies, place = [shape.shape for shape in self.shapes], coal.Transform3s
        for out, row, (one, other) in zip(computed, rows.tolist(), sides[rows].tolist(), strict=True):
            first = bodies[one], place(rotation[0, row], centre[0, row])
            second = bodies[other], place(rotation[1, row], centre[1, row])
            result.clear()
            out[0] = coal.distance(*first, *second, self._request, result)
            out[1:4], out[4:7], out[7:] = result.getNearestPoint1(), result.getNearestPoint2(), result.normal
        value[rows], points[0, rows], points[1, rows], normals[rows] = (
            computed[:, 0],
            *np.split(computed[:, 1:], 3, axis=1),
        )
        return NearestPoints(slices, pairs, value, points, normals)

    def dependencies(self, pair: int, phase: int) -> tuple[Indices, Indices]:
        """Return the columns of q and of z that the distance of a pair depends on in a phase."""
        joints, variables = np.zeros(self.world.nq, dtype=bool), [np.zeros(0, np.intp)]
        for side in self.pairs[pair]:
            owner = self.shapes[side].owner
            if owner in self.world.scene.objects:
                attachment = self.modes.attachment(owner, phase)
                variables.append(np.arange(attachment.variables.start, attachment.variables.stop))
            joints |= self.placements.joints(side, phase)
        return np.flatnonzero(joints), np.concatenate(variables)


def sum_by(matrices: Array, group: Indices, count: int) -> Array:
    """Return the sums (count, p, p) of matrices (m, p, p) of the same group (m,): np.add.at adds them one by one."""
    total = np.zeros((count, *matrices.shape[1:]))
    if len(group):
        order = np.argsort(group, kind="stable")
        own, first = np.unique(group[order], return_index=True)
        total[own] = np.add.reduceat(matrices[order], first)
    return total


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
    """Return whether two shapes move against each other, can touch and are not of one limb of a person."""
    kinds = {first.kind, second.kind}
    if "grip" in kinds:
        return kinds in ({"grip"}, {"grip", "object"})
    if "point" in kinds:
        return first.owner != second.owner and bool(kinds & {"table", "object"})
    if "table" in kinds and first.frame == second.frame != "":
        return False  # what carries the table
    if not (first.frame or second.frame):
        # Of two shapes that no joint moves, only objects do.
        return "object" in kinds
    if first.owner != second.owner:
        return True
    if first.frame == second.frame:
        return False  # nothing moves them against each other
    return not first.branch or (first.branch != second.branch and (first.reaches or second.reaches))
