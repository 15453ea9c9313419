"""What a part of the body or a factor contributes: the recording scored again with that part at its lowest score."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.method.scoring import SCORE_COLUMNS, score_parts
from reba.posture.columns import SIDES

PARTS: Final = SCORE_COLUMNS[: SCORE_COLUMNS.index("score_a")]
"""Columns of part scores."""
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
"""Parts whose contribution to the total is computed, both sides together -> their titles."""
Scores64 = NDArray[np.int64]


@dataclass(frozen=True)
class Lowered:
    """REBA of the occurring combinations of part scores with one part at its lowest score.

    Attributes:
        group: name in `GROUPS`.
        before, after: REBA of each combination.
        weights: time of each combination [s].
    """

    group: str
    before: Scores64
    after: Scores64
    weights: Array


def lowered(scores: Any, weights: Array, sides: str) -> Iterator[Lowered]:
    """Give REBA with each part in turn at its lowest score, for every occurring combination of part scores.

    Args:
        scores: column of a part score -> (n,) scores, known in every frame.
        weights: (n,) [s].
        sides: the arm that gives the total, as in `Rules.two_sides`.
    """
    combinations, times = _combinations(scores, weights)
    before = _totals(combinations, sides)
    for group in GROUPS:
        lowest = 0 if group in ("load_force", "coupling", "activity") else 1
        changed = {name: np.full_like(v, lowest) if name.startswith(group) else v for name, v in combinations.items()}
        yield Lowered(group, before, _totals(changed, sides), times)


def _combinations(scores: Any, weights: Array) -> tuple[dict[str, Scores64], Array]:
    """Return the occurring combinations of part scores and the time of each [s]."""
    key = np.zeros(len(weights), np.int64)
    for name in PARTS:
        key = key * 8 + scores[name]
    _, first, combination = np.unique(key, return_index=True, return_inverse=True)
    occurring = {name: np.asarray(scores[name])[first].astype(np.int64) for name in PARTS}
    return occurring, np.bincount(combination, weights).astype(np.float64)


def _totals(parts: Mapping[str, Scores64], sides: str) -> Scores64:
    shared = {name: parts[name] for name in ("trunk", "neck", "legs", "load_force", "activity")}
    totals = {
        side: score_parts(
            **shared, **{name: parts[f"{name}_{side}"] for name in ("upper_arm", "lower_arm", "wrist", "coupling")}
        ).reba
        for side in SIDES
    }
    total: Scores64 = totals[sides] if sides in totals else np.maximum(totals["left"], totals["right"])
    return total
