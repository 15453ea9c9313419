"""Modifiable angles and factors of frames: the points that each alternative leaves, and its cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from reba.analysis.score_table import ScoreTable
from reba.arrays import Array, Flags
from reba.method.classes import AngleClasses, angle_classes
from reba.method.factor_points import knees_count, leg_points
from reba.method.rules import LOAD_EDGES, load_points
from reba.posture.angles import against_gravity
from reba.posture.columns import ANGLES, BEST, COLUMNS, INDEX, SIDES
from reba.posture.factors import ACTIVITIES, COUPLINGS, SUPPORTS, codes

Points = NDArray[np.int16]
MEASUREMENT_ERROR: Final = 5.0
"""[deg] A smaller change of an angle is lost in the error of a measurement: between the standard deviations of markers
and of inertial sensors in `reba/method/errors`."""
_BEST: Final = np.array([BEST[column] for column in COLUMNS])
_WORST: Final = np.array([angle.worst for angle in ANGLES for _ in angle.columns])


@dataclass(frozen=True)
class Alternative:
    """One alternative: the points (F,) that remain, the mean movement of the frames [deg], and both states in words.

    `limits` are the lowest and highest angle of the class [deg]; None for factors.
    """

    points: Points
    degrees: float
    target: str
    before: str
    limits: tuple[float, float] | None = None


@dataclass(frozen=True)
class Modifiable:
    """An angle or a factor of the frames that can be changed.

    Attributes:
        what: "trunk flexion", "load", "left coupling" ...
        kind: "angle", "load", "coupling", "support" or "activity".
        group: "a", "left", "right" or "activity".
        part: part score it counts for, without a side.
        shares: "" if its points add up, else the name of the points it shares with others of its part.
        points: (F,) points without a change.
        options: the changes, mildest first.
    """

    what: str
    kind: str
    group: str
    part: str
    shares: str
    points: Points
    options: tuple[Alternative, ...]

    def change(self, choice: int, option: int) -> PostureChange:
        """Return one option as a change."""
        chosen = self.options[option]
        return PostureChange(self.what, self.kind, chosen.before, chosen.target, chosen.degrees, choice, option)


@dataclass(frozen=True)
class PostureChange:
    """A change of one angle or factor.

    Attributes:
        what, kind: as in `Modifiable`.
        before, target: present and intended state, in words.
        degrees: how far the angle moves, averaged over the frames; 0 for factors.
        choice, option: where it stands among the choices.
    """

    what: str
    kind: str
    before: str
    target: str
    degrees: float
    choice: int
    option: int

    def text(self) -> str:
        """Return "trunk flexion 72.0 deg -> up to 60 deg"; a change below the measurement error is named as such."""
        if self.kind != "angle" or self.degrees >= MEASUREMENT_ERROR:
            return f"{self.what} {self.before} -> {self.target}"
        beyond = "less than 0.1" if self.degrees < 0.1 else f"{self.degrees:.1f}"
        return (
            f"{self.what} -> {self.target} ({beyond} deg beyond it, "
            f"below the measurement error of {MEASUREMENT_ERROR:g} deg)"
        )


@dataclass(frozen=True)
class Objective:
    """An objective of the search: cost per change and per degree, and the kinds of change it allows."""

    name: str
    kinds: tuple[str, ...]
    per_change: float
    per_degree: float = 1.0

    def allows(self, choice: Modifiable) -> bool:
        """Whether a choice may be changed under this objective."""
        return choice.kind in self.kinds

    def cost(self, choice: Modifiable, option: int) -> float:
        """Return the cost of an option."""
        return self.per_change + self.per_degree * choice.options[option].degrees


_ANY: Final = ("angle", "load", "coupling", "support", "activity")
_COUNT_FIRST: Final = 1e6


def objectives() -> tuple[Objective, ...]:
    """Return the objectives in the order in which they are offered."""
    return (
        Objective("least movement", ("angle",), 1e-6),
        Objective("fewest changes of posture", ("angle",), _COUNT_FIRST),
        Objective("load only", ("load",), 1.0),
        Objective("coupling only", ("coupling",), 1.0),
        Objective("support only", ("support",), 1.0),
        Objective("activity only", ("activity",), 1.0),
        Objective("fewest changes of any kind", _ANY, _COUNT_FIRST),
    )


def seen_angles(scores: ScoreTable, frames: NDArray[np.int64]) -> Array:
    """Return the angles (22, F) [deg] as the rules see them: upper arms against their reference; NaN = not measured."""
    angles = np.array(scores.angles[frames], np.float64).T
    if scores.rules.upper_arm_reference == "gravity":
        against_gravity(angles)
    return angles


def choices(scores: ScoreTable, frames: NDArray[np.int64], *, worst: bool = False) -> tuple[Modifiable, ...]:
    """Return the modifiable angles and factors of the frames that count for the total, with their present points.

    Unmeasured angles are neutral, or at their `worst`; no option changes them.
    """
    seen = seen_angles(scores, frames)
    measured = ~np.isnan(seen)
    angles = np.where(measured, seen, (_WORST if worst else _BEST)[:, None])
    knees = knees_count(_support(scores, frames), scores.rules)
    of_angles = [_angle(quantity, angles, measured, knees) for quantity in angle_classes(scores.rules)]
    counted = SIDES if scores.rules.two_sides == "worse" else (scores.rules.two_sides,)
    groups = ("a", *counted, "activity")
    return tuple(choice for choice in (*of_angles, *_factors(scores, frames)) if choice.group in groups)


def _angle(quantity: AngleClasses, angles: Array, measured: Flags, knees: Flags) -> Modifiable:
    places = [INDEX[column] for column in quantity.columns]
    rows, given = angles[places], measured[places]
    side = quantity.columns[0].rsplit("_", 1)[-1]
    group = side if side in SIDES and quantity.part != "legs" else "a"
    counts = knees.astype(np.int16) if quantity.part == "legs" else np.ones(rows.shape[1], np.int16)
    points = np.full(rows.shape, quantity.classes[-1].points, np.int16)
    for known in reversed(quantity.classes[:-1]):
        points[(rows >= known.low) & (rows <= known.high)] = known.points
    worst = points.max(axis=0)
    options = []
    for limit in reversed(quantity.classes[:-1]):
        limited = np.where(given, np.clip(rows, limit.low, limit.high), rows)
        if (points[given] > limit.points).any():
            left = np.where(given, np.minimum(points, limit.points), points).max(axis=0)
            options.append(
                Alternative(
                    points=(left * counts).astype(np.int16),
                    degrees=float(np.abs(rows - limited).sum(axis=0).mean()),
                    target=interval_text(limit.low, limit.high),
                    before=_range(rows[given]),
                    limits=(limit.low, limit.high),
                )
            )
    shares = quantity.adjusts if quantity.adjusts != quantity.name else ""
    part = quantity.part.removesuffix(f"_{side}")
    return Modifiable(quantity.name, "angle", group, part, shares, (worst * counts).astype(np.int16), tuple(options))


def interval_text(low: float, high: float) -> str:
    """Return a class in words; an end just below a printed edge reads "under"."""
    edge = round(high, 3)
    under = edge > high
    if low == -np.inf:
        return f"under {edge:g} deg" if under else f"up to {edge:g} deg"
    if round(low, 3) == -edge:
        return f"less than {edge:g} deg either way" if under else f"within {edge:g} deg"
    return f"{low:g} to {'under ' if under else ''}{edge:g} deg"


def _range(rows: Array) -> str:
    low, high = float(rows.min()), float(rows.max())
    return f"{low:z.1f} deg" if high - low < 0.05 else f"{low:z.1f} to {high:z.1f} deg"


def _at(scores: ScoreTable, name: str, frames: NDArray[np.int64]) -> NDArray[Any]:
    return np.broadcast_to(getattr(scores.factors, name), len(scores.data))[frames]


def _support(scores: ScoreTable, frames: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Return the places (F,) of the support of the legs in `SUPPORTS`."""
    return codes("support", _at(scores, "support", frames), SUPPORTS, len(frames))


def _factors(scores: ScoreTable, frames: NDArray[np.int64]) -> list[Modifiable]:
    def yes(name: str) -> Points:
        flags: Points = _at(scores, name, frames).astype(np.int16)
        return flags

    def removable(what: str, kind: str, group: str, part: str, points: Points, target: str) -> Modifiable:
        gone = Alternative(np.zeros_like(points), 0.0, target, "yes")
        return Modifiable(what, kind, group, part, "", points, (gone,) if points.any() else ())

    load = _at(scores, "load", frames)
    points = load_points(load).astype(np.int16)
    lighter = [
        Alternative(np.minimum(points, p).astype(np.int16), 0.0, target, f"{load.max():g} kg")
        for p, target in ((1, f"at most {LOAD_EDGES[1]:g} kg"), (0, f"under {LOAD_EDGES[0]:g} kg"))
        if points.max() > p
    ]
    factors = [
        Modifiable("load", "load", "a", "load_force", "", points, tuple(lighter)),
        removable("shock", "load", "a", "load_force", yes("shock"), "no shock"),
    ]
    base = leg_points(_support(scores, frames), scores.rules).astype(np.int16)
    both = Alternative(np.minimum(base, 1).astype(np.int16), 0.0, "both legs", "one leg")
    factors.append(Modifiable("support", "support", "a", "legs", "", base, (both,) if base.max() > 1 else ()))
    for side in SIDES:
        factors += [_coupling(scores, frames, side), _arm_support(side, yes(f"arm_supported_{side}"), load > 0)]
    targets = {"static": "change posture within a minute", "repeated": "fewer repetitions", "unstable": "move steadily"}
    factors += [removable(k, "activity", "activity", "activity", yes(k), targets[k]) for k in ACTIVITIES]
    return factors


def _coupling(scores: ScoreTable, frames: NDArray[np.int64], side: str) -> Modifiable:
    codes = scores.data[f"coupling_{side}"].to_numpy(np.int16)[frames]
    better = [
        Alternative(np.minimum(codes, code).astype(np.int16), 0.0, COUPLINGS[code], COUPLINGS[int(codes.max())])
        for code in reversed(range(int(codes.max())))
    ]
    return Modifiable(f"{side} coupling", "coupling", side, "coupling", "", codes, tuple(better))


def _arm_support(side: str, supported: Points, carrying: Flags) -> Modifiable:
    """Return the support of an arm; hands that carry a load leave no arm to rest."""
    left = np.where(carrying, -supported, -1).astype(np.int16)
    options = () if (left == -supported).all() else (Alternative(left, 0.0, "supported", "unsupported"),)
    return Modifiable(f"{side} arm", "support", side, "upper_arm", "", (-supported).astype(np.int16), options)
