"""Statistical analysis of a study on one row per participant and condition.

The primary measure is the mean REBA score. The part scores explain it; their p values, of every pair of conditions and
every part, are corrected together after Holm (1979). Durations and shares of time have intervals and are not tested. A
participant without a condition is left out of its comparisons and of the ANOVA.
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
    """Means, tests, effect sizes and tests of assumptions of every measure, as plain data.

    Differences are earlier minus later in `conditions`; `cells` has one row per participant and condition.

    Raises:
        LgpError: statsmodels is not installed.
    """
    require_statsmodels()
    pairs = list(combinations(conditions, 2))
    tables = {name: by_condition(cells, name, conditions) for name in (TOTAL, *PARTS, *EXTRA, *LEVELS)}
    results: dict[str, Any] = {TOTAL: measure(tables[TOTAL], pairs)}
    _correct(results[TOTAL]["pairs"])
    results["parts"] = {name: measure(tables[name], pairs) for name in PARTS}
    for part in results["parts"].values():
        part["constant"] = all(pair["ties"] == pair["n"] for pair in part["pairs"])
    _correct([pair for part in results["parts"].values() if not part["constant"] for pair in part["pairs"]])
    results["described"] = {name: measure(tables[name], pairs, tested=False) for name in EXTRA}
    results["levels"] = {name: means(tables[name]) for name in LEVELS}
    return results


def measure(table: pd.DataFrame, pairs: Sequence[tuple[str, str]], *, tested: bool = True) -> dict[str, Any]:
    """Means, values by participant, comparisons and, if tested, ANOVA and assumptions of one measure.

    `table` is participants x conditions, NaN without a recording; p values, only if `tested`, are not corrected here.
    """
    comparisons = [compare(table, [pair])[0] for pair in pairs]
    results: dict[str, Any] = {
        "conditions": means(table),
        "participants": {str(name): dict(zip(table.columns, row, strict=True)) for name, row in _rows(table)},
        "pairs": [_pair(table, one, tested) for one in comparisons],
    }
    if tested:
        complete = table.dropna().to_numpy(np.float64)
        mauchly, ranks = sphericity(complete), friedman(complete)
        results["anova"] = asdict(anova(table)) if len(table.columns) > 1 else None
        results["sphericity"] = None if mauchly is None else asdict(mauchly)
        results["friedman"] = None if ranks is None else asdict(ranks)
    return results


def means(table: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Mean, standard deviation and both standard errors per condition.

    `se` is between participants, over all with the condition; `se_within` within participants, over the complete ones.
    """
    complete = table.dropna().to_numpy(np.float64)
    within = within_errors(complete)
    return {
        str(name): {**asdict(mean_of(table[name])), "se_within": float(error), "n_within": len(complete)}
        for name, error in zip(table.columns, within, strict=True)
    }


def _rows(table: pd.DataFrame) -> list[tuple[Any, list[float]]]:
    return list(zip(table.index, table.to_numpy(np.float64).tolist(), strict=True))


def _pair(table: pd.DataFrame, comparison: Comparison, tested: bool) -> dict[str, Any]:
    """Comparison with its effect size, the normality of its differences, and the participants left out."""
    difference = table[comparison.first] - table[comparison.second]
    finite = difference.dropna().to_numpy(np.float64)
    pair = {name: value for name, value in asdict(comparison).items() if name != "d"}
    pair |= {"p_holm": float("nan"), "wilcoxon_p_holm": float("nan")}
    if not tested:
        dropped = ("t", "p", "p_holm", "wilcoxon_p", "wilcoxon_p_holm")
        pair = {name: value for name, value in pair.items() if name not in dropped}
    else:
        pair |= {**asdict(effect_size(finite)), "normality": asdict(normality(finite))}
    lower, higher = int((finite < 0).sum()), int((finite > 0).sum())
    left_out = [str(name) for name in difference.index[difference.isna()]]
    return pair | {"lower": lower, "higher": higher, "left_out": left_out}


def _correct(family: Sequence[dict[str, Any]]) -> None:
    """Correct the p values of a family of pairs after Holm, in place."""
    for name in ("p", "wilcoxon_p"):
        for pair, corrected in zip(family, holm([pair[name] for pair in family]), strict=True):
            pair[f"{name}_holm"] = corrected
