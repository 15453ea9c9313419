"""Time per action level under other assumptions, computed beforehand for every combination that the page offers.

The page itself holds no rule of REBA: it looks a combination up in a table.
"""

from __future__ import annotations

import base64
import dataclasses
import itertools
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from reba.analysis.changes import interval_text, seen_angles
from reba.analysis.score_table import ScoreTable
from reba.arrays import Array
from reba.method.classes import angle_classes
from reba.method.scoring import ScoreArrays, score_angles
from reba.method.tables import LEVEL_OF, TABLE_A, TABLE_B, TABLE_C
from reba.posture.columns import INDEX, SIDES
from reba.posture.factors import COUPLINGS

AS_RECORDED: Final = "as recorded"
LOADS: Final = {"under 5 kg": 2.5, "5 to 10 kg": 7.5, "over 10 kg": 12.5}
"""Class of the load -> a load in it [kg]."""
SUPPORTS: Final = {"both legs": "bilateral", "one leg": "unilateral", "sitting": "sitting"}
LEVELS: Final = 5
"""Action levels; after them stand the time that is not determined, and both ends of that at high risk or above."""
HIGH: Final = 3
"""Action level of high risk."""
SHARE_ONE: Final = 4_000_000_000
"""A share of 1 in the packed table: fine enough that the page rounds seconds and shares as the report does."""


@dataclass(frozen=True)
class WhatIf:
    """The table of all combinations.

    Attributes:
        settings: name of an assumption -> its values in words, the first of which is `AS_RECORDED`.
        shares: (combinations, 8) share of time at action levels 0 to 4, not determined, and the lowest and the highest
            share at high risk or above; the last setting varies fastest.
    """

    settings: dict[str, tuple[str, ...]]
    shares: Array

    def packed(self) -> dict[str, Any]:
        """Return the table for the page: shares as 32-bit integers, of which `SHARE_ONE` is 1."""
        values = np.round(self.shares * SHARE_ONE).astype("<u4")
        return {
            "settings": [[name, list(values)] for name, values in self.settings.items()],
            "one": SHARE_ONE,
            "shares": base64.b64encode(values.tobytes()).decode(),
        }


def what_if(scores: ScoreTable, weights: Array) -> WhatIf:
    """Return the time per action level under every combination of limits, load, grip and support.

    Angles beyond a limit are moved to it; what was not measured stays so, and activity as recorded.
    """
    rows = np.arange(len(scores.data))
    angles = seen_angles(scores, rows).T
    classes = {one.name: one for one in angle_classes(scores.rules)}
    # A trunk that is always upright cannot be asked for.
    trunk = [(one.low, one.high) for one in reversed(classes["trunk flexion"].classes[1:-1])]
    arms = [(one.low, one.high) for one in reversed(classes["left upper arm flexion"].classes[:-1])]
    arm_columns = [INDEX[f"upper_arm_flexion_{side}"] for side in SIDES]
    trunk = trunk if not np.isnan(angles[:, INDEX["trunk_flexion"]]).all() else []
    arms = arms if not np.isnan(angles[:, arm_columns]).all() else []
    settings = {
        "Trunk": (AS_RECORDED, *(interval_text(*limits) for limits in trunk)),
        "Upper arms": (AS_RECORDED, *(interval_text(*limits) for limits in arms)),
        "Load": (AS_RECORDED, *LOADS),
        "Grip": (AS_RECORDED, *COUPLINGS),
        "Support": (AS_RECORDED, *SUPPORTS),
    }
    rules = scores.rules.replace(upper_arm_reference="trunk")
    scored: list[tuple[ScoreArrays, ScoreArrays]] = []
    # Each part depends on its own assumption alone: one run serves the same place in all lists.
    for place in range(max(len(values) for values in settings.values())):
        changed, factors = angles.copy(), scores.factors
        if 0 < place <= len(trunk):
            changed[:, INDEX["trunk_flexion"]] = np.clip(angles[:, INDEX["trunk_flexion"]], *trunk[place - 1])
        if 0 < place <= len(arms):
            changed[:, arm_columns] = np.clip(angles[:, arm_columns], *arms[place - 1])
        if place:
            grip = COUPLINGS[min(place, len(COUPLINGS)) - 1]
            factors = dataclasses.replace(
                factors,
                load=list(LOADS.values())[min(place, len(LOADS)) - 1],
                coupling_left=grip,
                coupling_right=grip,
                support=list(SUPPORTS.values())[min(place, len(SUPPORTS)) - 1],
            )
        low = score_angles(changed, factors, rules, "neutral")
        scored.append((low, score_angles(changed, factors, rules, "worst") if np.isnan(angles).any() else low))
    return WhatIf(settings, _shares(scored, settings, weights, scores.rules.two_sides))


_OWN: Final = {"trunk": "Trunk", "upper_arm": "Upper arms", "load_force": "Load", "coupling": "Grip", "legs": "Support"}
"""Part score -> the assumption that it depends on."""
_FIXED: Final = ("neck", "activity", *(f"{part}_{side}" for part in ("lower_arm", "wrist") for side in SIDES))
Ends = dict[tuple[str, int], NDArray[np.int64]]
"""Part score and place of its setting -> (2, combinations) scores at both ends of the range."""


def _shares(
    scored: list[tuple[ScoreArrays, ScoreArrays]], settings: dict[str, tuple[str, ...]], weights: Array, sides: str
) -> Array:
    parts, times = _combinations(scored, settings, weights)
    sided = SIDES if sides == "worse" else (sides,)
    trunk, arms, loads, grips, supports = (range(len(values)) for values in settings.values())
    score_a = {
        (t, f, s): TABLE_A[parts["trunk", t] - 1, parts["neck", 0] - 1, parts["legs", s] - 1] + parts["load_force", f]
        for t, f, s in itertools.product(trunk, loads, supports)
    }
    score_b = {
        (a, g): np.maximum.reduce([
            TABLE_B[parts[f"upper_arm_{side}", a] - 1, parts[f"lower_arm_{side}", 0] - 1, parts[f"wrist_{side}", 0] - 1]
            + parts[f"coupling_{side}", g]
            for side in sided
        ])
        for a, g in itertools.product(arms, grips)
    }  # fmt: skip
    total = times.sum() or 1.0
    rows = []
    for t, a, f, g, s in itertools.product(trunk, arms, loads, grips, supports):
        low, high = LEVEL_OF[TABLE_C[score_a[t, f, s] - 1, score_b[a, g] - 1] + parts["activity", 0]]
        levels = np.bincount(np.where(low == high, low, LEVELS), times, minlength=LEVELS + 1)
        rows.append(np.append(levels, [times[end >= HIGH].sum() for end in (low, high)]) / total)
    return np.array(rows)


def _combinations(
    scored: list[tuple[ScoreArrays, ScoreArrays]], settings: dict[str, tuple[str, ...]], weights: Array
) -> tuple[Ends, Array]:
    """Return the occurring combinations of the part scores under all settings, and the time of each [s]."""
    names = [(name, 0) for name in _FIXED]
    for part, setting in _OWN.items():
        sided = [part] if part in ("trunk", "load_force", "legs") else [f"{part}_{side}" for side in SIDES]
        names += [(name, place) for name in sided for place in range(len(settings[setting]))]
    values = {(name, place): np.stack([end[name] for end in scored[place]]) for name, place in names}
    key, size = np.zeros(len(weights), np.int64), 1
    for both in values.values():
        for end in both:
            if size > 2**55:
                key, size = np.unique(key, return_inverse=True)[1], len(weights) + 1
            key = key * 8 + end
            size *= 8
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    times = np.bincount(inverse, weights).astype(np.float64)
    return {name: both[:, first].astype(np.int64) for name, both in values.items()}, times
