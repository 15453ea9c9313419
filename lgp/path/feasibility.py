"""Feasible initial points, and a necessary condition for them.

`project_to_feasible` projects a point to the constraints by damped least squares (Nocedal & Wright 2006, ch. 10);
`ReachCheck` is by geometry alone: a hand whose stretched arm is shorter than the distance to a table top cannot reach
it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import scipy.sparse as sp

from lgp.kinematics.attachments import placed, resting
from lgp.kinematics.ik import least_squares
from lgp.kinematics.world import World
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.scene.joint_units import SLIDE
from lgp.scene.model import Hand, SceneObject, Table
from lgp.sqp.backends import Piqp
from lgp.sqp.merit import violation_max
from lgp.sqp.qp import QP, QPStatus, limits_of
from reba.arrays import Array, Flags, Indices

CLOSE = 1e-4
"""[m, rad] Violation that counts as met; the solver removes the rest."""
STEPS, ROUNDS = 10, 4
"""Least squares steps of a round, and rounds: projections that succeed take 5 to 15 steps."""
PROGRESS = 0.8
"""Share of the violation; a round that leaves more is the last."""


def project_to_feasible(
    problem: PathProblem, start: Array, tolerance: float = CLOSE, free: Flags | None = None
) -> tuple[Array, float]:
    """Return the projection x (n,) of a start to the constraints, and its largest violation [m, rad].

    Args:
        free: (n,) the unknowns that may change, all by default.
    """
    some = np.ones(problem.n, dtype=bool) if free is None else free

    def whole(part: Array) -> Array:
        x = start.copy()
        x[some] = part
        return x

    def residuals(part: Array, which: Indices) -> tuple[Array, Array]:
        at = problem.split(whole(part[0]))
        values = problem.constraints.evaluate(*at)
        equal, limits = problem.constraints.jacobians(values, *at)
        violated = values.inequality > 0.0
        gradients = np.where(violated[:, None], limits.toarray(), 0.0)
        value = np.concatenate([values.equality, np.where(violated, values.inequality, 0.0)])
        return value[None], np.concatenate([equal.toarray(), gradients])[None, :, some]

    part, before = start[None, some], np.inf
    for _ in range(ROUNDS):
        part, violation = least_squares(residuals, part, problem.lower[some], problem.upper[some], tolerance, STEPS)
        if violation[0] <= tolerance or violation[0] > PROGRESS * before:
            break
        before = float(violation[0])
    return whole(part[0]), float(violation[0])


NEWTON_STEPS = 8
"""Steps to the nearest feasible point, of which two or three are needed where it is near."""


def nearest_feasible(problem: PathProblem, start: Array, tolerance: float) -> tuple[Array, float]:
    """Return a feasible point x (n,) near a start that is nearly feasible, and its largest violation [m, rad].

    Each step is the shortest one to the linearised constraints, all of them: a projection to those that are violated
    would break others that are just met. It solves a QP, so it is for the end of a solve.
    """
    solver, identity, none = Piqp(), sp.eye_array(problem.n, format="csc"), np.zeros(problem.n)
    x, violation = start, np.inf
    for _ in range(NEWTON_STEPS):
        at = problem.split(x)
        values = problem.constraints.evaluate(*at)
        before, violation = violation, violation_max(values.equality, values.inequality)
        if violation <= tolerance or violation > PROGRESS * before:
            break
        equal, limits = problem.constraints.jacobians(values, *at)
        b, h = limits_of(values.equality, values.inequality, equal, limits)
        qp = QP(
            sp.csc_matrix(identity), none, equal, b, limits, h, problem.lower - x, problem.upper - x,
        )  # fmt: skip
        result = solver.solve(qp)
        if result.status is not QPStatus.SOLVED:
            break
        x = np.clip(x + result.x, problem.lower, problem.upper)
    return x, violation


ITERATIONS = 20
"""Alternating projections towards the best separating direction; any direction gives a valid bound."""


@dataclass(frozen=True)
class Rectangle:
    """A horizontal rectangle: centre (3,), half sides (2,) [m] along the unit vectors (2, 3); 0 for a point."""

    centre: Array
    halves: Array
    sides: Array

    def nearest(self, point: Array) -> Array:
        """Return the nearest point (3,) of the rectangle [m]."""
        along = np.clip(self.sides @ (point - self.centre), -self.halves, self.halves)
        return np.asarray(self.centre + along @ self.sides)

    def support_minimum(self, direction: Array) -> float:
        """Return the minimum of d'p over its points p for a direction d (3,)."""
        return float(self.centre @ direction - self.halves @ np.abs(self.sides @ direction))


@dataclass(frozen=True)
class ReachBound:
    """Upper bound on the reach of a hand: it stays within `length` [m] of a root point that slides.

    Attributes:
        root: (3,) the root point with every slide at 0 [m].
        slides: (s, 3) directions of the slides, `lower` and `upper` (s,) their limits [m].
    """

    root: Array
    slides: Array
    lower: Array
    upper: Array
    length: float

    def distance_beyond(self, area: Rectangle) -> float:
        """Return a lower bound on the distance [m] from the hand to an area; not above 0 where it may reach it."""
        at = 0.5 * (self.lower + self.upper)
        best = -np.inf
        for _ in range(ITERATIONS):
            root = self.root + at @ self.slides
            offset = area.nearest(root) - root
            distance = float(np.linalg.norm(offset))
            if distance < 1e-9:
                break
            direction = offset / distance
            along = self.slides @ direction
            farthest = self.root @ direction + np.maximum(self.lower * along, self.upper * along).sum()
            best = max(best, area.support_minimum(direction) - float(farthest))
            moved = np.clip(self.slides @ (root + offset - self.root), self.lower, self.upper)
            if np.abs(moved - at).max(initial=0.0) < 1e-6:
                break
            at = moved
        return max(best, 0.0) - self.length


def reach_bound(world: World, hand: Hand) -> ReachBound:
    """Return the reach bound of a hand: a sum of joint distances, each maximised within the joint limits."""
    model = world.model
    data = model.createData()
    frame = world.frame_id(hand.full)
    q = world.model_configuration(world.initial_configuration)
    pin.framesForwardKinematics(model, data, q)
    chain = list(model.supports[model.frames[frame].parentJoint])[1:]
    at = [data.oMi[joint].translation.copy() for joint in chain] + [data.oMf[frame].translation.copy()]
    axes = pin.computeJointJacobians(model, data, q)[:, [model.joints[joint].idx_v for joint in chain]]
    names = [str(model.names[joint]) for joint in chain]
    sliding = next((number for number, name in enumerate(names) if not _slides(world, name)), len(chain))
    if not set(names) <= set(world.joints):
        # Of joints that follow another one no bound is computed.
        return ReachBound(at[0], np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.inf)
    columns = np.array([world.column[name] for name in names], dtype=np.intp)
    own = columns[:sliding]
    moves = axes[:3, :sliding].T
    root = at[sliding] - world.initial_configuration[own] @ moves
    low, high = (limit - world.initial_configuration for limit in (world.lower, world.upper))
    turns = axes[3:, sliding:].T
    if any(_slides(world, name) for name in names[sliding:]):
        # A slide behind a revolute joint lengthens the arm: no bound is computed.
        return ReachBound(root, moves, world.lower[own], world.upper[own], np.inf)
    points = np.array(at[sliding:])
    shift = turns[0] * float(turns[0] @ (points[1] - points[0])) if len(turns) else np.zeros(3)
    # Offsets along its own axis do not move with the first joint.
    points[0] += shift
    length = _length(points, turns, low[columns[sliding:]], high[columns[sliding:]])
    return ReachBound(root + shift, moves, world.lower[own], world.upper[own], length)


def _slides(world: World, joint: str) -> bool:
    return world.units[joint] is SLIDE


def _length(points: Array, axes: Array, low: Array, high: Array) -> float:
    """Return an upper bound on the distance [m] from the first point to the last: the least sum of bounds of links.

    Args:
        points: (m + 1, 3) joint origins, and the hand.
        axes: (m, 3) of the joints.
        low, high: (m,) joint limits [rad] relative to the angles at which the points are given.
    """
    last = len(points) - 1
    links = np.diff(points, axis=0)
    reach = np.zeros(last + 1)
    for first in range(last - 1, -1, -1):
        reach[first] = np.linalg.norm(links[first]) + reach[first + 1]
        if first + 2 <= last:
            joint = first + 1
            pair = _longest_sum(links[first], links[joint], axes[joint], low[joint], high[joint])
            reach[first] = min(reach[first], pair + reach[first + 2])
    return float(reach[0])


def _longest_sum(first: Array, second: Array, axis: Array, low: float, high: float) -> float:
    """Return the maximum length [m] of first + second as second rotates about an axis from low to high [rad]."""
    constant = float(first @ axis) * float(second @ axis)
    cosine = float(first @ second) - constant
    sine = float(first @ np.cross(axis, second))
    best = np.arctan2(sine, cosine)
    angles = [low, high, *(turn for turn in best + 2.0 * np.pi * np.arange(-2, 3) if low <= turn <= high)]
    largest = max(constant + cosine * np.cos(angle) + sine * np.sin(angle) for angle in angles)
    return float(np.sqrt(max(first @ first + second @ second + 2.0 * largest, 0.0)))


MIN_DISTANCE = 1e-3
"""[m] Smallest distance beyond reach that refuses an action; the solver decides about smaller ones."""


class ReachCheck:
    """Necessary condition on reach: distances from table tops to the reach bounds of hands."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._bounds: dict[str, ReachBound] = {}

    def refusal(self, phases: Phases) -> str:
        """Return why the hand of the last switch cannot reach its table, "" if it may or uses none."""
        number = len(phases.switches) - 1
        switch = phases.switches[number]
        scene = self.world.scene
        if not (switch.action.works_at_table and switch.action.attaches_to):
            return ""
        grasped = switch.action.attaches_to == "hand"
        part = scene.objects[switch.object_name]
        table, moved = switch.table or part.on, bool(switch.table)
        for earlier in phases.switches[:number] if grasped else ():
            if earlier.object_name == switch.object_name:
                table, moved = earlier.table, True
        if table not in scene.tables or scene.tables[table].frame:
            return ""  # one that a robot carries may come
        area = _object_area(scene.tables[table], part, moved)
        grip = part.grip(scene.hands[switch.hand].kind)
        missing = self._bound(switch.hand).distance_beyond(area) - grip.slide - float(np.linalg.norm(grip.at))
        if missing < MIN_DISTANCE:
            return ""
        target = f"{switch.object_name} on {table}" if grasped else f"the place of {switch.object_name} on {table}"
        return (
            f"phase {phases.count}, {phases.label(number)}: {switch.hand} cannot reach {target}: at least "
            f"{missing:.3f} m short, whatever its posture"
        )

    def _bound(self, hand: str) -> ReachBound:
        if hand not in self._bounds:
            self._bounds[hand] = reach_bound(self.world, self.world.scene.hands[hand])
        return self._bounds[hand]


def _object_area(table: Table, part: SceneObject, moved: bool) -> Rectangle:
    """Return the area of the centre of an object on a table: its first place, or any place once it was moved."""
    yaw = np.radians(table.yaw)
    sides = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0]])
    x, y, halves = (0.0, 0.0, placed(table, part, 0).upper[:2]) if moved else (*part.at[:2], np.zeros(2))
    return Rectangle(resting(table, part, x, y, 0.0, "z" if moved else part.up)[1], halves, sides)
