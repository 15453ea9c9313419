"""What a study lacks and what weakens it, said in words: nothing is dropped without a name."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, Final

from lgp.study.measures import TOTAL
from lgp.study.scoring import Scored
from lgp.study.sources import Sources

if TYPE_CHECKING:
    import pandas as pd

SHORT: Final = 0.5
"""A recording is called short below this share of the median duration of its condition."""
BROKEN: Final = "the recording breaks off"
"""How the note of a recording begins that was read up to where it breaks off (`reba.posture.Quality.notes`)."""
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
