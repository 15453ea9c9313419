"""Recordings -> the table of a study: one row per recording, then one per participant and condition.

Within a recording every frame weighs as much as the time until the next one, so that neither rate nor gaps count; over
the trials of a participant in a condition each weighs by its seconds; participants weigh the same, however long theirs
took.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from lgp.study.labels import Label
from lgp.study.recordings import Failure, Sources
from reba.analysis.exposure import column, distribution, durations, level_shares
from reba.arrays import Array
from reba.batch.run import ScoringOptions
from reba.errors import RebaError
from reba.posture.columns import SIDES
from reba.scores import Scores

if TYPE_CHECKING:
    import pandas as pd

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
    sources: Sources, options: ScoringOptions, done: Callable[[str], None] = lambda file: None
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


TOTAL: Final = "reba"
"""The measure that a study is decided by: time-weighted mean REBA."""
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
"""Part scores whose means are compared, those that the paper's Fig. 11 speaks of first; the words in front are its."""
SIDED: Final = ("upper_arm", "lower_arm", "wrist", "coupling")
"""Parts with a score per side; compared is the side that gives the total in each frame."""
LEVELS: Final = tuple(f"level_{level}" for level in range(5))
"""Shares of time in each action level."""
DEMANDING: Final = "demanding"
"""Share of time at REBA 4 or more: action level 2, medium, and above."""
EXTRA: Final[dict[str, str]] = {
    DEMANDING: "Share of time at REBA 4 or more",
    "seconds": "Duration of the recordings [s]",
}
"""Measures that are described beside the parts and not tested."""
SHORT: Final = 0.5
"""A recording is called short below this share of the median duration of its condition."""
BROKEN: Final = "the recording breaks off"
"""How the note of a recording begins that was read up to where it breaks off (`reba.posture.table.Quality.notes`)."""
FEW_PAIRS: Final = 6
"""Signed ranks of fewer pairs never reach p < .05, two-sided: 2 / 2^5 = .0625."""


def missing_cells(sources: Sources, scored: Scored, conditions: Sequence[str]) -> list[dict[str, str]]:
    """Return participant, condition and reason wherever a participant lacks a condition."""
    have = set(zip(scored.recordings["participant"], scored.recordings["condition"], strict=True))
    why = {(label.participant, label.condition): "planned, no recording given" for label in sources.absent}
    for failure in scored.failed:
        if failure.label is not None:
            why[failure.label.participant, failure.label.condition] = f"cannot be used: {failure.error}"
    people = {label.participant for _, label in sources.named} | {label.participant for label in sources.absent}
    return [
        {"participant": who, "condition": what, "why": why.get((who, what), "no recording")}
        for who, what in product(sorted(people), conditions)
        if (who, what) not in have
    ]


def warnings(scored: Scored, found: dict[str, Any], cells: pd.DataFrame) -> list[str]:
    """Return what a reader must know before using the numbers, one sentence each.

    Args:
        scored: the recordings.
        found: what `analyse` returned.
        cells: one row per participant and condition.
    """
    said = [*_simulated(scored.recordings), *_unlike(scored), *_open(scored.recordings), *_short(scored.recordings)]
    for pair in found[TOTAL]["pairs"]:
        if 1 < pair["n"] < FEW_PAIRS:
            said.append(
                f"{pair['first']} against {pair['second']}: with {pair['n']} pairs the signed ranks cannot reach "
                "p < .05, whatever the effect"
            )
    trials = sorted(set(cells["trials"].tolist()))
    if len(trials) > 1:
        said.append(f"participants have {trials[0]} to {trials[-1]} recordings of a condition; each counts once")
    for pair in found["described"]["seconds"]["pairs"]:
        if pair["n"] > 1 and (pair["low"] > 0 or pair["high"] < 0):
            longer = "longer" if pair["difference"] > 0 else "shorter"
            said.append(
                f"{pair['first']} took {abs(pair['difference']):.1f} s {longer} than {pair['second']} on average; "
                "mean scores are per second and say nothing about the sum over the task"
            )
    broken = [(file, text) for file, lines in scored.notes.items() for text in lines if text.startswith(BROKEN)]
    return [*said, *(f"{file}: {text}" for file, text in broken)]


def _simulated(table: pd.DataFrame) -> list[str]:
    made = int(table["simulated"].sum())
    if 0 < made < len(table):
        return [f"{made} of {len(table)} recordings are simulated; do not mix them with recordings of people"]
    return []


def _unlike(scored: Scored) -> list[str]:
    """Return which angles some recordings lack that others have: they count as neutral where they are lacking."""
    sets: dict[str, set[str]] = {file: set(names) for file, names in scored.unmeasured.items()}
    everywhere = set[str].intersection(*sets.values())
    partly = sorted(set[str]().union(*sets.values()) - everywhere)
    lacking = [file for file, names in sets.items() if names & set(partly)]
    if not partly:
        return []
    return [f"not measured alike: {len(lacking)} of {len(sets)} recordings lack {', '.join(partly)}"]


def _open(table: pd.DataFrame) -> list[str]:
    seconds = table["seconds"] / table["seconds"].sum()
    known, low, high = (float((table[name] * seconds).sum()) for name in ("determined", "reba_low", "reba_high"))
    if known > 1.0 - 1e-9:
        return []
    return [
        f"unmeasured angles leave the score open in {1.0 - known:.0%} of the time; over everything they could have "
        f"been the mean of all recordings lies between {low:.2f} and {high:.2f}"
    ]


def _short(table: pd.DataFrame) -> list[str]:
    usual = table.groupby("condition")["seconds"].transform("median")
    rows = table[table["seconds"] < SHORT * usual]
    return [
        f"{one.input}: {one.seconds:.1f} s, less than half of what is usual in {one.condition}"
        for one in rows.itertuples()
    ]
