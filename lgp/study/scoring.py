"""Scores of a study: one row per recording, then one per participant and condition.

Means are time-weighted: a frame by the time until the next one, so that sampling rate and gaps have no influence; a
trial of a participant in a condition by its duration. All participants have the same weight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, Final

import numpy as np
import pandas as pd

from lgp.study.labels import Label, encodable
from lgp.study.recordings import Failure, Sources
from reba.analysis.exposure import column, distribution, durations, level_shares
from reba.analysis.wording import percent
from reba.arrays import Array
from reba.batch.run import ScoringOptions
from reba.errors import ReadError, RebaError
from reba.file_stamp import CHANGED_WHILE_READ, TRY_AGAIN, stamp_of
from reba.posture.columns import SIDES
from reba.scores import Scores

KEYS: Final = ("participant", "condition", "trial")
"""Columns that identify a recording."""
DEMANDING_FROM: Final = 2
"""Lowest action level of demanding time: medium risk, REBA 4 or more."""


@dataclass(frozen=True)
class Scored:
    """The scored recordings of a study.

    Attributes:
        recordings: one row per recording: `KEYS`, simulated, input, frames, seconds, reba and its range, determined
            (share of time with a unique score), shares of action levels, means of part scores of the side that gives
            the total, and of both sides.
        notes: file -> remarks on the quality of the recording.
        unmeasured: file -> angles without a measurement.
        assumed: defaults used, over all recordings.
        rules: every threshold.
        truncated: file -> how the recording is truncated.
    """

    recordings: pd.DataFrame
    notes: dict[str, list[str]]
    unmeasured: dict[str, tuple[str, ...]]
    assumed: tuple[str, ...]
    rules: dict[str, Any]
    failed: tuple[Failure, ...]
    truncated: dict[str, str] = field(default_factory=dict)


def score_sources(
    sources: Sources, options: ScoringOptions, on_scored: Callable[[str], None] | None = None
) -> tuple[Scored, Failure | None]:
    """Scores of all recordings, and the first failure if none could be scored; `on_scored` is called with each file."""
    rows: list[dict[str, Any]] = []
    failed = list(sources.unnamed)
    notes: dict[str, list[str]] = {}
    truncated: dict[str, str] = {}
    unmeasured: dict[str, tuple[str, ...]] = {}
    assumed: dict[str, None] = {}
    rules: dict[str, Any] = {}
    for file, label in sources.named:
        try:
            scores = options.read_and_score(file)
            if file in sources.stamps and stamp_of(file) != sources.stamps[file]:
                raise ReadError(file, CHANGED_WHILE_READ, hint=TRY_AGAIN)
            rows.append(row(file, label, scores))
        except RebaError as error:
            failed.append(Failure(file, str(error), label))
        else:
            quality = scores.postures.quality
            if remarks := list(quality.notes()):
                notes[file] = remarks
            if quality.ended_abnormally:
                truncated[file] = quality.ended_abnormally
            unmeasured[file] = scores.unmeasured
            assumed |= dict.fromkeys(scores.assumed)
            rules = vars(scores.rules)
        if on_scored is not None:
            on_scored(file)
    table = pd.DataFrame(rows)
    scored = Scored(table, notes, unmeasured, tuple(assumed), dict(rules), tuple(failed), truncated)
    return scored, (failed[0] if not rows else None)


def row(file: str, label: Label, scores: Scores) -> dict[str, Any]:
    """Row of one recording: time-weighted means and shares of time.

    Raises:
        RebaError: it has no frame.
    """
    if not len(scores.data):
        raise RebaError(f"{file}: the recording has no frame; record it again")
    weights = durations(scores.time)
    low, high = (distribution(column(scores, name), weights).mean for name in ("reba_low", "reba_high"))
    shares = level_shares(scores)
    determined = column(scores, "reba_low") == column(scores, "reba_high")
    total = column(scores, TOTAL)
    measures: dict[str, Any] = {name: getattr(label, name) for name in (*KEYS, "simulated")}
    measures |= {"input": encodable(file), "frames": len(weights), "seconds": float(weights.sum())}
    measures |= {TOTAL: mean(total, weights) if not np.isnan(total).any() else np.nan}
    measures |= {"reba_low": low, "reba_high": high, "determined": mean(determined.astype(float), weights)}
    measures |= {name: shares[str(level)] for level, name in enumerate(LEVELS)}
    measures |= {"level_undetermined": shares["undetermined"]}
    measures[DEMANDING] = sum(shares[str(level)] for level in range(DEMANDING_FROM, len(LEVELS)))
    return measures | part_means(scores, weights)


def part_means(scores: Scores, weights: Array) -> dict[str, float]:
    """Time-weighted mean of each part score: of the side that gives the total, and of both sides."""
    sided = [f"{name}_{side}" for name in (TOTAL, *SIDED) for side in SIDES]
    columns = {name: column(scores, name) for name in (*(name for name in PARTS if name not in SIDED), *sided)}
    both = {name: columns[name] for name in sided if not name.startswith(TOTAL)}
    parts = part_scores(columns, scores.rules.two_sides)
    return {name: mean(values, weights) for name, values in {**parts, **both}.items()}


def part_scores(columns: Mapping[str, Array], two_sides: str = "worse") -> dict[str, Array]:
    """Scores (n,) of each part; of sided parts those of the arm that gives the total score of the frame.

    If both arms give the same total, the mean of the two is taken. Undetermined scores are NaN. `two_sides` is that of
    the rules: "worse", "left" or "right".
    """
    totals = [np.asarray(columns[f"{TOTAL}_{side}"], np.float64) for side in SIDES]
    left = np.nan_to_num(np.sign(totals[0] - totals[1]) / 2.0 + 0.5, nan=0.5)
    if two_sides in SIDES:
        left = np.full(len(left), float(two_sides == SIDES[0]))
    parts: dict[str, Array] = {}
    for name in PARTS:
        if name in SIDED:
            parts[name] = left * columns[f"{name}_{SIDES[0]}"] + (1.0 - left) * columns[f"{name}_{SIDES[1]}"]
        else:
            parts[name] = np.asarray(columns[name], np.float64)
    return parts


def mean(values: Array, weights: Array) -> float:
    """Weighted mean of (n,) values without NaN; NaN if all are NaN.

    >>> mean(np.array([1.0, 3.0, np.nan]), np.array([3.0, 1.0, 9.0]))
    1.5
    """
    known = ~np.isnan(values)
    return float(np.average(values[known], weights=weights[known])) if known.any() else float("nan")


def cells(recordings: pd.DataFrame) -> pd.DataFrame:
    """One row per participant and condition: sums of seconds and frames, means of all else weighted by seconds.

    A score that is undetermined (NaN) in one trial is undetermined for the cell.
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
    """Participants (sorted, rows) x conditions (columns) of one measure; NaN without a recording."""
    wide = table.pivot(index="participant", columns="condition", values=measure)
    return wide.reindex(columns=list(conditions)).sort_index()


TOTAL: Final = "reba"
"""Primary measure of a study: time-weighted mean REBA score."""
PARTS: Final[dict[str, str]] = {
    "load_force": "Weight (load and force)",
    "upper_arm": "Shoulder (upper arm)",
    "lower_arm": "Elbow (lower arm)",
    "wrist": "Wrist",
    "trunk": "Trunk",
    "neck": "Neck",
    "legs": "Legs",
    "coupling": "Coupling",
    "activity": "Activity",
}
"""Part scores whose means are compared, with the terms of the paper's Fig. 11, whose parts come first."""
SIDED: Final = ("upper_arm", "lower_arm", "wrist", "coupling")
"""Parts with a score per side; the side that gives the total of a frame is compared."""
LEVELS: Final = tuple(f"level_{level}" for level in range(5))
"""Shares of time in each action level."""
DEMANDING: Final = "demanding"
"""Share of time at REBA 4 or more: action level 2, medium, and above."""
EXTRA: Final[dict[str, str]] = {
    DEMANDING: "Share of time at REBA 4 or more",
    "seconds": "Duration of the recordings [s]",
}
"""Measures that are reported with intervals and not tested."""
SHORT: Final = 0.5
"""Recordings shorter than this share of the median duration of their condition are reported."""
FEW_PAIRS: Final = 6
"""The two-sided signed-rank test of fewer pairs cannot reach p < 0.05: with five, p is at least 2 / 2^5 = 0.0625."""


def missing_cells(sources: Sources, scored: Scored, conditions: Sequence[str]) -> list[dict[str, str]]:
    """Participant, condition and reason of every missing cell."""
    present = set(zip(scored.recordings["participant"], scored.recordings["condition"], strict=True))
    reasons = {(label.participant, label.condition): "planned, no recording given" for label in sources.absent}
    for failure in scored.failed:
        if failure.label is not None:
            reasons[failure.label.participant, failure.label.condition] = f"cannot be used: {failure.error}"
    people = {label.participant for _, label in sources.named} | {label.participant for label in sources.absent}
    return [
        {"participant": name, "condition": condition, "why": reasons.get((name, condition), "no recording")}
        for name, condition in product(sorted(people), conditions)
        if (name, condition) not in present
    ]


def limitations(scored: Scored, results: dict[str, Any], cells: pd.DataFrame) -> list[str]:
    """Limitations of the scores and of the results of `lgp.study.analysis.analyse`, one sentence each."""
    table = scored.recordings
    notes = [*_mixed_simulated(table), *_unequal_angles(scored), *_undetermined(table), *_short(table)]
    for pair in results[TOTAL]["pairs"]:
        if 1 < pair["n"] < FEW_PAIRS:
            notes.append(
                f"{pair['first']} against {pair['second']}: with {pair['n']} pairs the signed-rank test cannot reach "
                "p < 0.05 for any effect"
            )
    trials = sorted(set(cells["trials"].tolist()))
    if len(trials) > 1:
        notes.append(
            f"participants have {trials[0]} to {trials[-1]} recordings of a condition; all participants weigh the same"
        )
    for pair in results["described"]["seconds"]["pairs"]:
        if pair["n"] > 1 and (pair["low"] > 0 or pair["high"] < 0):
            longer = "longer" if pair["difference"] > 0 else "shorter"
            notes.append(
                f"{pair['first']} took {abs(pair['difference']):.1f} s {longer} than {pair['second']} on average; "
                "mean scores are time averages and do not measure the total exposure of the task"
            )
    return [*notes, *(f"{file}: the recording is truncated: {how}" for file, how in scored.truncated.items())]


def _mixed_simulated(table: pd.DataFrame) -> list[str]:
    simulated = int(table["simulated"].sum())
    if 0 < simulated < len(table):
        return [f"{simulated} of {len(table)} recordings are simulated; do not mix them with recordings of people"]
    return []


def _unequal_angles(scored: Scored) -> list[str]:
    """Angles that only some recordings lack: there they count as neutral, which biases the comparison."""
    sets: dict[str, set[str]] = {file: set(names) for file, names in scored.unmeasured.items()}
    in_all = set[str].intersection(*sets.values())
    in_some = sorted(set[str]().union(*sets.values()) - in_all)
    lacking = [file for file, names in sets.items() if names & set(in_some)]
    if not in_some:
        return []
    return [f"measured angles differ: {len(lacking)} of {len(sets)} recordings lack {', '.join(in_some)}"]


def _undetermined(table: pd.DataFrame) -> list[str]:
    seconds = table["seconds"] / table["seconds"].sum()
    determined, low, high = (float((table[name] * seconds).sum()) for name in ("determined", "reba_low", "reba_high"))
    if determined > 1.0 - 1e-9:
        return []
    return [
        f"unmeasured angles leave the score undetermined in {percent(1.0 - determined)} of the time; over all "
        f"possible angles the mean of all recordings lies between {low:.2f} and {high:.2f}"
    ]


def _short(table: pd.DataFrame) -> list[str]:
    median = table.groupby("condition")["seconds"].transform("median")
    rows = table[table["seconds"] < SHORT * median]
    return [
        f"{one.input}: {one.seconds:.1f} s, less than half of the median duration in {one.condition}"
        for one in rows.itertuples()
    ]
