"""The nearest configuration that meets the constraints of a problem: a first point for the solver, or a quick no."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from lgp.kinematics.attachments import placed, resting
from lgp.kinematics.ik import least_squares
from lgp.kinematics.robot import slides
from lgp.kinematics.world import World
from lgp.path.collision_constraints import MARGIN
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.scene.model import Hand, SceneObject, Table
from reba.arrays import Array, Indices

CLOSE = 1e-4
"""[m, rad] Violation that counts as met; the solver removes the rest."""
STEPS, ROUNDS = 10, 4
"""Steps of a round of the search, and rounds: searches that succeed take 5 to 15 steps."""
PROGRESS = 0.8
"""A round that leaves more than this share of the violation is the last."""


def project_to_feasible(problem: PathProblem, start: Array, tolerance: float = CLOSE) -> tuple[Array, float]:
    """Return x (n,) near a start that violates the constraints least, and the largest violation left [m, rad]."""

    def residuals(x: Array, which: Indices) -> tuple[Array, Array]:
        values = problem.rows.evaluate(*problem.split(x[0]))
        equal, limits = problem.rows.jacobians(values)
        broken = values.inequality > 0.0
        slopes = np.where(broken[:, None], limits.toarray(), 0.0)
        value = np.concatenate([values.equality, np.where(broken, values.inequality, 0.0)])
        return value[None], np.concatenate([equal.toarray(), slopes])[None]

    x, before = start[None], np.inf
    for _ in range(ROUNDS):
        x, left = least_squares(residuals, x, problem.lower, problem.upper, tolerance, STEPS)
        if left[0] <= tolerance or left[0] > PROGRESS * before:
            break
        before = float(left[0])
    return x[0], float(left[0])


FINE = 1e-4
"""[m, rad] Violations below this are not worth a word."""
TURNED = 1e-3
"""[rad] Turns below this are not worth a word beside a distance."""


def explain_infeasibility(problem: PathProblem, x: Array) -> str:
    """Return the constraint that fails most at x (n,), "" if all hold.

    Example of a result: `phase 1, grasp(1, baxter.left, screwdriver): baxter.left stays 0.496 m away from screwdriver
    on table.start`.
    """
    values = problem.rows.evaluate(*problem.split(x))
    words: list[tuple[float, str]] = []
    switches: dict[tuple[int, str], list[float]] = {}
    for row, value in zip(problem.rows.eq_rows, values.equality, strict=True):
        if row.kind in ("jump", "screw", "joint"):
            switches.setdefault((row.number, row.kind), []).append(float(value))
        elif row.kind == "sole":
            text = f"{row.name} leaves the ground by {_amount(value, row.unit)}"
            words.append((abs(value), f"{_slice(problem, row.number)}: {text}"))
    for (number, kind), difference in switches.items():
        away, turned = float(np.linalg.norm(difference[:3])), float(np.linalg.norm(difference[3:]))
        if kind == "joint" and len(difference) == 3:
            away, turned = float(np.linalg.norm(difference[:2])), abs(difference[2])
        say = {"jump": _jump, "screw": _screw, "joint": _joint}[kind]
        words.append((away + turned, f"{_where(problem, number)}: {say(problem, number, away, turned)}"))
    for row, value in zip(problem.rows.in_rows, values.inequality, strict=True):
        if row.kind == "tilt":
            words.append((value, f"{_where(problem, row.number)}: {row.name} {_tilt(problem, row.name, value)}"))
        elif row.kind == "collision":
            words.append((value, f"{_slice(problem, row.number)}: {_touch(row.name, value)}"))
        else:
            words.append((value, f"{_slice(problem, row.number)}: the {row.name} leg is too short by {value:.3f} m"))
    amount, text = max(words, default=(0.0, ""))
    return text if amount > FINE else ""


def _jump(problem: PathProblem, number: int, away: float, turned: float) -> str:
    switch = problem.phases.switches[number]
    by = switch.table or problem.modes.attachment(switch.object_name, number).parent
    at = f"in {by}" if by in problem.world.scene.hands else f"on {by}"
    if away > FINE:
        placed = switch.action.attaches_to == "table"
        what = f"where {switch.object_name} lies {at}" if placed else f"{switch.object_name} {at}"
        more = f", turned by {np.degrees(turned):.1f} deg" if turned > TURNED else ""
        return f"{switch.hand} stays {away:.3f} m away from {what}{more}"
    return f"{switch.hand} cannot turn as {switch.object_name} lies {at}, {np.degrees(turned):.1f} deg are missing"


def _screw(problem: PathProblem, number: int, away: float, turned: float) -> str:
    switch = problem.phases.switches[number]
    skew = f", {np.degrees(turned):.1f} deg aslant" if turned > FINE else ""
    return f"{switch.hand} stays {away:.3f} m away from its place behind the screw{skew}"


def _joint(problem: PathProblem, number: int, away: float, turned: float) -> str:
    switch = problem.phases.switches[number]
    places = [
        f"{part} on {problem.modes.attachment(part, number).parent}" for part in (switch.object_name, switch.other)
    ]
    more = f" and {np.degrees(turned):.1f} deg" if turned > TURNED else ""
    return f"{' and '.join(places)} stand {away:.3f} m{more} from where they are joined"


def _tilt(problem: PathProblem, hand: str, value: float) -> str:
    limit = problem.world.scene.hands[hand].tilt
    tilted = np.degrees(np.arccos(np.clip(np.cos(np.radians(limit)) - value, -1.0, 1.0)))
    return f"must tilt by {tilted:.0f} deg, {tilted - limit:.1f} deg more than it may"


def _touch(name: str, value: float) -> str:
    first, _, second = name.partition(" and ")
    if value > MARGIN:
        return f"{first} goes {value - MARGIN:.3f} m into {second}"
    return f"{first} comes {value:.3f} m nearer to {second} than the {MARGIN:g} m that are kept"


def _where(problem: PathProblem, number: int) -> str:
    return f"phase {number + 1}, {problem.phases.label(number)}"


def _slice(problem: PathProblem, at: int) -> str:
    slice_ = int(problem.kept[at])
    return f"phase {slice_ // problem.phases.slices + 1}"


def _amount(value: float, unit: str) -> str:
    return f"{abs(value):.3f} m" if unit == "m" else f"{np.degrees(abs(value)):.1f} deg"


ITERATIONS = 20
"""Alternating projections in search of the direction that separates best; any direction gives a true bound."""


@dataclass(frozen=True)
class Rectangle:
    """A level rectangle: centre (3,), half sides (2,) [m] along the directions (2, 3); a point has half sides of 0."""

    centre: Array
    halves: Array
    sides: Array

    def nearest(self, point: Array) -> Array:
        """Return the point (3,) of the rectangle that is nearest."""
        along = np.clip(self.sides @ (point - self.centre), -self.halves, self.halves)
        return np.asarray(self.centre + along @ self.sides)

    def least(self, direction: Array) -> float:
        """Return the least d'p of its points p for a direction d (3,)."""
        return float(self.centre @ direction - self.halves @ np.abs(self.sides @ direction))


@dataclass(frozen=True)
class ReachBound:
    """Where a hand can be at most: within `length` of a point that slides.

    Attributes:
        root: (3,) the point with every slide at 0 [m].
        slides: (s, 3) directions of the slides, `lower` and `upper` (s,) their ends [m].
        length: [m].
    """

    root: Array
    slides: Array
    lower: Array
    upper: Array
    length: float

    def beyond(self, top: Rectangle) -> float:
        """Return by how much [m] the hand stays away from a table top at least; not above 0 if it may reach it."""
        at = 0.5 * (self.lower + self.upper)
        best = -np.inf
        for _ in range(ITERATIONS):
            root = self.root + at @ self.slides
            away = top.nearest(root) - root
            distance = float(np.linalg.norm(away))
            if distance < 1e-9:
                break
            direction = away / distance
            along = self.slides @ direction
            far = self.root @ direction + np.maximum(self.lower * along, self.upper * along).sum()
            best = max(best, top.least(direction) - float(far))
            moved = np.clip(self.slides @ (root + away - self.root), self.lower, self.upper)
            if np.abs(moved - at).max(initial=0.0) < 1e-6:
                break
            at = moved
        return max(best, 0.0) - self.length


def span(world: World, hand: Hand) -> ReachBound:
    """Return the span of a hand.

    Example:
        >>> span(world, world.scene.hands["baxter.left"]).length         # doctest: +SKIP
        1.21
    """
    model = world.model
    data = model.createData()
    frame = world.frame_id(hand.full)
    pin.framesForwardKinematics(model, data, world.initial_configuration)
    chain = list(model.supports[model.frames[frame].parentJoint])[1:]
    at = [data.oMi[joint].translation.copy() for joint in chain] + [data.oMf[frame].translation.copy()]
    axes = pin.computeJointJacobians(model, data, world.initial_configuration)
    columns = np.array([model.joints[joint].idx_q for joint in chain], dtype=np.intp)
    sliding = 0
    while sliding < len(chain) and slides(model.joints[chain[sliding]]):
        sliding += 1
    own = columns[:sliding]
    moves = axes[:3, own].T
    root = at[sliding] - world.initial_configuration[own] @ moves
    low, high = (limit - world.initial_configuration for limit in (world.lower, world.upper))
    turns = axes[3:, columns[sliding:]].T
    free = np.array([slides(model.joints[joint]) for joint in chain[sliding:]], dtype=bool)
    if free.any():
        # A slide behind a turning joint stretches the arm: nothing is claimed about it.
        return ReachBound(root, moves, world.lower[own], world.upper[own], np.inf)
    points = np.array(at[sliding:])
    shift = turns[0] * float(turns[0] @ (points[1] - points[0])) if len(turns) else np.zeros(3)
    # Along its own axis the first joint moves nothing.
    points[0] += shift
    length = _length(points, turns, low[columns[sliding:]], high[columns[sliding:]])
    return ReachBound(root + shift, moves, world.lower[own], world.upper[own], length)


def _length(points: Array, axes: Array, low: Array, high: Array) -> float:
    """Return the greatest distance of the last point from the first as a shortest sum of bounds.

    Args:
        points: (m + 1, 3) joint origins, and the hand.
        axes: (m, 3) of the joints.
        low, high: (m,) turns [rad] that are left to each joint from where the points are.
    """
    last = len(points) - 1
    links = np.diff(points, axis=0)
    rest = np.zeros(last + 1)
    for first in range(last - 1, -1, -1):
        rest[first] = np.linalg.norm(links[first]) + rest[first + 1]
        if first + 2 <= last:
            joint = first + 1
            pair = _across(links[first], links[joint], axes[joint], low[joint], high[joint])
            rest[first] = min(rest[first], pair + rest[first + 2])
    return float(rest[0])


def _across(first: Array, second: Array, axis: Array, low: float, high: float) -> float:
    """Return the greatest length of first + second while second turns about an axis from low to high [rad]."""
    constant = float(first @ axis) * float(second @ axis)
    cosine = float(first @ second) - constant
    sine = float(first @ np.cross(axis, second))
    best = np.arctan2(sine, cosine)
    angles = [low, high, *(turn for turn in best + 2.0 * np.pi * np.arange(-2, 3) if low <= turn <= high)]
    most = max(constant + cosine * np.cos(angle) + sine * np.sin(angle) for angle in angles)
    return float(np.sqrt(max(first @ first + second @ second + 2.0 * most, 0.0)))


LEAST = 1e-3
"""[m] Misses below this are left to the solver."""


class ReachCheck:
    """The spans of the hands of a world, each worked out when first asked for.

    Args:
        world: the kinematics.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self._spans: dict[str, ReachBound] = {}

    def refusal(self, phases: Phases) -> str:
        """Return why the hand of the last switch cannot get there, "" if it may.

        Only hands that grasp from a table or place on one are judged.
        """
        number = phases.count - 1
        switch = phases.switches[number]
        scene = self.world.scene
        if not (switch.action.works_at_table and switch.action.attaches_to):
            return ""
        grasped = switch.action.attaches_to == "hand"
        thing = scene.objects[switch.object_name]
        table, moved = switch.table or thing.on, bool(switch.table)
        for earlier in phases.switches[:number] if grasped else ():
            if earlier.object_name == switch.object_name:
                table, moved = earlier.table, True
        if table not in scene.tables:
            return ""
        top = _rectangle(scene.tables[table], thing, moved)
        grip = thing.grip(scene.hands[switch.hand].kind)
        miss = self._span(switch.hand).beyond(top) - grip.slide - float(np.linalg.norm(grip.at))
        if miss < LEAST:
            return ""
        what = f"{switch.object_name} on {table}" if grasped else f"where {switch.object_name} lies on {table}"
        return (
            f"phase {number + 1}, {phases.label(number)}: {switch.hand} stays at least {miss:.3f} m away from {what}, "
            "however its joints are stretched"
        )

    def _span(self, hand: str) -> ReachBound:
        if hand not in self._spans:
            self._spans[hand] = span(self.world, self.world.scene.hands[hand])
        return self._spans[hand]


def _rectangle(table: Table, thing: SceneObject, moved: bool) -> Rectangle:
    """Return where the middle of an object on a table can be: at its first place, or anywhere once it was moved."""
    yaw = np.radians(table.yaw)
    sides = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0]])
    x, y, halves = (0.0, 0.0, placed(table, thing, 0).upper[:2]) if moved else (*thing.at[:2], np.zeros(2))
    return Rectangle(resting(table, thing, x, y, 0.0, "z" if moved else thing.up)[1], halves, sides)
