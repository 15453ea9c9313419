"""Screwdriver plans with each dREBA model as cost: true REBA score and planning time.

    OMP_NUM_THREADS=1 python benchmarks/cost_models.py [--runs 4] [--models quadratic convex ...] [--json FILE]

All models plan for the same drawn heights. Scores are true REBA scores of the planned postures, not values of the
model; "no ergonomics" is the plan with the acceleration cost alone.
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
from lgp.path.ergonomics import Ergonomics
from lgp.plan_record import Plan
from lgp.planner import plan
from lgp.scene.scene_file import load_scene

MODELS = ("quadratic", "convex", "soft")
PLAIN = "no ergonomics"


def row(result: Plan, seconds: float) -> dict[str, Any]:
    """Figures of one plan."""
    scores = result.reba()
    reba = np.full(1, np.nan) if scores is None else np.asarray(scores.reba, dtype=float)
    return {
        "feasible": result.feasible,
        "reba_grasp": float(reba[-1]),
        "reba_mean": float(reba.mean()),
        "seconds": seconds,
        "path_seconds": result.search["levels"]["path"]["seconds"],
        "paths": result.search["paths"],
        "iterations": result.solver.get("iterations", 0),
        "table": result.actions[1].rpartition("table.")[2].rstrip(")") if len(result.actions) > 1 else "",
    }


def figures(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Means over the feasible plans, and the median and longest time."""
    good = [one for one in rows if one["feasible"]]
    means = {
        name: float(np.mean([one[name] for one in good])) if good else float("nan")
        for name in ("reba_grasp", "reba_mean", "paths", "iterations", "path_seconds")
    }
    seconds = [one["seconds"] for one in rows]
    return {
        "runs": len(rows),
        "feasible": len(good),
        **means,
        "seconds": float(np.median(seconds)),
        "most": max(seconds),
    }


def main() -> None:
    """Run the benchmark, print its table, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--models", nargs="+", default=list(MODELS))
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    world = World(load_scene("screwdriver"))
    scenes = [world.scene.draw_heights(np.random.default_rng([0, run])) for run in range(options.runs)]
    head = f"{'cost':14} {'feasible':>9} {'REBA grasp':>11} {'mean':>6} {'paths':>6} {'iterations':>11}"
    print(f"{head} {'s, paths':>9} {'s, median':>10} {'s, most':>8}")
    results = {}
    for name in (PLAIN, *options.models):
        cost = None if name == PLAIN else Ergonomics(world, dreba.load(name))
        rows = []
        for scene in scenes:
            began = time.perf_counter()
            result = plan(scene, cost, world=world)
            rows.append(row(result, time.perf_counter() - began))
        mean = figures(rows)
        print(
            f"{name:14} {mean['feasible']:>4}/{mean['runs']:<4} {mean['reba_grasp']:>11.2f} {mean['reba_mean']:>6.2f} "
            f"{mean['paths']:>6.1f} {mean['iterations']:>11.1f} {mean['path_seconds']:>9.2f} {mean['seconds']:>10.2f} "
            f"{mean['most']:>8.2f}",
            flush=True,
        )
        results[name] = {"figures": mean, "runs": rows}
    print(f"\n{stamp()}")
    if options.json:
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps({"machine": machine(), "results": results}, indent=1))


if __name__ == "__main__":
    main()
