"""Motions whose bodies stay apart: as first solved, as improved by the planner, and the best known of many more tries.

    OMP_NUM_THREADS=1 python benchmarks/disturbed.py [--sequences 20] [--more 5] [--json FILE]

Draws of the screwdriver scene, each table in turn, with `convex`. "first" is the path from the planner's own starts,
"improved" that after at most four slightly disturbed ones, as a plan has it. The best known is the cheapest of these
and of `--more` further rounds of four, each from the best so far.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from machine import machine, stamp

import dreba
from lgp.kinematics.world import World
from lgp.path.bounds import PathBounds
from lgp.path.ergonomics import Ergonomics
from lgp.planner import follow, parse_sequence, plan_of, task_of
from lgp.scene.scene_file import load_scene

LINES = (
    "grasp(baxter.right, screwdriver)",
    "place(baxter.right, screwdriver, {table})",
    "grasp(human.right_hand, screwdriver)",
)
WITHIN = 0.01


@dataclass
class Row:
    """One sequence: costs of its motions, processor times [s], and whether the audit of the improved one is clean."""

    sequence: str
    first: float
    improved: float
    known: float
    seconds: float
    more_seconds: float
    clean: bool


def rows(count: int, more: int) -> Iterator[Row]:
    """Yield the feasible ones among sequences of random draws, until there are `count`."""
    scene = load_scene("screwdriver")
    world, rng, number = World(scene), np.random.default_rng(11), 0
    ergonomics = Ergonomics(world, dreba.load("convex"))
    tables = [name for name in scene.tables if name != "table.start"]
    while True:
        drawn = scene.with_heights({name: float(rng.uniform(*scene.tables[name].heights)) for name in tables})
        here = world.with_scene(drawn)
        for table in tables:
            actions = parse_sequence(task_of(drawn), [line.format(table=table) for line in LINES])
            bounds = PathBounds(here, ergonomics, collisions=True)
            begin = time.process_time()
            result = follow(bounds, actions)
            solved = time.process_time()
            if not np.isfinite(result.cost):
                continue
            improved = best = bounds.improved(actions)
            seconds = solved - begin, time.process_time() - solved
            for seed in range(1, more + 1):
                best = bounds.paths.improved(bounds.phases(actions), best, seed)
            clean = bool(plan_of(bounds, follow(bounds, actions)).audit["clean"])
            costs = result.cost, improved.costs.total, min(result.cost, improved.costs.total, best.costs.total)
            yield Row(f"{number} {table}", *costs, *seconds, clean)
            number += 1
            if number == count:
                return


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sequences", type=int, default=20)
    parser.add_argument("--more", type=int, default=5)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    print(stamp())
    done = []
    for row in rows(options.sequences, options.more):
        done.append(row)
        print(f"{row.sequence:16} {row.first:8.3f} {row.improved:8.3f} {row.known:8.3f}", flush=True)
    print(f"{'':10} {'within 1 %':>11} {'median above':>13} {'worst':>7} {'CPU':>7}")
    for name, spent in (("first", "seconds"), ("improved", "more_seconds")):
        above = np.array([getattr(row, name) / row.known - 1.0 for row in done])
        near = f"{int(np.sum(above < WITHIN))}/{len(done)}"
        seconds = np.median([getattr(row, spent) for row in done])
        print(f"{name:10} {near:>11} {np.median(above):13.1%} {above.max():7.1%} {seconds:5.1f} s")
    print(f"clean audits: {sum(row.clean for row in done)}/{len(done)}")
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": [asdict(row) for row in done]}))


if __name__ == "__main__":
    main()
