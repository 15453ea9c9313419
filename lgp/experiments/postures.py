"""The paper's Fig. 8: one run's posture at the grasp without and with the ergonomic cost, drawn from its angles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from lgp.experiments.runs import STARTS, pivot
from reba.posture import COLUMNS, SIDES

if TYPE_CHECKING:
    import pandas as pd

COMPARED: Final = ("non-ergonomic", "re-optimized")
"""Conditions of the two figures: the same sequence of actions, planned without and with the ergonomic cost."""


@dataclass(frozen=True)
class Posture:
    """A drawn posture: its condition, table, true REBA score, and SVG."""

    condition: str
    table: str
    reba: int
    svg: str


@dataclass(frozen=True)
class Example:
    """The run that stands for all: of median difference in score between the two conditions.

    Attributes:
        run, start: which one.
        of: runs it was chosen from.
        difference: its score without minus its score with the ergonomic cost.
        postures: one per condition of `COMPARED`.
    """

    run: int
    start: str
    of: int
    difference: float
    postures: tuple[Posture, ...]


def example(runs: pd.DataFrame, paths: pd.DataFrame) -> Example | None:
    """Return the run of median difference, of random starts if there are any; None where none has both conditions."""
    for start in reversed(STARTS):
        scores = pivot(runs, "reba_grasp", start)[list(COMPARED)].dropna()
        if not len(scores):
            continue
        differences = (scores[COMPARED[0]] - scores[COMPARED[1]]).sort_values(kind="stable")
        run = int(differences.index[len(differences) // 2])
        here = runs[(runs["run"] == run) & (runs["initial"] == start)].set_index("condition")["table"]
        mine = paths[(paths["run"] == run) & (paths["initial"] == start)]
        if not set(COMPARED) <= set(mine["condition"]):
            continue
        postures = tuple(_posture(mine[mine["condition"] == name], name, str(here[name])) for name in COMPARED)
        return Example(run, start, len(scores), float(differences.loc[run]), postures)
    return None


def _posture(path: pd.DataFrame, condition: str, table: str) -> Posture:
    from reba import score_array
    from reba.report.stickfigure import SPOTS, Mark, stick_figure
    from reba.tables import PART_MAXIMA

    last = path.sort_values("slice").iloc[-1]
    angles = last[list(COLUMNS)].to_numpy(dtype=float)
    scores = score_array(angles[None], {"load": float(last["load"])})
    marks = {}
    for name in SPOTS:
        part = next((name.removesuffix(f"_{side}") for side in SIDES if name.endswith(side)), name)
        value = int(scores[name][0])
        # 255 stands for a score that the angles leave open.
        if 1 < value <= PART_MAXIMA[part]:
            marks[name] = Mark(str(value), (value - 1) / (PART_MAXIMA[part] - 1))
    reba = int(np.rint(last["reba"]))
    return Posture(condition, table, reba, stick_figure(angles, marks, f"{condition}: grasp with REBA {reba}"))
