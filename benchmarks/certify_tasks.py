"""Prove the least true REBA of the reach tasks, and store it with them.

Usage: python benchmarks/certify_tasks.py [--tasks 80] [--check]

Writes dreba/evaluation/reach_tasks.json: tasks of two spaces and two seeds, for each the proved bound and the posture
of the lowest score that is known. With --check nothing is written, and the stored bounds are compared with new ones.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # small matrices: threads only cost time

import argparse
import dataclasses
import json
import time

from machine import stamp

from dreba.evaluation.certify import least_score
from dreba.evaluation.hand_sets import hand_fields
from dreba.evaluation.reach_tasks import SPACES, STORED, StoredTask, tasks
from reba.files import write_atomic, write_text

SEEDS = (0, 1)
HIGHEST_B = 6
"""Highest Score B of a field: enough to exclude every REBA score up to 3."""


def row(task: StoredTask) -> dict[str, object]:
    """Plain data of a task."""
    plain = dataclasses.asdict(task)
    return {"targets": plain["task"]["targets"], "proved": task.proved, "reached": task.reached, "dofs": task.dofs}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", type=int, default=80, help="tasks of each space and seed")
    parser.add_argument("--check", action="store_true", help="compare with the stored bounds, write nothing")
    options = parser.parse_args()
    print(stamp())
    began = time.perf_counter()
    fields = hand_fields(HIGHEST_B)
    print(f"what the hands reach: {time.perf_counter() - began:.0f} s")
    sets = {}
    for space in SPACES:
        for seed in SEEDS:
            found = [least_score(task, fields) for task in tasks(options.tasks, seed, space)]
            certified = sum(task.certified for task in found)
            proved, reached = (
                sum(getattr(task, name) for task in found) / len(found) for name in ("proved", "reached")
            )
            print(
                f"{space:6} seed {seed}: {certified} of {len(found)} certified; least REBA {proved:.3f} proved, "
                f"{reached:.3f} reached; {time.perf_counter() - began:.0f} s",
                flush=True,
            )
            sets[f"{space} {seed}"] = [row(task) for task in found]
    if options.check:
        stored = json.loads(STORED.read_text(encoding="utf-8"))["sets"]
        same = [
            old["proved"] == new["proved"] for name in sets for old, new in zip(stored[name], sets[name], strict=False)
        ]
        print(f"{sum(same)} of {len(same)} bounds as stored")
        return
    lines = ",\n".join(
        f"{json.dumps(name)}: [\n" + ",\n".join(json.dumps(one) for one in rows) + "\n]" for name, rows in sets.items()
    )
    text = f'{{"command": "python benchmarks/certify_tasks.py", "sets": {{\n{lines}\n}}}}\n'
    write_atomic(STORED, lambda part: write_text(part, text))


if __name__ == "__main__":
    main()
