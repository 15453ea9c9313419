"""Recordings -> the table of a study: one row per recording, then one per participant and condition.

Within a recording every frame weighs as much as the time until the next one, so that neither rate nor gaps count; over
the trials of a participant in a condition each weighs by its seconds; participants weigh the same, however long theirs
took.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from lgp.study.labels import Label
from lgp.study.measures import DEMANDING, LEVELS, PARTS, SIDED, TOTAL
from lgp.study.sources import Failure, Sources
from reba.errors import RebaError
from reba.exposure import column, distribution, durations, level_shares
from reba.posture import SIDES

if TYPE_CHECKING:
    from reba.batch import Options
    from reba.scores import Scores

Array = NDArray[np.float64]

KEYS: Final = ("participant", "condition", "trial")
DEMANDING_FROM: Final = 2
"""Action level from which time counts as demanding."""


@dataclass(frozen=True)
class Scored:
    """The scored recordings of a study.

    Attributes:
        recordings: one row per recording: `KEYS`, simulated, input, frames, seconds, reba and its range, determined
            (share of time in which all angles that matter were measured), shares of action levels, means of part
            scores of the side that gives the total, and of both sides.
        notes: what a reader must know of single recordings: file -> lines.
        unmeasured: file -> angles that it does not hold.
        assumed: what had to be assumed, over all recordings.
        rules: every threshold.
        failed: recordings that could not be scored.
    """

    recordings: pd.DataFrame
    notes: dict[str, list[str]]
    unmeasured: dict[str, tuple[str, ...]]
    assumed: tuple[str, ...]
    rules: dict[str, Any]
    failed: tuple[Failure, ...]


def score_sources(
    sources: Sources, options: Options, done: Callable[[str], None] = lambda file: None
) -> tuple[Scored, Failure | None]:
    """Return the scores of all recordings, and the first failure if none could be scored."""
    rows: list[dict[str, Any]] = []
    failed = list(sources.unnamed)
    notes: dict[str, list[str]] = {}
    unmeasured: dict[str, tuple[str, ...]] = {}
    assumed: dict[str, None] = {}
    rules: dict[str, Any] = {}
    for file, label in sources.named:
        try:
            scores = options.read_and_score(file)
            rows.append(row(file, label, scores))
        except RebaError as error:
            failed.append(Failure(file, str(error), label))
        else:
            notes[file] = list(scores.postures.quality.notes())
            unmeasured[file] = scores.unmeasured
            assumed |= dict.fromkeys(scores.assumed)
            rules = vars(scores.rules)
        done(file)
    table = pd.DataFrame(rows)
    kept = {file: said for file, said in notes.items() if said}
    scored = Scored(table, kept, unmeasured, tuple(assumed), dict(rules), tuple(failed))
    return scored, (failed[0] if not rows else None)


def row(file: str, label: Label, scores: Scores) -> dict[str, Any]:
    """Return the row of one recording.

    Raises:
        RebaError: it holds no frame.
    """
    if not len(scores.data):
        raise RebaError(f"{file}: the recording holds no frame; record it again")
    weights = durations(scores.time)
    low, high = (distribution(column(scores, name), weights).mean for name in ("reba_low", "reba_high"))
    shares = level_shares(scores)
    known = column(scores, "reba_low") == column(scores, "reba_high")
    total = column(scores, TOTAL)
    found: dict[str, Any] = {name: getattr(label, name) for name in (*KEYS, "simulated")}
    found |= {"input": file, "frames": len(weights), "seconds": float(weights.sum())}
    found |= {TOTAL: mean(total, weights) if not np.isnan(total).any() else np.nan}
    found |= {"reba_low": low, "reba_high": high, "determined": mean(known.astype(float), weights)}
    found |= {name: shares[str(level)] for level, name in enumerate(LEVELS)}
    found |= {"level_undetermined": shares["undetermined"]}
    found[DEMANDING] = sum(shares[str(level)] for level in range(DEMANDING_FROM, len(LEVELS)))
    return found | part_means(scores, weights)


def part_means(scores: Scores, weights: Array) -> dict[str, float]:
    """Return the time-weighted mean of each part score: of the side that gives the total, and of both sides."""
    sided = [f"{name}_{side}" for name in (TOTAL, *SIDED) for side in SIDES]
    columns = {name: column(scores, name) for name in (*(name for name in PARTS if name not in SIDED), *sided)}
    both = {name: columns[name] for name in sided if not name.startswith(TOTAL)}
    parts = part_scores(columns, scores.rules.two_sides)
    return {name: mean(values, weights) for name, values in {**parts, **both}.items()}


def part_scores(columns: Mapping[str, Array], two_sides: str = "worse") -> dict[str, Array]:
    """Return (n,) scores of each part, those with two sides of the arm that gives the total in a frame.

    Where both arms give the same total, the mean of the two stands for them.

    Args:
        columns: (n,) scores by the names of the score table, NaN where undetermined.
        two_sides: of the rules: "worse", "left" or "right".
    """
    totals = [np.asarray(columns[f"{TOTAL}_{side}"], np.float64) for side in SIDES]
    left = np.nan_to_num(np.sign(totals[0] - totals[1]) / 2.0 + 0.5, nan=0.5)
    if two_sides in SIDES:
        left = np.full(len(left), float(two_sides == SIDES[0]))
    found: dict[str, Array] = {}
    for name in PARTS:
        if name in SIDED:
            found[name] = left * columns[f"{name}_{SIDES[0]}"] + (1.0 - left) * columns[f"{name}_{SIDES[1]}"]
        else:
            found[name] = np.asarray(columns[name], np.float64)
    return found


def mean(values: Array, weights: Array) -> float:
    """Return the weighted mean of the known ones of (n,) values, NaN if there is none.

    >>> mean(np.array([1.0, 3.0, np.nan]), np.array([3.0, 1.0, 9.0]))
    1.5
    """
    known = ~np.isnan(values)
    return float(np.average(values[known], weights=weights[known])) if known.any() else float("nan")


def cells(recordings: pd.DataFrame) -> pd.DataFrame:
    """Return one row per participant and condition: seconds and frames add up, all else is weighted by seconds.

    A score that one of the trials leaves open is open for all of them.
    """
    adding = ["frames", "seconds"]
    measured = [name for name in recordings.columns if name not in (*KEYS, "simulated", "input", *adding)]
    rows = []
    for (participant, condition), trials in recordings.groupby(["participant", "condition"], sort=False):
        seconds = trials["seconds"].to_numpy(np.float64)
        values = trials[measured].to_numpy(np.float64)
        means = dict(zip(measured, (seconds @ values / seconds.sum()).tolist(), strict=True))
        sums = {name: trials[name].sum() for name in adding}
        rows.append({"participant": participant, "condition": condition, "trials": len(trials), **sums, **means})
    return pd.DataFrame(rows)


def by_condition(table: pd.DataFrame, measure: str, conditions: Sequence[str]) -> pd.DataFrame:
    """Return participants (sorted, rows) x conditions (columns) of one measure; NaN where there is no recording."""
    wide = table.pivot(index="participant", columns="condition", values=measure)
    return wide.reindex(columns=list(conditions)).sort_index()
