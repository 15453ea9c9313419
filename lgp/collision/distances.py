"""Signed distances between collision shapes and their Jacobians, for pairs that are near each other.

Broad phase: bounding spheres, all slices at once, select (slice, pair) rows. Narrow phase: coal (GJK and EPA) gives
distance, nearest points and normal of each row. The derivative of the distance is the relative velocity of the nearest
points along the normal, exact where these points are unique.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import coal
import numpy as np

from lgp.collision.obstacle_shapes import obstacle_shapes
from lgp.collision.shapes import CollisionShape, collision_shapes
from lgp.kinematics.features import cross
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import Kinematics, World
from reba.arrays import Array, Indices

CONTACT_DEPTH = 0.02
"""[m] Allowed penetration of a hand that works at a table: palm and fingers are softer than their capsules."""


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
        frames: frames whose placements are needed.

    Example:
        >>> from lgp.scene.scene_file import load_scene
        >>> world = World(load_scene("screwdriver"))
        >>> collisions = Collisions(world)
        >>> kinematics = world.at(world.initial_configuration[None], collisions.frames)
        >>> slices, pairs = collisions.near_pairs(kinematics, [0], np.zeros(0), within=0.1)
        >>> bool(collisions.values(kinematics, [0], np.zeros(0), slices, pairs).min() > 0.0)
        True
    """

    def __init__(self, world: World, modes: ModeSequence | None = None) -> None:
        self.world, self.modes = world, modes or ModeSequence(world, ())
        self.shapes = (*collision_shapes(world), *obstacle_shapes(world.scene))
        self.pairs = tuple(
            (first, second)
            for first, second in combinations(range(len(self.shapes)), 2)
            if _may_meet(self.shapes[first], self.shapes[second])
        )
        moving = [shape.frame for shape in self.shapes if shape.frame]
        self.frames = tuple(dict.fromkeys([*moving, *self.modes.frames]))
        self._sides = np.array(self.pairs, dtype=np.intp).reshape(-1, 2)
        self._radii = np.array([shape.radius for shape in self.shapes])
        self._halves = np.array([shape.half for shape in self.shapes])
        self._rims = np.array([shape.rim for shape in self.shapes])
        self._allowed: dict[int, Array] = {}
        self._request = coal.DistanceRequest()
        self._request.enable_signed_distance = True

    def name(self, pair: int) -> str:
        """Return the name of a pair for messages: `table.left and baxter.left_w2`."""
        return " and ".join(self.shapes[side].name for side in self.pairs[pair])

    def near_pairs(
        self, kinematics: Kinematics, phases: Sequence[int] | Indices, z: Array, within: float
    ) -> tuple[Indices, Indices]:
        """Return slices (m,) and pairs (m,) that may be nearer than `within` [m] less their allowed penetration.

        Conservative: every pair that is nearer is among them. `phases` (n,) are those of the n slices, z is (nz,).
        """
        rotations, centres = self._poses(kinematics, np.asarray(phases), z)
        first, second = self._sides.T
        gaps = np.linalg.norm(centres[:, first] - centres[:, second], axis=2) - self._radii[first] - self._radii[second]
        allowed = self.allowed_penetration(phases)
        slices, pairs = np.nonzero(gaps + allowed < within)
        close, penetration = np.ones(len(slices), dtype=bool), allowed[slices, pairs]
        # Second test: the bounding sphere of each shape against the other's core, a segment or box with its rim.
        for one, other in ((0, 1), (1, 0)):
            sphere, core = self._sides[pairs, one], self._sides[pairs, other]
            away = centres[slices, sphere] - centres[slices, core]
            inside = np.abs(np.einsum("mji,mj->mi", rotations[slices, core], away)) - self._halves[core]
            gap = np.linalg.norm(np.maximum(inside, 0.0), axis=1) - self._rims[core] - self._radii[sphere]
            close &= gap + penetration < within
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
        result, placed = coal.DistanceResult(), {}
        for row, (at, pair) in enumerate(zip(slices.tolist(), pairs.tolist(), strict=True)):
            sides = self.pairs[pair]
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
            frame = body.frame
            if body.kind == "object":
                attachment = self.modes.attachment(body.owner, phase)
                variables.append(np.arange(attachment.variables.start, attachment.variables.stop))
                frame = attachment.parent if attachment.parent in self.world.scene.hands else ""
            if frame:
                joints |= self.world.support(frame) > 0.0
        return np.flatnonzero(joints), np.concatenate(variables)

    def _poses(self, kinematics: Kinematics, phases: Indices, z: Array) -> tuple[Array, Array]:
        """Return rotations (n, B, 3, 3) and centres (n, B, 3) [m] of all shapes."""
        n = len(kinematics)
        rotations, centres = np.empty((n, len(self.shapes), 3, 3)), np.empty((n, len(self.shapes), 3))
        for number, body in enumerate(self.shapes):
            if body.kind == "object":
                for phase in np.unique(phases):
                    rows = np.flatnonzero(phases == phase)
                    pose = self.modes.pose(body.owner, int(phase), kinematics.rows(rows), z)
                    rotations[rows, number], centres[rows, number] = pose.rotation, pose.position
            elif body.frame:
                at = kinematics.index[body.frame]
                rotations[:, number] = kinematics.rotation[:, at] @ body.rotation
                centres[:, number] = kinematics.position[:, at] + kinematics.rotation[:, at] @ body.position
            else:
                rotations[:, number], centres[:, number] = body.rotation, body.position
        return rotations, centres

    def allowed_penetration(self, phases: Sequence[int] | Indices) -> Array:
        """Return the allowed penetration of each pair in each slice (n, pairs) [m], inf where contact is not limited.

        An object may touch its parent of this phase, the one before and the next; a hand that works at a table may
        touch its top.
        """
        allowed = np.empty((len(phases), len(self.pairs)))
        for phase in np.unique(np.asarray(phases)):
            if phase not in self._allowed:
                self._allowed[phase] = self._allowed_in(int(phase))
            allowed[np.asarray(phases) == phase] = self._allowed[phase]
        return allowed

    def _allowed_in(self, phase: int) -> Array:
        last = len(self.modes.switches)
        around = range(max(phase - 1, 0), min(phase + 1, last) + 1)
        working = self._working(phase)
        allowed = np.zeros(len(self.pairs))
        for number, (first, second) in enumerate(self.pairs):
            one, other = self.shapes[first], self.shapes[second]
            if other.kind == "object":
                parents = {self.modes.attachment(other.owner, near).parent for near in around}
                # A table itself is the parent; of an agent all links may touch what one of its hands has.
                agents = {parent.partition(".")[0] for parent in parents} - {"table"} | self._touching(
                    other.owner, phase
                )
                if one.kind == "object" and self._joined(one.owner, other.owner, around):
                    parents.add(one.name)
                allowed[number] = np.inf if one.name in parents or one.owner in agents else 0.0
            elif working & {(one.frame, other.name), (other.frame, one.name), (one.frame, other.frame)}:
                allowed[number] = CONTACT_DEPTH
        return allowed

    def _touching(self, object_name: str, phase: int) -> set[str]:
        """Return the agents whose hand holds an object still or screws it, without being its parent."""
        switches = self.modes.switches
        holding = {
            hand.partition(".")[0]
            for hand, number, end in self.modes.holding_intervals
            if switches[number].object_name == object_name and number <= phase <= end + 1
        }
        initially = ((hand, end) for hand, name, end in self.modes.held_at_first if name == object_name)
        holding |= {hand.partition(".")[0] for hand, end in initially if phase <= end + 1}
        near = [switches[number] for number in (phase - 1, phase) if 0 <= number < len(switches)]
        screwing = [one for one in near if one.action.screws and object_name in (one.object_name, one.other)]
        return holding | {switch.hand.partition(".")[0] for switch in screwing}

    def _joined(self, one: str, other: str, phases: range) -> bool:
        """Return whether two objects have an assembly and are on one table in one of the phases."""
        if {one, other} not in [set(assembly.parts) for assembly in self.world.scene.assemblies]:
            return False
        parents = ([self.modes.attachment(part, phase).parent for part in (one, other)] for phase in phases)
        return any(first == second and first in self.world.scene.tables for first, second in parents)

    def _working(self, phase: int) -> set[tuple[str, str]]:
        """Return (frame, table) of hands that act at a table, (frame, frame) of two hands that meet at an object."""
        contacts = set()
        for number in (phase - 1, phase):
            if not 0 <= number < len(self.modes.switches):
                continue
            switch = self.modes.switches[number]
            tables = {self.modes.attachment(switch.object_name, near).parent for near in (number, number + 1)}
            hands = [self._carrier(hand) for hand in switch.hands]
            contacts |= {(hand, other) for hand in hands for other in [*tables, *hands]}
        return contacts

    def _carrier(self, hand: str) -> str:
        """Return the frame of the link that a hand is fixed to: that of its parent joint."""
        model = self.world.model
        return str(model.names[model.frames[self.world.frame_id(hand)].parentJoint])

    def _speeds(
        self, side: int, kinematics: Kinematics, phases: Indices, z: Array, slices: Indices, points: Array
    ) -> tuple[Array, Array]:
        """Return the Jacobians (m, 3, nq) and (m, 3, nz) of points (m, 3) on a shape in the slices (m,)."""
        body, nz = self.shapes[side], self.modes.size
        by_q, by_variables = np.zeros((len(slices), 3, self.world.nq)), np.zeros((len(slices), 3, nz))
        if body.kind == "object":
            for phase in np.unique(phases[slices]):
                rows = np.flatnonzero(phases[slices] == phase)
                pose = self.modes.pose(body.owner, int(phase), kinematics.rows(slices[rows]), z).with_all_variables(nz)
                moved = pose.jacobian[:, :3] + cross(pose.jacobian[:, 3:], points[rows] - pose.position)
                by_q[rows], by_variables[rows] = moved[:, :, : self.world.nq], moved[:, :, self.world.nq :]
        elif body.frame:
            by_q[:] = kinematics.rows(slices).point_jacobian(body.frame, points)[:, :3]
        return by_q, by_variables


def _may_meet(first: CollisionShape, second: CollisionShape) -> bool:
    """Return whether two shapes can touch and are not neighbours in one limb."""
    kinds = {first.kind, second.kind}
    if "link" not in kinds:
        # Of two shapes that are not links, only objects move.
        return "object" in kinds
    if first.owner != second.owner:
        return True
    return first.branch != second.branch and (first.reaches or second.reaches)
