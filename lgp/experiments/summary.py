"""Summary of the screwdriver experiment: tables and tests of the paper and of these runs side by side, as plain data.

Every test has its n, p and effect size, every difference its interval. Shares of tables refer to feasible runs.
`lgp.experiments.findings` decides which claims of the paper these runs support.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from lgp.experiments import published
from lgp.experiments.runs import CONDITIONS, STARTS, TABLES, check_paths, check_runs, pivot
from lgp.files import SUMMARY
from lgp.statistics.effect_sizes import friedman
from lgp.statistics.paired_tests import (
    ChoiceTest,
    Mean,
    anova,
    compare,
    compare_choices,
    mean_of,
    require_statsmodels,
    welch_difference,
)
from lgp.statistics.shares import exact_homogeneity, independent_difference, paired_difference
from reba.files import from_json, plain_data, write_atomic, write_text
from reba.open_file import read_settings
from reba.provenance import MEMBER, other_version, with_provenance

if TYPE_CHECKING:
    import pandas as pd

FORMAT: Final = "lgp-experiment"
VERSION: Final = 1
PAIRS: Final = tuple(combinations(CONDITIONS, 2))
"""Post-hoc comparisons after an ANOVA."""
NON_ERGONOMIC, ERGONOMIC = "non-ergonomic", "ergonomic"


def summarise(
    runs: pd.DataFrame,
    paths: pd.DataFrame,
    settings: Mapping[str, Any] | None = None,
    sensitivity: Sequence[Mapping[str, Any]] | None = None,
    family: Mapping[str, Any] | None = None,
    fronts: Sequence[Mapping[str, Any]] | None = None,
) -> dict[str, Any]:
    """Summary as plain data, with None for NaN.

    Args:
        runs: of one initial posture or both.
        sensitivity: rows of `lgp.experiments.sensitivity.sensitivity_table`, copied.
        family: from `lgp.experiments.family_runs.family_summary`, copied.
        fronts: from `lgp.experiments.pareto.pareto_fronts`, copied.

    Raises:
        LgpError: `check_runs` or `check_paths` refuses a table, or statsmodels is not installed.
    """
    require_statsmodels()
    runs, paths = check_runs(runs), check_paths(paths)
    starts = [start for start in STARTS if (runs["initial"] == start).any()]
    summary: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "experiment": "screwdriver",
        "published": published.SOURCE,
        "settings": dict(settings or {}),
        "starts": {start: _start(runs, paths, start) for start in starts},
        "between_starts": _between(runs) if len(starts) == len(STARTS) else None,
        "sensitivity": sensitivity,
        "family": family,
        "pareto": fronts,
    }
    plain: dict[str, Any] = plain_data(with_provenance(summary))
    return plain


def write_summary(path: str | Path, summary: Mapping[str, Any]) -> None:
    """Write a summary as JSON."""
    text = json.dumps(summary, indent=1, allow_nan=False) + "\n"
    write_atomic(Path(path), lambda part: write_text(part, text))


def finished_summary(folder: str | Path, settings: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the summary in a folder, None where there is none of these settings and this version."""
    file = Path(folder) / SUMMARY
    try:
        stored = from_json(read_settings(file)) if file.exists() else None
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(stored, dict) or stored.get("settings") != plain_data(dict(settings)):
        return None
    return None if other_version(stored.get(MEMBER)) else stored


def _start(runs: pd.DataFrame, paths: pd.DataFrame, start: str) -> dict[str, Any]:
    """Results of the runs from one initial posture."""
    selected = runs[runs["initial"] == start]
    heights = selected.drop_duplicates("run")[[f"height_{table}" for table in TABLES]].to_numpy()
    tables = pivot(runs, "table", start)
    tables = tables.where(tables.isin(TABLES))
    scores = {column: pivot(runs, column, start) for column in ("reba_grasp", "reba_mean", "chosen_height")}
    return {
        "runs": int(selected["run"].nunique()),
        "infeasible": _infeasible(selected),
        "audit": {name: _faults(selected[selected["condition"] == name]) for name in CONDITIONS},
        "drawn_height": {**asdict(mean_of(heights.ravel())), "published": _mean_sd(published.DRAWN_HEIGHT)},
        "table_choice": {condition: _choice(selected, start, condition) for condition in CONDITIONS},
        "table_change": _changes(compare_choices(tables[NON_ERGONOMIC], tables[ERGONOMIC], TABLES)),
        "chosen_height": _heights(scores["chosen_height"], start),
        "reba_grasp": _scores(scores["reba_grasp"]),
        "reba_mean": _scores(scores["reba_mean"]),
        "reba_phases": _phases(paths[paths["initial"] == start]),
        "persons_share": _persons_share(selected),
        "seconds": {name: asdict(mean_of(rows["seconds"])) for name, rows in selected.groupby("condition")},
    }


def _infeasible(runs: pd.DataFrame) -> dict[str, Any]:
    """Infeasible runs per condition: their count, numbers and reasons."""
    infeasible = {}
    for condition in CONDITIONS:
        selected = runs[runs["condition"] == condition]
        failed = selected[~selected["feasible"]]
        reasons = [
            {"run": int(run), "reason": str(reason)}
            for run, reason in zip(failed["run"], failed["reason"], strict=True)
        ]
        infeasible[condition] = {"n": len(failed), "of": len(selected), "runs": reasons}
    return infeasible


def _faults(runs: pd.DataFrame) -> dict[str, int]:
    """Number of plans, of those with a fault that their audit found, and of faults."""
    feasible = runs[runs["feasible"]]
    with_fault = feasible["faults"] > 0
    return {"plans": len(feasible), "with_fault": int(with_fault.sum()), "faults": int(feasible["faults"].sum())}


def _choice(runs: pd.DataFrame, start: str, condition: str) -> dict[str, Any]:
    """Counts and shares of each chosen table [%] with Wilson's 95 % interval, and those of the paper."""
    from scipy.stats import binomtest

    chosen = runs[(runs["condition"] == condition) & runs["feasible"]]["table"]
    n = len(chosen)
    counts = {table: int((chosen == table).sum()) for table in TABLES}
    reference = published.CHOICE_PERCENT[start].get(condition)
    intervals = {
        table: [100 * end for end in binomtest(count, n).proportion_ci(method="wilson")] if n else [None, None]
        for table, count in counts.items()
    }
    return {
        "n": n,
        "counts": counts,
        "percent": {table: 100 * count / n if n else None for table, count in counts.items()},
        "interval": intervals,
        "published": reference,
        "against_published": _against_published(counts, reference) if n and reference else None,
    }


def _against_published(counts: Mapping[str, int], reference: Mapping[str, int]) -> dict[str, Any]:
    """Exact test of our counts against those of the paper (percent of 100 runs, so counts), and each difference."""
    test = exact_homogeneity(*([source[table] for table in TABLES] for source in (counts, reference)))
    shares = {
        table: asdict(independent_difference(counts[table], test.n[0], reference[table], test.n[1])) for table in TABLES
    }
    tested = {"test": "Fisher-Freeman-Halton", "n": list(test.n), "p": test.p, "cramer_v": test.cramer_v}
    return {**tested, "shares": shares}


def _changes(change: ChoiceTest) -> dict[str, Any]:
    """The test of changed choices, and the change of each table's share with its interval."""
    shares = {
        table: asdict(paired_difference(int(row["left"]), int(row["came"]), change.n))
        for table, row in change.by_choice.items()
    }
    return {**asdict(change), "shares": shares}


def _heights(table: pd.DataFrame, start: str) -> dict[str, Any]:
    reference = published.CHOSEN_HEIGHT[start]
    means = {}
    for name in CONDITIONS:
        mean, theirs = mean_of(table[name]), reference.get(name)
        means[name] = {
            **asdict(mean),
            "published": _mean_sd(theirs),
            "against_published": None if theirs is None else asdict(welch_difference(mean, _of_paper(*theirs))),
        }
    return {"conditions": means, "pairs": [asdict(one) for one in compare(table, [(NON_ERGONOMIC, ERGONOMIC)])]}


def _scores(table: pd.DataFrame) -> dict[str, Any]:
    means = {name: mean_of(table[name]) for name in CONDITIONS}
    order = sorted((name for name in CONDITIONS if means[name].n), key=lambda name: means[name].mean)
    return {
        "conditions": {name: asdict(mean) for name, mean in means.items()},
        "order": order,
        "published_order": list(published.EXPECTED_ORDER),
        "anova": asdict(anova(table)),
        "friedman": asdict(test) if (test := friedman(table.dropna().to_numpy(dtype=float))) else None,
        "pairs": [asdict(one) for one in compare(table, PAIRS)],
    }


def _persons_share(runs: pd.DataFrame) -> dict[str, Any]:
    """Share of the person in the squared accelerations of non-ergonomic plans [%]."""
    plain = runs[(runs["condition"] == NON_ERGONOMIC) & runs["feasible"]]
    return asdict(mean_of(100.0 * plain["human_effort"] / (plain["human_effort"] + plain["robot_effort"])))


def _phases(paths: pd.DataFrame) -> dict[str, list[dict[str, Any]]]:
    """Mean over runs of the mean score in a phase, per condition and phase."""
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
    """Score at the grasp from the random minus that from the rest posture, per condition on the same heights."""
    rest, random = (pivot(runs, "reba_grasp", start).add_suffix(f", {start}") for start in STARTS)
    both = rest.join(random, how="outer")
    pairs = [(f"{condition}, random", f"{condition}, rest") for condition in CONDITIONS]
    comparisons = [asdict(one) for one in compare(both, pairs)]
    return {"reba_grasp": dict(zip(CONDITIONS, comparisons, strict=True))}


def _of_paper(mean: float, sd: float) -> Mean:
    return Mean(published.RUNS, mean, sd, sd / published.RUNS**0.5)


def _mean_sd(value: tuple[float, float] | None) -> dict[str, float] | None:
    return None if value is None else {"mean": value[0], "sd": value[1]}
