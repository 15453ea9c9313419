"""How tight the bounds of the search are, what pruning saves, and whether it ever cuts off the best sequence.

    OMP_NUM_THREADS=1 python benchmarks/bounds.py [--runs 100] [--depth 4] [--json FILE]

Each run draws the heights of the screwdriver scene and looks at every sequence within the depth: all poses of its
prefixes, its sequence problem - also where a pose was refused, from several starts, in case the refusal was wrong - and
its path. The search is then asked for the best sequence. With and without ergonomics:
- bound / path cost of all feasible sequences, and how often a bound exceeds its path;
- nodes and problems of the search against all there are;
- whether both agree on the best cost.
Last, the time until a screwdriver out of reach of all hands is refused, without building the kinematics.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from machine import machine, stamp

import dreba
from lgp.kinematics.world import World
from lgp.logic.task import Task
from lgp.path.bounds import PathBounds
from lgp.path.ergonomics import Ergonomics
from lgp.planner import plan, task_of
from lgp.scene.scene_file import load_scene
from lgp.search.records import BoundResult, Budget, Skeleton
from lgp.search.tree_search import search

LEVELS = ("pose", "sequence", "path")
SAME = 1e-6
"""Relative difference of costs that counts as none."""


@dataclass
class Tally:
    """Counts over the runs of one cost."""

    ratios: dict[str, list[float]] = field(default_factory=lambda: {"pose": [], "sequence": []})
    asked: dict[str, dict[str, int]] = field(
        default_factory=lambda: {"search": dict.fromkeys(LEVELS, 0), "everything": dict.fromkeys(LEVELS, 0)}
    )
    nodes: dict[str, int] = field(default_factory=lambda: {"search": 0, "everything": 0})
    wrong_refusals: int = 0
    differ: list[int] = field(default_factory=list)
    runs: int = 0


def skeletons(task: Task, depth: int) -> Iterator[Skeleton]:
    """Yield every sequence without repeated states that reaches the goal, and every prefix of one."""

    def visit(state: int, done: Skeleton, seen: frozenset[int]) -> Iterator[Skeleton]:
        if task.is_goal(state):
            yield done
        elif len(done) < depth:
            for action, after in task.successors(state):
                if after not in seen:
                    yield from visit(after, (*done, action), seen | {after})

    yield from visit(task.initial, (), frozenset({task.initial}))


def compare(run: int, bounds: PathBounds, task: Task, depth: int, tally: Tally) -> None:
    """Solve all sequences, then search with the same bounds: stored results are counted, not solved again."""
    asked, best = tally.asked["everything"], np.inf
    prefixes = set()
    for skeleton in skeletons(task, depth):
        pose: BoundResult | None = None
        refused, low = False, 0.0
        for end in range(1, len(skeleton) + 1):
            asked["pose"] += skeleton[:end] not in prefixes
            prefixes.add(skeleton[:end])
            result = bounds.solve("pose", skeleton[:end], pose)
            refused = refused or not result.feasible
            if result.feasible:
                # No path costs less than any of its poses: the largest counts.
                pose, low = result, max(low, result.cost)
        asked["sequence"] += 1
        sequence = bounds.solve("sequence", skeleton, None if refused else pose)
        tally.wrong_refusals += refused and sequence.feasible
        if not sequence.feasible:
            continue
        asked["path"] += 1
        path = bounds.solve("path", skeleton, sequence)
        if not path.feasible:
            continue
        best = min(best, path.cost)
        if not refused:
            tally.ratios["pose"].append(low / path.cost)
        tally.ratios["sequence"].append(sequence.cost / path.cost)
    tally.nodes["everything"] += len(prefixes)
    chosen = search(task, bounds, Budget(depth=depth))
    tally.nodes["search"] += len(chosen.nodes) - 1
    for level in LEVELS:
        tally.asked["search"][level] += chosen.statistics[level].solved
    if chosen.cost > best * (1.0 + SAME) and np.isfinite(best):
        tally.differ.append(run)
    tally.runs += 1


def show(name: str, tally: Tally) -> dict[str, Any]:
    """Print one cost's figures and return them as plain data."""
    print(f"\n{name}, {tally.runs} runs")
    figures: dict[str, Any] = {"runs": tally.runs, "nodes": tally.nodes, "problems": tally.asked}
    for level, ratios in tally.ratios.items():
        values = np.array(ratios)
        row = {
            "n": len(values),
            "least": float(values.min()),
            "median": float(np.median(values)),
            "most": float(values.max()),
            "above": int((values > 1.0 + SAME).sum()),
        }
        figures[f"{level} / path"] = row
        print(
            f"  {level + ' / path':16} least {row['least']:.4f}  median {row['median']:.4f}  most {row['most']:.6f}  "
            f"above 1: {row['above']} of {row['n']}"
        )
    print(f"  {'nodes':16} {tally.nodes['search']} of {tally.nodes['everything']}")
    for level in LEVELS:
        mine, every = (tally.asked[side][level] for side in ("search", "everything"))
        print(f"  {level + ' problems':16} {mine} of {every} ({1.0 - mine / every:.0%} saved)")
    print(f"  another optimum in {len(tally.differ)} runs {tally.differ or ''}; wrong refusals: {tally.wrong_refusals}")
    return figures | {"another optimum": tally.differ, "wrong refusals": tally.wrong_refusals}


def refused(repeat: int = 5) -> dict[str, Any]:
    """Return the least milliseconds until the scene with its start table far away is refused, and the reason."""
    world = World(load_scene("screwdriver", {"tables.start.position": [3.0, 2.0]}))
    times = []
    for _ in range(repeat):
        began = time.perf_counter()
        far = plan(world.scene, None, world=world)
        times.append(time.perf_counter() - began)
    return {"milliseconds": 1e3 * min(times), "feasible": far.feasible, "reason": far.reason}


def main() -> None:
    """Count, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--depth", type=int, default=4)
    parser.add_argument("--cost", default="convex", help="dREBA model")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    world = World(load_scene("screwdriver"))
    costs = {"no ergonomics": None, options.cost: Ergonomics(world, dreba.load(options.cost))}
    tallies = {name: Tally() for name in costs}
    for run in range(options.runs):
        scene = world.scene.draw_heights(np.random.default_rng([0, run]))
        task = task_of(scene)
        for name, ergonomics in costs.items():
            compare(run, PathBounds(world.with_scene(scene), ergonomics), task, options.depth, tallies[name])
    figures = {name: show(name, tally) for name, tally in tallies.items()}
    far = refused()
    print(f"\nout of reach: refused in {far['milliseconds']:.1f} ms: {far['reason']}")
    print(f"\n{stamp()}")
    if options.json:
        options.json.parent.mkdir(parents=True, exist_ok=True)
        written = {"machine": machine(), "depth": options.depth, "figures": figures, "refused": far}
        options.json.write_text(json.dumps(written, indent=1))


if __name__ == "__main__":
    main()
