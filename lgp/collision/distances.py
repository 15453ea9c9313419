"""Signed distances between bodies and their Jacobians, only where they come near each other.

A filter on spheres around the bodies, for all slices at once, leaves the (slice, pair) rows that matter; coal then
gives distance, nearest points and normal of each. The distance changes with the relative speed of the two points along
the normal, which is its exact derivative for smooth contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import coal
import numpy as np

from lgp.collision.shapes import CollisionShape, bodies_of
from lgp.kinematics.features import cross
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import Kinematics, World
from reba.arrays import Array, Indices

TOUCH = 0.02
"""[m] A hand that works on a table goes this far into its top: fingers and the heel of a palm are softer than capsules.
"""


@dataclass(frozen=True)
class Distances:
    """Signed distances of m rows.

    Attributes:
        slices, pairs: (m,) which slice and which pair.
        value: (m,) [m], negative inside each other.
        by_q: (m, nq).
        by_variables: (m, nz) by the variables of the sequence.
    """

    slices: Indices
    pairs: Indices
    value: Array
    by_q: Array
    by_variables: Array


class Collisions:
    """The pairs of bodies of a world that must not touch.

    Attributes:
        bodies: every body.
        pairs: (first, second) numbers of bodies.
        frames: frames whose placements are needed.

    Example:
        >>> collisions = Collisions(world, modes)                                        # doctest: +SKIP
        >>> kinematics = world.at(q, collisions.frames)                                  # doctest: +SKIP
        >>> rows = collisions.near_pairs(kinematics, phases, z, within=0.1)                    # doctest: +SKIP
        >>> collisions.distances(kinematics, phases, z, *rows).value                     # doctest: +SKIP
    """

    def __init__(self, world: World, modes: ModeSequence | None = None) -> None:
        self.world, self.modes = world, modes or ModeSequence(world, ())
        self.bodies = bodies_of(world)
        self.pairs = tuple(
            (first, second)
            for first, second in combinations(range(len(self.bodies)), 2)
            if _may_meet(self.bodies[first], self.bodies[second])
        )
        moving = [body.frame for body in self.bodies if body.frame]
        self.frames = tuple(dict.fromkeys([*moving, *self.modes.frames]))
        self._sides = np.array(self.pairs, dtype=np.intp).reshape(-1, 2)
        self._radii = np.array([body.radius for body in self.bodies])
        self._halves = np.array([body.half for body in self.bodies])
        self._rims = np.array([body.rim for body in self.bodies])
        self._slack: dict[int, Array] = {}
        self._request = coal.DistanceRequest()
        self._request.enable_signed_distance = True

    def name(self, pair: int) -> str:
        """Return how messages call a pair."""
        return " and ".join(self.bodies[side].name for side in self.pairs[pair])

    def near_pairs(
        self, kinematics: Kinematics, phases: Sequence[int] | Indices, z: Array, within: float
    ) -> tuple[Indices, Indices]:
        """Slices (m,) and pairs (m,) that may be nearer than `within` [m] less their allowed penetration; all that are.

        Args:
            kinematics: of n slices, holding `frames`.
            phases: (n,) phase of each slice.
            z: (nz,) variables of the sequence.
        """
        rotations, centres = self._poses(kinematics, np.asarray(phases), z)
        first, second = self._sides.T
        apart = (
            np.linalg.norm(centres[:, first] - centres[:, second], axis=2) - self._radii[first] - self._radii[second]
        )
        allowed = self.allowed_penetration(phases)
        slices, pairs = np.nonzero(apart + allowed < within)
        close, slack = np.ones(len(slices), dtype=bool), allowed[slices, pairs]
        # Of what is left, the sphere of each body against the other's core (a segment or a box, plus its rim).
        for one, other in ((0, 1), (1, 0)):
            sphere, core = self._sides[pairs, one], self._sides[pairs, other]
            away = centres[slices, sphere] - centres[slices, core]
            inside = np.abs(np.einsum("mji,mj->mi", rotations[slices, core], away)) - self._halves[core]
            gap = np.linalg.norm(np.maximum(inside, 0.0), axis=1) - self._rims[core] - self._radii[sphere]
            close &= gap + slack < within
        return slices[close], pairs[close]

    def distances(
        self,
        kinematics: Kinematics,
        phases: Sequence[int] | Indices,
        z: Array,
        slices: Indices,
        pairs: Indices,
    ) -> Distances:
        """Return the signed distances of given rows, see `near_pairs`, and their slopes."""
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
        """Return the signed distances (m,) [m] of given rows, without slopes."""
        return self._closest(kinematics, np.asarray(phases), z, slices, pairs)[0]

    def _closest(
        self, kinematics: Kinematics, phases: Indices, z: Array, slices: Indices, pairs: Indices
    ) -> tuple[Array, Array, Array]:
        """Return the distances (m,) of given rows, the nearest points (2, m, 3) and the normals (m, 3) there."""
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
            first, second = (self.bodies[side].shape for side in sides)
            value[row] = coal.distance(first, placed[at, sides[0]], second, placed[at, sides[1]], self._request, result)
            points[0, row], points[1, row] = result.getNearestPoint1(), result.getNearestPoint2()
            normals[row] = result.normal
        return value, points, normals

    def dependencies(self, pair: int, phase: int) -> tuple[Indices, Indices]:
        """Return the joints and the variables that move the bodies of a pair in a phase."""
        joints, variables = np.zeros(self.world.nq, dtype=bool), [np.zeros(0, np.intp)]
        for side in self.pairs[pair]:
            body = self.bodies[side]
            frame = body.frame
            if body.kind == "object":
                holder = self.modes.attachment(body.owner, phase)
                variables.append(np.arange(holder.variables.start, holder.variables.stop))
                frame = holder.parent if holder.parent in self.world.scene.hands else ""
            if frame:
                joints |= self.world.support(frame) > 0.0
        return np.flatnonzero(joints), np.concatenate(variables)

    def _poses(self, kinematics: Kinematics, phases: Indices, z: Array) -> tuple[Array, Array]:
        """Return rotations (n, B, 3, 3) and centres (n, B, 3) of all bodies."""
        n = len(kinematics)
        rotations, centres = np.empty((n, len(self.bodies), 3, 3)), np.empty((n, len(self.bodies), 3))
        for number, body in enumerate(self.bodies):
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
        """Return how far [m] each pair may go into each other in each slice, (n, pairs): inf where it may touch anyhow.

        An object meets what holds it in this phase, the one before or the next; a hand that works on a table meets it.
        """
        found = np.empty((len(phases), len(self.pairs)))
        for phase in np.unique(np.asarray(phases)):
            if phase not in self._slack:
                self._slack[phase] = self._slack_in(int(phase))
            found[np.asarray(phases) == phase] = self._slack[phase]
        return found

    def _slack_in(self, phase: int) -> Array:
        last = len(self.modes.switches)
        around = range(max(phase - 1, 0), min(phase + 1, last) + 1)
        working = self._working(phase)
        slack = np.zeros(len(self.pairs))
        for number, (first, second) in enumerate(self.pairs):
            one, other = self.bodies[first], self.bodies[second]
            if other.kind == "object":
                holders = {self.modes.attachment(other.owner, near).parent for near in around}
                # A table is a holder itself; a link touches what any hand of its agent holds.
                agents = {holder.partition(".")[0] for holder in holders} - {"table"} | self._touching(
                    other.owner, phase
                )
                if one.kind == "object" and self._joined(one.owner, other.owner, around):
                    holders.add(one.name)
                slack[number] = np.inf if one.name in holders or one.owner in agents else 0.0
            elif working & {(one.frame, other.name), (other.frame, one.name), (one.frame, other.frame)}:
                slack[number] = TOUCH
        return slack

    def _touching(self, thing: str, phase: int) -> set[str]:
        """Return the agents that work on an object without carrying it: whose hand holds it still, or screws it."""
        switches = self.modes.switches
        held = {
            hand.partition(".")[0]
            for hand, number, end in self.modes.holding_intervals
            if switches[number].object_name == thing and number <= phase <= end + 1
        }
        held |= {
            hand.partition(".")[0] for hand, name, end in self.modes.held_at_first if name == thing and phase <= end + 1
        }
        near = [switches[number] for number in (phase - 1, phase) if 0 <= number < len(switches)]
        screwing = [switch for switch in near if switch.action.screws and thing in (switch.object_name, switch.other)]
        return held | {switch.hand.partition(".")[0] for switch in screwing}

    def _joined(self, one: str, other: str, phases: range) -> bool:
        """Return whether two objects have a joint and are on one table in one of the phases."""
        if {one, other} not in [set(joint.parts) for joint in self.world.scene.assemblies]:
            return False
        holders = ([self.modes.attachment(part, phase).parent for part in (one, other)] for phase in phases)
        return any(first == second and first in self.world.scene.tables for first, second in holders)

    def _working(self, phase: int) -> set[tuple[str, str]]:
        """Return (frame, table) of hands that come from a table or go to one, (frame, frame) of two that meet."""
        found = set()
        for number in (phase - 1, phase):
            if not 0 <= number < len(self.modes.switches):
                continue
            switch = self.modes.switches[number]
            tables = {self.modes.attachment(switch.object_name, near).parent for near in (number, number + 1)}
            hands = [self._carrier(hand) for hand in switch.hands]
            found |= {(hand, other) for hand in hands for other in [*tables, *hands]}
        return found

    def _carrier(self, hand: str) -> str:
        """Return the frame of the body next to a hand: that of the joint that carries it."""
        model = self.world.model
        return str(model.names[model.frames[self.world.frame_id(hand)].parentJoint])

    def _speeds(
        self, side: int, kinematics: Kinematics, phases: Indices, z: Array, slices: Indices, points: Array
    ) -> tuple[Array, Array]:
        """Return the Jacobians (m, 3, nq) and (m, 3, nz) of (m, 3) points on a body in given slices."""
        body, nz = self.bodies[side], self.modes.size
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
    """Return whether two bodies can touch at all and are not neighbours."""
    kinds = {first.kind, second.kind}
    if "link" not in kinds:
        # What stands still touches only objects, and those are carried past tables and bodies.
        return "object" in kinds
    if first.owner != second.owner:
        return True
    return first.branch != second.branch and (first.reaches or second.reaches)
