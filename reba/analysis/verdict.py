"""The verdict on a recording: how bad, for how long, when and why, in one line of one pattern."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from reba.analysis.contributions import GROUPS, PARTS, lowered
from reba.analysis.score_table import ScoreTable
from reba.analysis.wording import both, moment, percent, seconds
from reba.arrays import Array
from reba.errors import join_names
from reba.method.classes import AngleClasses, angle_classes
from reba.method.rules import LOAD_EDGES
from reba.method.scoring import score_angles
from reba.method.tables import ACTION_LEVEL_FROM, ACTION_LEVELS, LEVEL_OF
from reba.posture.angles import against_gravity
from reba.posture.columns import INDEX, SIDES
from reba.posture.factors import ACTIVITIES, COUPLINGS, Factors, flag, load_kg

HIGH: Final = ACTION_LEVEL_FROM[3]
"""REBA from which the risk is high."""
NAMED: Final = 3
"""Times of worst postures, and causes in a tie, that the verdict names."""
TIE: Final = 0.01
"""Causes that explain the time at risk equally, up to this share of it, are a tie."""
_WORDS: Final[dict[str, tuple[str, str]]] = {
    "trunk flexion": ("trunk bent", "trunk bent backwards"),
    "trunk side bend": ("trunk bent sideways", "trunk bent sideways"),
    "trunk twist": ("trunk twisted", "trunk twisted"),
    "neck flexion": ("neck bent", "neck bent backwards"),
    "neck side bend": ("neck bent sideways", "neck bent sideways"),
    "neck twist": ("neck twisted", "neck twisted"),
    "knee flexion": ("knees bent", "knees bent"),
    "upper arm flexion": ("upper arms raised", "upper arms raised backwards"),
    "upper arm abduction": ("upper arms abducted", "upper arms abducted"),
    "shoulder elevation": ("shoulders raised", "shoulders raised"),
    "elbow flexion": ("elbows bent", "elbows bent"),
    "wrist flexion": ("wrists bent", "wrists extended"),
    "wrist deviation": ("wrists deviated", "wrists deviated"),
    "wrist twist": ("forearms turned", "forearms turned"),
}
"""Angle without a side -> what is said of a positive and of a negative one."""
_ACTIVITY: Final = {
    "static": "postures held for long",
    "repeated": "repeated movements",
    "unstable": "rapid changes of posture",
}


def verdict(
    scores: ScoreTable, weights: Array, p90: tuple[int | None, int | None], worst_times: Sequence[float]
) -> dict[str, Any]:
    """Return the verdict as plain data: `text`, and the figures in it.

    Args:
        weights: (n,) duration of each frame [s].
        p90: the 90th percentile of REBA at both ends of its range.
        worst_times: times of the worst postures [s], worst first.
    """
    low, high = p90
    if low is None or high is None:
        return {
            "text": "No frames, so there is no score.",
            "risk": "",
            "high_seconds": [0.0, 0.0],
            "causes": [],
            "parts": [],
        }
    ends = [scores.data[f"reba_{end}"].to_numpy(np.int64) for end in ("low", "high")]
    time_high = [float(weights[end >= HIGH].sum()) for end in ends]
    total = float(weights.sum()) or 1.0
    risk = both(*(ACTION_LEVELS[LEVEL_OF[end]][0] for end in p90))
    groups, causes, at_least = _causes(scores, weights, ends[0])
    if time_high[1] > 0:
        shares = both(*(percent(end / total) for end in time_high))
        lasting = f"{both(*(_time(end) for end in time_high))} ({shares}) at REBA {HIGH} or more"
    else:
        lasting = f"no time at REBA {HIGH} or more"
    parts = [f"90th percentile REBA {both(str(low), str(high))}", lasting]
    named = _worst(scores, worst_times, ends[1], time_high[1] > 0)
    if named:
        parts.append("worst at " + ", ".join(_moment(time, total) for time in named))
    if causes:
        some = causes[:NAMED]
        label = "main cause" if len(some) == 1 else "main causes, equal"
        of = "" if at_least == HIGH else f" (of REBA {at_least} or more)"
        parts.append(f"{label}: {join_names(some)}{of}")
    open_range = " Ranges are what unmeasured angles leave." if bool((ends[0] < ends[1]).any()) else ""
    return {
        "text": f"{risk.capitalize()} risk. {'; '.join(parts)}.{open_range}",
        "risk": risk,
        "high_seconds": time_high,
        "causes": causes,
        "parts": groups,
    }


def _worst(scores: ScoreTable, times: Sequence[float], high: NDArray[np.int64], at_risk: bool) -> list[float]:
    """Return those of the first times that the verdict names: where there is high risk, the ones that may be at it."""
    first = list(times[:NAMED])
    rows = np.minimum(np.searchsorted(scores.time, first), len(scores.time) - 1)
    reach = [time for time, row in zip(first, rows, strict=True) if high[row] >= HIGH] if at_risk else []
    return reach or first


def _time(value: float) -> str:
    return f"{value:.0f} s" if 10 <= value < 120 else seconds(value)


def _moment(time: float, total: float) -> str:
    """Return a time as players show it, the second that has begun; tenths in a short recording."""
    return f"{int(time)} s" if total >= 10 and time < 120 else moment(time)


def _causes(scores: ScoreTable, weights: Array, low: NDArray[np.int64]) -> tuple[list[str], list[str], int]:
    """Return what explains most of the time at risk, several in a tie, the same in words, and its lowest score.

    A part explains the time that would not be at risk if the part always had its lowest score. The time is that at
    high risk, or at the highest action level that occurs.
    """
    at_least = min(HIGH, ACTION_LEVEL_FROM[LEVEL_OF[low.max()]])
    frames = np.flatnonzero(low >= at_least)
    if at_least < ACTION_LEVEL_FROM[1]:
        return [], [], at_least
    parts: Any = scores.data
    if np.isnan(scores.angles[frames]).any():
        parts = score_angles(scores.angles, scores.factors, scores.rules, "neutral")
    at_risk = {name: np.asarray(parts[name])[frames].astype(np.int64) for name in PARTS}
    explained = {}
    for one in lowered(at_risk, weights[frames], scores.rules.two_sides):
        drop = float(((one.before - one.after) * one.weights).sum())
        explained[one.group] = (float(one.weights[one.after < at_least].sum()), drop)
    if not max(drop for _, drop in explained.values()) > 0:
        return [], [], at_least
    # Where no part alone takes time out of the risk, the mean score decides.
    which = 0 if max(time for time, _ in explained.values()) > 0 else 1
    most = max(value[which] for value in explained.values())
    equal = [group for group, value in explained.items() if value[which] >= most * (1 - TIE)]
    return equal, [_words(scores, group, frames, weights[frames], at_risk) for group in equal], at_least


def _words(
    scores: ScoreTable, group: str, frames: NDArray[np.int64], weights: Array, parts: dict[str, NDArray[np.int64]]
) -> str:
    """Return what raises a part in the frames, in words: "trunk bent over 60 degrees"."""
    used = scores.factors
    if group == "load_force":
        load = np.broadcast_to(load_kg(used.load, len(scores.data)), len(scores.data))[frames]
        kilograms = both(f"{load.min():g}", f"{load.max():g}")
        return f"a load of {kilograms} kg" if load.max() >= LOAD_EDGES[0] else "shock or rapid force"
    if group == "coupling":
        codes = np.concatenate([parts[f"coupling_{side}"] for side in SIDES])
        return f"{COUPLINGS[_mode(codes, np.tile(weights, 2), least=1)]} grip"
    if group == "activity":
        time = {kind: weights[_flags(used, kind, len(scores.data))[frames]].sum() for kind in ACTIVITIES}
        return _ACTIVITY[max(time, key=lambda kind: time[kind])]
    angles = np.array(scores.angles[frames], np.float64).T
    if scores.rules.upper_arm_reference == "gravity":
        against_gravity(angles)
    known = [one for one in angle_classes(scores.rules) if one.part in (group, *(f"{group}_{side}" for side in SIDES))]
    causes = [cause for one in known for cause in _raised(one, angles, weights)]
    if not causes:
        return "standing on one leg" if group == "legs" else GROUPS[group].lower()
    return max(causes)[1]


def _flags(used: Factors, kind: str, n: int) -> NDArray[np.bool_]:
    flags: NDArray[np.bool_] = np.broadcast_to(flag(kind, getattr(used, kind), n), (n,)).astype(bool)
    return flags


def _mode(codes: NDArray[np.int64], weights: Array, least: int) -> int:
    """Return the code from `least` on that has the most time."""
    time = np.bincount(codes, weights)
    time[:least] = -1.0
    return int(np.argmax(time))


def _raised(one: AngleClasses, angles: Array, weights: Array) -> list[tuple[float, str]]:
    """Return (points times seconds, words) of each class above the lowest in which an angle lies."""
    name = next((one.name.removeprefix(f"{side} ") for side in SIDES if one.name.startswith(f"{side} ")), one.name)
    causes = []
    for row in (angles[INDEX[column]] for column in one.columns):
        unassigned = ~np.isnan(row)
        for before, own in zip(one.classes, one.classes[1:], strict=False):
            unassigned &= ~((row >= before.low) & (row <= before.high))
            inside = unassigned & (row >= own.low) & (row <= own.high)
            for positive in (True, False):
                chosen = inside & ((row > before.high) if positive else (row < before.low))
                time = float(weights[chosen].sum())
                if time > 0:
                    edges = (before.high, own.high) if positive else (-before.low, -own.low)
                    words = _WORDS[name][0 if positive else 1]
                    causes.append((time * (own.points - one.classes[0].points), f"{words} {_edges(*edges)} degrees"))
    return causes


def _edges(near: float, far: float) -> str:
    near, far = round(near, 3) + 0.0, round(far, 3)
    if near < 0:  # the lower end of a class that does not hold 0, as of the elbow
        return f"under {-near:g}"
    return f"over {near:g}" if np.isinf(far) or far <= near else f"{near:g} to {far:g}"
