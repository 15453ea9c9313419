"""True REBA reached by minimising each shipped model on reach tasks, beside costs that know no REBA.

Usage: python benchmarks/enabler.py [--tasks 80] [--models soft convex ...] [--json FILE]

Both spaces of tasks, two seeds each, random and neutral starts. Every row has the same starts, solver, tolerance
and budget; a free start, stages and the polish are rows of their own. Standard errors are over tasks; differences are
to the distance to rest with the same start and free start, paired by task. An infeasible run counts as 12.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # small matrices: threads only cost time
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
from pathlib import Path
from typing import Any

from machine import machine, stamp

import dreba
from dreba.evaluation.reach_tasks import SPACES
from dreba.evaluation.usefulness import enable

SEEDS = (0, 1)


def show(name: str, found: dict[str, Any]) -> None:
    """Print the rows of one set of tasks."""
    known = found["certified"]
    print(
        f"\n{name}: {found['tasks']} tasks, {known['tasks']} certified; least true REBA {known['proved']:.2f} proved, "
        f"{known['reached']:.2f} reached; {found['solver']}"
    )
    print(
        f"{'start':9}{'minimised':40}{'REBA':>12}{'- distance':>15}{'- proved':>10}{'infeas.':>9}{'evals':>7}{'ms':>6}"
    )
    for row in found["rows"]:
        reba = f"{row['reba']:.2f} ({row['standard_error']:.2f})"
        less = f"{row['difference']:+.2f} ({row['difference_standard_error']:.2f})"
        print(
            f"{row['start']:9}{row['name']:40}{reba:>12}{less:>15}{row['reba'] - row['certified']:10.2f}"
            f"{row['infeasible']:9.3f}{row['evaluations']:7.0f}{row['seconds'] * 1e3:6.0f}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", type=int, default=80, help="tasks of each space and seed, at least 2")
    parser.add_argument("--models", nargs="+", default=list(dreba.models()))
    parser.add_argument("--json", type=Path, default=None)
    options = parser.parse_args()
    print(stamp())
    models = {name: dreba.load(name) for name in options.models}
    rows = []
    for space in SPACES:
        for seed in SEEDS:
            found = enable(models, options.tasks, seed, space=space, task_seed=seed)
            show(f"{space}, seed {seed}", found)
            rows += [{"set": f"{space} {seed}", **row} for row in found["rows"]]
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
