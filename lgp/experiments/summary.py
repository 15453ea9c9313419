"""`summary.json` of the screwdriver experiment: the paper's tables and tests, ours beside theirs, as plain data.

Every test says its n, statistic, exact p and effect size. Shares of tables are of feasible runs.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from lgp.experiments import published
from lgp.experiments.runs import CONDITIONS, STARTS, TABLES, check_paths, check_runs, pivot
from lgp.statistics.paired_tests import anova, change, compare, mean_of, require
from reba.files import plain_data, write_atomic, write_text

if TYPE_CHECKING:
    import pandas as pd

FORMAT: Final = "lgp-experiment"
VERSION: Final = 1
PAIRS: Final = tuple(combinations(CONDITIONS, 2))
"""Comparisons after an ANOVA."""
PLAIN, ERGONOMIC = "non-ergonomic", "ergonomic"


def summarise(
    runs: pd.DataFrame,
    paths: pd.DataFrame,
    settings: Mapping[str, Any] | None = None,
    sensitivity: pd.DataFrame | None = None,
) -> dict[str, Any]:
    """Return the summary as plain data; NaN is None.

    Args:
        runs: with `lgp.experiments.runs.RUN_COLUMNS`, of one start or both.
        paths: with `PATH_COLUMNS`.
        settings: how the runs were made, kept as they are.
        sensitivity: as `lgp.experiments.sensitivity.sensitivity` returns it, kept as it is.

    Raises:
        LgpError: a table is not as `check_runs` and `check_paths` expect, or statsmodels is not installed.
    """
    require()
    runs, paths = check_runs(runs), check_paths(paths)
    starts = [start for start in STARTS if (runs["initial"] == start).any()]
    found: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "experiment": "screwdriver",
        "published": published.SOURCE,
        "settings": dict(settings or {}),
        "starts": {start: _start(runs, paths, start) for start in starts},
        "between_starts": _between(runs) if len(starts) == len(STARTS) else None,
        "sensitivity": None if sensitivity is None else sensitivity.to_dict("records"),
    }
    plain: dict[str, Any] = plain_data(found)
    return plain


def write_summary(path: str | Path, summary: Mapping[str, Any]) -> None:
    """Write a summary as JSON.

    Raises:
        RebaError: the file cannot be written.
    """
    text = json.dumps(summary, indent=1, allow_nan=False) + "\n"
    write_atomic(Path(path), lambda part: write_text(part, text))


def _start(runs: pd.DataFrame, paths: pd.DataFrame, start: str) -> dict[str, Any]:
    """Return everything about the runs with one start."""
    here = runs[runs["initial"] == start]
    heights = here.drop_duplicates("run")[[f"height_{table}" for table in TABLES]].to_numpy()
    tables = pivot(runs, "table", start)
    tables = tables.where(tables.isin(TABLES))
    scores = {column: pivot(runs, column, start) for column in ("reba_grasp", "reba_mean", "chosen_height")}
    return {
        "runs": int(here["run"].nunique()),
        "infeasible": _infeasible(here),
        "drawn_height": {**asdict(mean_of(heights.ravel())), "published": _pair(published.DRAWN_HEIGHT)},
        "table_choice": {condition: _choice(here, start, condition) for condition in CONDITIONS},
        "table_change": asdict(change(tables[PLAIN], tables[ERGONOMIC], TABLES)),
        "chosen_height": _heights(scores["chosen_height"], start),
        "reba_grasp": _scores(scores["reba_grasp"]),
        "reba_mean": _scores(scores["reba_mean"]),
        "reba_phases": _phases(paths[paths["initial"] == start]),
        "seconds": {name: asdict(mean_of(rows["seconds"])) for name, rows in here.groupby("condition")},
    }


def _infeasible(runs: pd.DataFrame) -> dict[str, Any]:
    """Return per condition how many runs have no plan, and which with why."""
    found = {}
    for condition in CONDITIONS:
        here = runs[runs["condition"] == condition]
        failed = here[~here["feasible"]]
        reasons = [
            {"run": int(run), "reason": str(reason)}
            for run, reason in zip(failed["run"], failed["reason"], strict=True)
        ]
        found[condition] = {"n": len(failed), "of": len(here), "runs": reasons}
    return found


def _choice(runs: pd.DataFrame, start: str, condition: str) -> dict[str, Any]:
    """Return how often each table was chosen, with Wilson's 95 % interval, beside the paper."""
    from scipy.stats import binomtest

    chosen = runs[(runs["condition"] == condition) & runs["feasible"]]["table"]
    n = len(chosen)
    counts = {table: int((chosen == table).sum()) for table in TABLES}
    theirs = published.CHOICE_PERCENT[start].get(condition)
    intervals = {
        table: [100 * end for end in binomtest(count, n).proportion_ci(method="wilson")] if n else [None, None]
        for table, count in counts.items()
    }
    return {
        "n": n,
        "counts": counts,
        "percent": {table: 100 * count / n if n else None for table, count in counts.items()},
        "interval": intervals,
        "published": theirs,
        "against_published": _against(counts, theirs) if n and theirs else None,
    }


def _against(ours: Mapping[str, int], theirs: Mapping[str, int]) -> dict[str, Any]:
    """Return the chi-square test that our choices and the paper's (in percent of 100 runs) have the same shares."""
    from scipy.stats import chi2_contingency

    counts = np.array([[side[table] for table in TABLES] for side in (ours, theirs)])
    used = counts[:, counts.sum(axis=0) > 0]
    result: Any = chi2_contingency(used, correction=False)
    smallest = min(used.shape) - 1
    cramer = math.sqrt(float(result.statistic) / (used.sum() * smallest)) if smallest else 0.0
    return {"test": "chi-square of homogeneity", "n": counts.sum(axis=1).tolist(), "statistic": float(result.statistic),
            "df": int(result.dof), "p": float(result.pvalue), "cramer_v": cramer}  # fmt: skip


def _heights(table: pd.DataFrame, start: str) -> dict[str, Any]:
    theirs = published.CHOSEN_HEIGHT[start]
    means = {name: {**asdict(mean_of(table[name])), "published": _pair(theirs.get(name))} for name in CONDITIONS}
    return {"conditions": means, "pairs": [asdict(one) for one in compare(table, [(PLAIN, ERGONOMIC)])]}


def _scores(table: pd.DataFrame) -> dict[str, Any]:
    means = {name: mean_of(table[name]) for name in CONDITIONS}
    order = sorted((name for name in CONDITIONS if means[name].n), key=lambda name: means[name].mean)
    return {
        "conditions": {name: asdict(mean) for name, mean in means.items()},
        "order": order,
        "published_order": list(published.EXPECTED_ORDER),
        "anova": asdict(anova(table)),
        "pairs": [asdict(one) for one in compare(table, PAIRS)],
    }


def _phases(paths: pd.DataFrame) -> dict[str, list[dict[str, Any]]]:
    """Return per condition and phase the mean over runs of the mean score in that phase."""
    per_run = paths.groupby(["condition", "phase", "run"])["reba"].mean()
    return {
        condition: [
            {"phase": phase, **asdict(mean_of(values))}
            for phase, values in per_run.loc[[condition]].groupby(level="phase")
        ]
        for condition in CONDITIONS
        if condition in per_run.index.get_level_values("condition")
    }


def _between(runs: pd.DataFrame) -> dict[str, Any]:
    """Return what the random start does to the score at the grasp, per condition on the same heights."""
    rest, moved = (pivot(runs, "reba_grasp", start).add_suffix(f", {start}") for start in STARTS)
    both = rest.join(moved, how="outer")
    pairs = [(f"{condition}, random", f"{condition}, rest") for condition in CONDITIONS]
    found = [asdict(one) for one in compare(both, pairs)]
    return {"reba_grasp": dict(zip(CONDITIONS, found, strict=True))}


def _pair(value: tuple[float, float] | None) -> dict[str, float] | None:
    return None if value is None else {"mean": value[0], "sd": value[1]}


ALPHA: Final = 0.05
"""Corrected p below which a difference counts."""


@dataclass(frozen=True)
class Finding:
    """A finding of the paper.

    Attributes:
        claim: what the paper found.
        shown: whether these runs show it; None where they cannot say.
        because: the numbers.
    """

    claim: str
    shown: bool | None
    because: str


def findings(summary: Mapping[str, Any]) -> list[Finding]:
    """Return the findings of the paper against a summary."""
    found = []
    for start, here in summary["starts"].items():
        found += [
            _order(start, here["reba_grasp"]),
            _choice_findings(start, here),
            _height(start, here["chosen_height"]),
        ]
    if summary["between_starts"] is not None:
        found.append(_random(summary["between_starts"]["reba_grasp"]))
    return found


def _order(start: str, scores: Mapping[str, Any]) -> Finding:
    """The three means in the paper's order, and every step significant."""
    order = " < ".join(published.EXPECTED_ORDER)
    steps = {frozenset((pair["first"], pair["second"])): pair for pair in scores["pairs"]}
    said: list[str] = []
    shown: list[bool | None] = []
    for low, high in zip(published.EXPECTED_ORDER, published.EXPECTED_ORDER[1:], strict=False):
        pair = steps[frozenset((low, high))]
        if pair["p_holm"] is None or pair["difference"] is None:
            shown.append(None)
            said.append(f"{high} against {low}: no test (n = {pair['n']})")
            continue
        difference = pair["difference"] * (1 if pair["first"] == high else -1)
        shown.append(difference > 0 and pair["p_holm"] < ALPHA)
        said.append(f"{high} minus {low} {difference:+.2f} (p = {pair['p_holm']:.2g}, n = {pair['n']})")
    return Finding(f"{start} start: REBA at the grasp {order}", _all(shown), "; ".join(said) + ", t tests after Holm")


def _choice_findings(start: str, here: Mapping[str, Any]) -> Finding:
    """Fewer choose the left table with the ergonomic cost, and more the one in the centre."""
    change, percent = here["table_change"], {name: part["percent"] for name, part in here["table_choice"].items()}
    claim = f"{start} start: with the ergonomic cost the choice moves from the left table to the centre"
    plain, ergonomic = percent["non-ergonomic"], percent["ergonomic"]
    if change["p"] is None or not change["n"]:
        return Finding(claim, None, f"no test (n = {change['n']})")
    moved = plain["left"] > ergonomic["left"] and plain["center"] < ergonomic["center"]
    said = ", ".join(f"{table} {plain[table]:.0f} to {ergonomic[table]:.0f} %" for table in ("left", "center", "right"))
    test = f"Stuart-Maxwell {change['statistic']:.1f}, df {change['df']}, p = {change['p']:.2g}, n = {change['n']}"
    return Finding(claim, moved and change["p"] < ALPHA, f"{said} ({test})")


def _height(start: str, heights: Mapping[str, Any]) -> Finding:
    """The chosen table is lower with the ergonomic cost."""
    pair = heights["pairs"][0]
    claim = f"{start} start: with the ergonomic cost the chosen table is lower"
    if pair["p_holm"] is None:
        return Finding(claim, None, f"no test (n = {pair['n']})")
    said = f"non-ergonomic minus ergonomic {pair['difference']:+.2f} m (p = {pair['p_holm']:.2g}, n = {pair['n']})"
    return Finding(claim, pair["difference"] > 0 and pair["p_holm"] < ALPHA, said)


def _random(pairs: Mapping[str, Any]) -> Finding:
    """The random start raises the score of the non-ergonomic condition, and of no other one."""
    claim = "A random start raises the score at the grasp of the non-ergonomic condition only"
    said: list[str] = []
    shown: list[bool | None] = []
    for condition, pair in pairs.items():
        if pair["p_holm"] is None or pair["difference"] is None:
            shown.append(None)
            said.append(f"{condition} no test (n = {pair['n']})")
            continue
        raised = pair["difference"] > 0 and pair["p_holm"] < ALPHA
        shown.append(raised == (condition == "non-ergonomic"))
        interval = "" if pair["low"] is None else f", 95 % {pair['low']:+.2f} to {pair['high']:+.2f}"
        said.append(f"{condition} {pair['difference']:+.2f} (p = {pair['p_holm']:.2g}{interval}, n = {pair['n']})")
    return Finding(claim, _all(shown), "; ".join(said) + ", random minus rest")


def _all(shown: list[bool | None]) -> bool | None:
    return False if False in shown else None if None in shown else True
