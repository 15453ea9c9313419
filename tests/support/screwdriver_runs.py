"""Runs of the screwdriver experiment with known answers."""

from functools import cache

import numpy as np
import pandas as pd

from lgp.experiments.runs import CONDITIONS, NUMBERS, PATH_COLUMNS, RUN_COLUMNS, TABLES
from reba.posture.columns import COLUMNS

RUNS = 12
SCORE = {"non-ergonomic": 7.0, "ergonomic": 3.0, "re-optimized": 5.0}
"""Mean score at the grasp of the made-up runs."""
NO_PLAN = {("rest", 2): ("non-ergonomic", "re-optimized")}


@cache
def one_run(run, start, worse):
    """Return rows and paths of one run: left without ergonomics, the centre with, score `worse` up without."""
    rng = np.random.default_rng([run, worse])
    heights = np.random.default_rng(run).uniform(0.6, 1.6, 3)
    rows, paths = [], []
    for condition in CONDITIONS:
        ok = condition not in NO_PLAN.get((start, run), ())
        table = "center" if condition == "ergonomic" else TABLES[run % 4 % 3 % 2]
        grasp = SCORE[condition] + rng.integers(-1, 2) + (worse if condition == "non-ergonomic" else 0)
        key = {"run": run, "condition": condition, "initial": start}
        row = {**key, "seed": 0, "feasible": ok, "seconds": 0.5, "faults": 2 * ok * (run == 0)}
        row |= {"reason": "" if ok else "<0.1 m> too far"}
        row |= {f"height_{name}": height for name, height in zip(TABLES, heights, strict=True)}
        row |= {"actions": "grasp(1, baxter.left, screwdriver)", "table": table if ok else None}
        row |= {"chosen_height": heights[TABLES.index(table)], "reba_grasp": grasp, "reba_mean": grasp / 2, "cost": 1.0}
        row |= {"duration": 6.0, "robot_effort": 0.75, "human_effort": 0.25}
        rows.append(row if ok else row | dict.fromkeys(NUMBERS, np.nan))
        if ok:
            scores = [1.0, 1.0, 2.0, 2.0, 4.0, grasp]
            path = pd.DataFrame({"slice": range(6), "phase": np.repeat(range(3), 2), "reba": scores, "load": 0.0})
            angles = {name: np.linspace(0, 40, 6) if name == "trunk_flexion" else 0.0 for name in COLUMNS}
            paths.append(path.assign(**key, time=path["slice"] + 1.0, **angles))
    return pd.DataFrame(rows)[list(RUN_COLUMNS)], pd.concat(paths)[list(PATH_COLUMNS)]


def made(*starts):
    """Return runs and paths of some starts; the random one is two points worse without ergonomics."""
    parts = [one_run(run, start, 2 if start == "random" else 0) for start in starts for run in range(RUNS)]
    return tuple(pd.concat(tables, ignore_index=True) for tables in zip(*parts, strict=True))
