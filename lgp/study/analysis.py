"""The tests of a study on one row per participant and condition.

Decided by one measure, the mean REBA; the parts explain it and are corrected together after Holm (1979), every pair of
conditions of every part; durations and shares of time are described with intervals and not tested. A participant who
lacks a condition is left out of the comparisons with it, and of the ANOVA.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from lgp.statistics.effect_sizes import effect_size, friedman, normality, sphericity, within_errors
from lgp.statistics.paired_tests import Comparison, anova, compare, holm, mean_of, require_statsmodels
from lgp.study.scoring import EXTRA, LEVELS, PARTS, TOTAL, by_condition

if TYPE_CHECKING:
    import pandas as pd


def analyse(cells: pd.DataFrame, conditions: Sequence[str]) -> dict[str, Any]:
    """Return means, tests, effect sizes and assumptions of every measure, as plain data.

    Args:
        cells: one row per participant and condition, as `lgp.study.scoring.cells` returns.
        conditions: their order; differences are earlier minus later.

    Raises:
        LgpError: statsmodels is not installed.
    """
    require_statsmodels()
    pairs = list(combinations(conditions, 2))
    tables = {name: by_condition(cells, name, conditions) for name in (TOTAL, *PARTS, *EXTRA, *LEVELS)}
    found: dict[str, Any] = {TOTAL: measure(tables[TOTAL], pairs)}
    _correct(found[TOTAL]["pairs"])
    found["parts"] = {name: measure(tables[name], pairs) for name in PARTS}
    for one in found["parts"].values():
        one["constant"] = all(pair["ties"] == pair["n"] for pair in one["pairs"])
    _correct([pair for one in found["parts"].values() if not one["constant"] for pair in one["pairs"]])
    found["described"] = {name: measure(tables[name], pairs, tested=False) for name in EXTRA}
    found["levels"] = {name: means(tables[name]) for name in LEVELS}
    return found


def measure(table: pd.DataFrame, pairs: Sequence[tuple[str, str]], *, tested: bool = True) -> dict[str, Any]:
    """Return everything about one measure.

    Args:
        table: participants x conditions, NaN where there is no recording.
        pairs: conditions to compare.
        tested: whether p values are given beside the intervals; they are not corrected here.
    """
    compared = [compare(table, [pair])[0] for pair in pairs]
    found: dict[str, Any] = {
        "conditions": means(table),
        "participants": {str(name): dict(zip(table.columns, row, strict=True)) for name, row in _rows(table)},
        "pairs": [_pair(table, one, tested) for one in compared],
    }
    if tested:
        complete = table.dropna().to_numpy(np.float64)
        enough = len(table.columns) > 1
        ball, ranks = sphericity(complete), friedman(complete)
        found["anova"] = asdict(anova(table)) if enough else None
        found["sphericity"] = None if ball is None else asdict(ball)
        found["friedman"] = None if ranks is None else asdict(ranks)
    return found


def means(table: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Return mean, standard deviation, and both standard errors per condition.

    `se` is between people, over all who have the condition; `se_within` within people, over those who have all.
    """
    complete = table.dropna().to_numpy(np.float64)
    within = within_errors(complete)
    return {
        str(name): {**asdict(mean_of(table[name])), "se_within": float(error), "n_within": len(complete)}
        for name, error in zip(table.columns, within, strict=True)
    }


def _rows(table: pd.DataFrame) -> list[tuple[Any, list[float]]]:
    return list(zip(table.index, table.to_numpy(np.float64).tolist(), strict=True))


def _pair(table: pd.DataFrame, one: Comparison, tested: bool) -> dict[str, Any]:
    """Return a comparison with its effect size, the normality of its differences, and who is not in it."""
    gap = table[one.first] - table[one.second]
    known = gap.dropna().to_numpy(np.float64)
    found = {name: value for name, value in asdict(one).items() if name != "d"}
    found |= {"p_holm": float("nan"), "wilcoxon_p_holm": float("nan")}
    if not tested:
        dropped = ("t", "p", "p_holm", "wilcoxon_p", "wilcoxon_p_holm")
        found = {name: value for name, value in found.items() if name not in dropped}
    else:
        found |= {**asdict(effect_size(known)), "normality": asdict(normality(known))}
    lower, higher = int((known < 0).sum()), int((known > 0).sum())
    return found | {"lower": lower, "higher": higher, "left_out": [str(name) for name in gap.index[gap.isna()]]}


def _correct(family: Sequence[dict[str, Any]]) -> None:
    """Correct the p values of pairs that are decided together."""
    for name in ("p", "wilcoxon_p"):
        for pair, corrected in zip(family, holm([pair[name] for pair in family]), strict=True):
            pair[f"{name}_holm"] = corrected
