"""What drives the score: time in each part score, and how much each part adds to the mean."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.exposure import column
from reba.posture import SIDES
from reba.report.recording import Recording
from reba.report.words import PARTS
from reba.scoring import ScoreArrays, score_parts
from reba.tables import PART_MAXIMA

GROUPS: Final[dict[str, str]] = {
    "trunk": "Trunk",
    "neck": "Neck",
    "legs": "Legs",
    "load_force": "Load and force",
    "upper_arm": "Upper arms",
    "lower_arm": "Lower arms",
    "wrist": "Wrists",
    "coupling": "Coupling",
    "activity": "Activity",
}
"""Parts whose effect on the total is worked out, both sides together."""


@dataclass(frozen=True)
class PartShare:
    """Time in each score of one part.

    Attributes:
        title: name of the part.
        shares: (score, share of time), lowest first; scores that never occur are left out.
        undetermined: share of time in which it is not known.
        mean_low, mean_high: time-weighted mean at both ends of the range.
        highest: highest score that the part can have.
    """

    title: str
    shares: tuple[tuple[int, float], ...]
    undetermined: float
    mean_low: float
    mean_high: float
    highest: int


@dataclass(frozen=True)
class Effect:
    """How far the mean REBA would fall if one part always had its lowest score."""

    title: str
    mean: float
    drop: float


def part_shares(record: Recording) -> list[PartShare]:
    """Return the time in each part score, in worksheet order."""
    if not record.frames:
        return []
    found = []
    weights, total = record.weights, record.seconds
    for name, title in PARTS.items():
        values = column(record.scores, name)
        known = ~np.isnan(values)
        seconds = np.bincount(values[known].astype(int), weights[known])
        shares = tuple((score, float(s / total)) for score, s in enumerate(seconds.tolist()) if s > 0)
        low, high = (float(np.average(end[name], weights=weights)) for end in (record.ends.low, record.ends.high))
        part = next(part for part in PART_MAXIMA if name.startswith(part))
        found.append(PartShare(title, shares, float(weights[~known].sum() / total), low, high, PART_MAXIMA[part]))
    return found


def effects(record: Recording) -> list[Effect]:
    """Return the effect of each part on the mean REBA (unmeasured angles neutral), largest first.

    The few combinations of part scores that occur are scored again with one part at its lowest.
    """
    if not record.frames:
        return []
    combinations, weights = _combinations(record.ends.low, record.weights)
    sides = record.scores.rules.two_sides
    before = float(np.average(_totals(combinations, sides), weights=weights))
    found = []
    for group, title in GROUPS.items():
        lowest = 0 if group in ("load_force", "coupling", "activity") else 1
        eased = {name: np.full_like(v, lowest) if name.startswith(group) else v for name, v in combinations.items()}
        after = float(np.average(_totals(eased, sides), weights=weights))
        found.append(Effect(title, after, before - after))
    return sorted(found, key=lambda effect: -effect.drop)


def _combinations(
    scores: ScoreArrays, weights: NDArray[np.float64]
) -> tuple[dict[str, NDArray[np.int64]], NDArray[np.float64]]:
    """Return each combination of part scores that occurs, and its seconds."""
    key = np.zeros(len(weights), np.int64)
    for name in PARTS:
        key = key * 8 + scores[name]
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    occurring = {name: scores[name][first].astype(np.int64) for name in PARTS}
    return occurring, np.bincount(which, weights).astype(np.float64)


def _totals(parts: dict[str, NDArray[np.int64]], sides: str) -> NDArray[np.int64]:
    shared = {name: parts[name] for name in ("trunk", "neck", "legs", "load_force", "activity")}
    totals = {
        side: score_parts(
            **shared, **{name: parts[f"{name}_{side}"] for name in ("upper_arm", "lower_arm", "wrist", "coupling")}
        ).reba
        for side in SIDES
    }
    total: NDArray[np.int64] = totals[sides] if sides in totals else np.maximum(totals["left"], totals["right"])
    return total
