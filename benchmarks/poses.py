"""Poses solved at once, beside one after the other: time of an iteration by the number of starts.

    OMP_NUM_THREADS=1 python benchmarks/poses.py [--starts 1 8 64 128 256] [--json FILE]

The pose of a grasp by the person and by Baxter in the screwdriver scene, from random starts projected to the
constraints, with the shipped ergonomic cost. Processor time of `lgp.sqp.many`, model and QP included, by iterations of
all starts; "alone" is `lgp.sqp.solver` from the first four of them.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from machine import machine, stamp

import dreba
from lgp.kinematics.world import World
from lgp.path.bounds import PathBounds
from lgp.path.ergonomics import Ergonomics
from lgp.path.keyframes import POSE_OPTIONS
from lgp.path.many_starts import PROJECTED, ManyStarts
from lgp.planner import parse_sequence, task_of
from lgp.scene.scene_file import load_scene
from lgp.sqp.many import solve_many
from lgp.sqp.solver import solve

HEIGHTS = {"left": 0.9, "center": 1.0, "right": 0.95}
LINES = (
    "grasp(baxter.right, screwdriver)",
    "place(baxter.right, screwdriver, table.center)",
    "grasp(human.right_hand, screwdriver)",
)
REPEAT = 3


def rows_of(bounds: PathBounds, actions: Any, who: str, counts: list[int]) -> list[dict[str, Any]]:
    """Return a row for each number of starts."""
    problem = bounds.problem("pose", bounds.phases(actions))
    many, world = ManyStarts(problem), bounds.world
    rng = np.random.default_rng(0)
    rows = []
    for count in counts:
        q = np.tile(world.initial_configuration, (count, 1, 1))
        q += 0.4 * (rng.uniform(world.lower, world.upper, q.shape) - q)
        starts = [problem.join(one, np.zeros(problem.modes.size)) for one in q]
        points, violation = many.project(np.array(starts)[:, many.columns])
        points = points[violation <= PROJECTED]
        times = []
        for _ in range(REPEAT):
            begin = time.process_time()
            found = solve_many(many, points, cost_ratio=np.inf)
            times.append(1e3 * (time.process_time() - begin))
        each = min(times) / max(int(found.iterations.sum()), 1)
        rows.append({"pose": who, "starts": count, "ms": min(times), "each_ms": each, "unknowns": many.n})
    begin, steps = time.process_time(), 0
    for point in many.full(points[:4]):
        steps += len(solve(problem, problem.join(*problem.split(point)), options=POSE_OPTIONS).iterations) - 1
    alone = 1e3 * (time.process_time() - begin)
    rows.append({"pose": who, "starts": 0, "ms": alone / 4.0, "each_ms": alone / max(steps, 1), "unknowns": problem.n})
    return rows


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", type=int, nargs="+", default=[1, 8, 64, 128, 256])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    print(stamp())
    scene = load_scene("screwdriver").with_heights(HEIGHTS)
    world = World(scene)
    bounds = PathBounds(world, Ergonomics(world, dreba.load("convex")))
    actions = parse_sequence(task_of(scene), LINES)
    rows = rows_of(bounds, actions, "person", options.starts) + rows_of(bounds, actions[:1], "baxter", options.starts)
    print(f"{'pose':8} {'starts':>6} {'unknowns':>8} {'ms':>9} {'ms an iteration':>16}")
    for row in rows:
        starts = row["starts"] or "alone"
        print(f"{row['pose']:8} {starts:>6} {row['unknowns']:8d} {row['ms']:9.1f} {row['each_ms']:16.3f}")
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}))


if __name__ == "__main__":
    main()
