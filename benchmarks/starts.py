"""How often the best known motion of a sequence is found: the planner beside 200 random starts.

    OMP_NUM_THREADS=1 python benchmarks/starts.py [--sequences 100] [--starts 200] [--cost convex] [--json FILE]

Draws of the screwdriver scene, each table in turn, without collisions. "found" is the path of the planner, from its own
starts. The best known path is the cheapest of that, of the paths from the distinct minima (within 10 %) of other 200
random starts, and of the path from one start alone. "agree" is the share of starts within 1 % of the best minimum.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from machine import machine, stamp

import dreba
from lgp.kinematics.world import World
from lgp.path import many_starts
from lgp.path.bounds import PathBounds
from lgp.path.ergonomics import Ergonomics
from lgp.path.many_starts import ManyStarts
from lgp.path.paths import OPTIONS
from lgp.planner import follow, parse_sequence, task_of
from lgp.scene.scene_file import load_scene
from lgp.search.tree_search import Skeleton
from lgp.sqp.solver import solve

LINES = (
    "grasp(baxter.right, screwdriver)",
    "place(baxter.right, screwdriver, {table})",
    "grasp(human.right_hand, screwdriver)",
)
WITHIN = 0.01
WIDTHS = (9, 9, 9, 7, 10, 6, 5)
NEAR, PATHS = 0.10, 8
"""Minima of the random starts from which paths are solved: relative difference to the best one, and number at most."""


@dataclass
class Row:
    """One sequence: costs of its paths, how many starts agree, and processor time [s] of the planner."""

    sequence: str
    found: float
    alone: float
    known: float
    agreed: float
    seconds: float


def best_known(bounds: PathBounds, actions: Skeleton, starts: int) -> float:
    """Return the least cost of the paths from the minima of random starts that the planner does not use."""
    phases = bounds.phases(actions)
    sequence, path = bounds.problem("sequence", phases), bounds.problem("path", phases)
    many_starts.NEAR_BEST, many_starts.CHOSEN, many_starts.STARTS = NEAR, PATHS, starts
    try:
        minima = ManyStarts(sequence).minima(np.zeros((0, sequence.n)), seed=1)
    finally:
        many_starts.NEAR_BEST, many_starts.CHOSEN, many_starts.STARTS = USED
    costs = [np.inf]
    for point in minima.points:
        x = sequence.join(*sequence.split(point))
        result = solve(path, path.join(sequence.path(x), sequence.split(x)[1]), options=OPTIONS)
        costs += [result.cost] if result.violation <= 1e-6 else []
    return float(min(costs))


USED = many_starts.NEAR_BEST, many_starts.CHOSEN, many_starts.STARTS


def rows_of(kind: str, count: int, starts: int) -> list[Row]:
    """Return the feasible ones among `count` sequences of random draws."""
    scene = load_scene("screwdriver")
    world, rows, rng = World(scene), [], np.random.default_rng(7)
    ergonomics = None if kind == "none" else Ergonomics(world, dreba.load(kind))
    tables = [name for name in scene.tables if name != "table.start"]
    while len(rows) < count:
        drawn = scene.with_heights({name: float(rng.uniform(*scene.tables[name].heights)) for name in tables})
        here = world.with_scene(drawn)
        for table in tables:
            actions = parse_sequence(task_of(drawn), [line.format(table=table) for line in LINES])
            bounds = PathBounds(here, ergonomics)
            begin = time.process_time()
            result = follow(bounds, actions)
            seconds = time.process_time() - begin
            if not np.isfinite(result.cost):
                continue
            alone = follow(PathBounds(here, ergonomics, multi_start=False), actions).cost
            known = min(result.cost, alone, best_known(bounds, actions, starts))
            agreed = result.payload.starts[0] / result.payload.starts[1]
            rows.append(Row(f"{len(rows)} {table}", result.cost, alone, known, agreed, seconds))
            if len(rows) == count:
                break
    return rows


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sequences", type=int, default=100)
    parser.add_argument("--starts", type=int, default=200)
    parser.add_argument("--cost", nargs="+", default=["none", "quadratic", "convex"])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    print(stamp())
    heads = ("sequences", "found", "one start", "worst", "worst, one", "agree", "s")
    print(f"{'cost':10} " + " ".join(f"{head:>{width}}" for head, width in zip(heads, WIDTHS, strict=True)))
    figures = {}
    for kind in options.cost:
        rows = rows_of(kind, options.sequences, options.starts)
        found, alone = (np.array([getattr(row, name) / row.known - 1.0 for row in rows]) for name in ("found", "alone"))
        figures[kind] = [row.__dict__ for row in rows]
        print(
            f"{kind:10} {len(rows):9d} {int(np.sum(found < WITHIN)):9d} {int(np.sum(alone < WITHIN)):9d} "
            f"{found.max():7.1%} {alone[np.isfinite(alone)].max():10.1%} {np.median([r.agreed for r in rows]):6.0%} "
            f"{np.median([row.seconds for row in rows]):5.2f}",
            flush=True,
        )
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": figures}))


if __name__ == "__main__":
    main()
