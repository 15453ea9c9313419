"""The first sheet of a workbook of scores: the result, as people read it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from reba.analysis.score_table import ScoreTable
from reba.analysis.verdict import HIGH
from reba.arrays import Array
from reba.method.tables import ACTION_LEVEL_FROM, ACTION_LEVELS
from reba.report.labels import PARTS
from reba.report.summary import summarise

Row = tuple[Any, ...]
DIGITS: Final = 2
"""Of means and shares; the sheet `Details` has all."""


def summary_rows(scores: ScoreTable) -> Iterator[Row]:
    """Yield the rows of the sheet: a name, its value, and the highest value where unmeasured angles leave a range.

    Example:
        >>> import reba, pandas
        >>> scores = reba.score(pandas.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 70.0]}))
        >>> [row for row in summary_rows(scores) if row[0] == "REBA, maximum"]
        [('REBA, maximum', 2, 11)]
    """
    record = summarise(scores)
    summary = record.summary
    yield ("what", "value", "highest, where angles were not measured")
    yield ("Result", summary["verdict"]["text"])
    yield ("Recording", record.name)
    yield ("Scored [s]", round(summary["seconds"], DIGITS))
    yield ("Frames", summary["frames"])
    for name, title in (("p90", "90th percentile"), ("mean", "mean"), ("median", "median"), ("max", "maximum")):
        yield _ends(f"REBA, {title}", *(summary["range"][f"{name}_{end}"] for end in ("low", "high")))
    held = summary["held"]
    yield _ends(f"REBA, highest sustained for {held['seconds']:g} s", held["reba"], held["reba_high"])
    high = summary["verdict"]["high_seconds"]
    yield _ends(f"Time at REBA {HIGH} or more [s]", *high)
    yield _ends(f"Time at REBA {HIGH} or more [%]", *(100 * end / (summary["seconds"] or 1.0) for end in high))
    for level, (risk, _) in enumerate(ACTION_LEVELS):
        first, last = ACTION_LEVEL_FROM[level], (*ACTION_LEVEL_FROM[1:], 16)[level] - 1
        classes = f"{first}" if first == last else f"{first} to {last}"
        share = summary["action_levels"][str(level)]
        yield (f"At {risk} risk, REBA {classes} [% of the time]", round(100 * share, DIGITS))
    yield ("Action level not determined [% of the time]", round(100 * summary["action_level_undetermined"], DIGITS))
    for name, title in PARTS.items():
        ends = (record.ends.low[name], record.ends.high[name])
        yield _ends(f"{title}, mean score", *(_mean(end, record.weights) for end in ends))
    yield ("Not measured", ", ".join(name.replace("_", " ") for name in summary["unmeasured"]) or "nothing")
    yield ("Assumed", "; ".join(summary["assumed"]) or "nothing")
    yield ("Warnings", "; ".join(summary["warnings"]) or "none")
    yield ("Rules", scores.rules.name)


def _mean(values: Any, weights: Array) -> float | None:
    return float(np.average(values, weights=weights)) if len(weights) else None


def _ends(name: str, low: float | None, high: float | None) -> Row:
    shown = [None if end is None else round(end, DIGITS) for end in (low, high)]
    return (name, shown[0]) if shown[0] == shown[1] else (name, *shown)
