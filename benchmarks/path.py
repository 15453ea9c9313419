"""One path problem of human and robot: time, iterations and violation, beside `robotic` KOMO on the same problem.

    OMP_NUM_THREADS=1 python benchmarks/path.py [--komo PYTHON] [--repeat 5] [--json FILE]

Four phases with 43 joints: Baxter grasps the screwdriver and places it, the human grasps it and places it elsewhere.
- "the same problem in KOMO": 20 slices a phase, a quadratic posture cost, no collisions, both warm from their own key
  frames; costs and violations of both paths are worked out here by the same functions. KOMO runs in an interpreter
  that has it: `python -m venv komo && komo/bin/pip install robotic numpy` (and Debian's liblapack3), then
  `--komo komo/bin/python`. Without one, ours is shown alone.
- the shipped ergonomic cost, 10 slices a phase, without collisions and with them;
- growth over the slices, and over the objects carried one after the other.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from komo_scene import HOMING, JointCost, scene_text, task_text
from machine import machine, stamp

import dreba
from lgp.kinematics.world import World
from lgp.logic.task import Action
from lgp.path.bounds import PathBounds
from lgp.path.collision_path import solve_constrained
from lgp.path.ergonomics import Ergonomics
from lgp.path.keyframes import Solution
from lgp.path.paths import OPTIONS
from lgp.path.problem import PathProblem
from lgp.planner import task_of
from lgp.scene.scene_file import load_scene, read_scene
from lgp.sqp.problem import SolverOptions
from lgp.sqp.result import Result
from lgp.sqp.solver import Solver

LINES = (
    "grasp(baxter.right, {thing})",
    "place(baxter.right, {thing}, table.center)",
    "grasp(human.right_hand, {thing})",
    "place(human.right_hand, {thing}, table.right)",
)
HEIGHTS = {"left": 0.9, "center": 1.0, "right": 0.95}
SOLVED = SolverOptions(violation=1e-6, kkt=1e-5, decrease=1e-4, iterations=60)
"""Cost to four digits, as in what KOMO's default reaches; rows to a micrometre."""
TOLERANCES = {"KOMO, default": None, "KOMO, tight": 2e-4}
"""Where KOMO stops; the second is among the loosest at which it calls some of its paths feasible."""


def world_of(objects: int = 1, *, locked: bool = False) -> World:
    """Return the world of the benchmark.

    Args:
        objects: on the start table.
        locked: for KOMO: legs that are not solved for.
    """
    shipped = load_scene("screwdriver")
    thing = dict(shipped.values["objects"]["screwdriver"])
    spots = zip(("screwdriver", "second", "third", "fourth"), (-0.08, -0.03, 0.03, 0.08), strict=True)
    things = {name: thing | {"at": [0.0, y if objects > 1 else 0.0, 0.0]} for name, y in list(spots)[:objects]}
    initial = ["free(human.right_hand)", "free(baxter.left)", "free(baxter.right)"]
    initial += [atom for name in things for atom in (f"placed({name}, table.start)", f"on_table({name})")]
    values = {**shipped.values, "objects": things, "initial": initial}
    if locked:
        values["human"] = {**shipped.values["human"], "legs": "locked"}
    return World(read_scene(values, "benchmark").with_heights(HEIGHTS))


def actions_of(world: World) -> tuple[Action, ...]:
    """Return the four actions with every object of the scene, one after the other."""
    task = task_of(world.scene)
    return tuple(task.action(line.format(thing=thing)) for thing in world.scene.objects for line in LINES)


def keyframes_of(bounds: PathBounds, actions: tuple[Action, ...]) -> Solution:
    """Return the keyframes of a sequence.

    Raises:
        SystemExit: the sequence is infeasible.
    """
    result = None
    for end in range(len(actions)):
        result = bounds.solve("pose", actions[: end + 1], result)
    result = bounds.solve("sequence", actions, result)
    if not result.feasible:
        raise SystemExit(f"no keyframes: {result.reason}")
    return result.payload


def best(repeat: int, work: Callable[[], Any]) -> tuple[float, Any]:
    """Return the least time of some runs [ms], and the last result."""
    times, result = timed(repeat, work)
    return min(times), result


def timed(repeat: int, work: Callable[[], Any]) -> tuple[list[float], Any]:
    """Return the times of some runs [ms], and the last result."""
    times = []
    for _ in range(repeat):
        begin = time.perf_counter()
        result = work()
        times.append(1e3 * (time.perf_counter() - begin))
    return times, result


def warm_row(case: str, bounds: PathBounds, actions: tuple[Action, ...], repeat: int) -> dict[str, Any]:
    """Return one row: a path solved from its keyframes, its set-up timed separately."""
    keys_ms, keyframes = best(1, lambda: keyframes_of(bounds, actions))
    phases = bounds.phases(actions)
    sequence = bounds.problem("sequence", phases)
    path = sequence.path(sequence.join(keyframes.keyframes, keyframes.variables))
    setup_ms, problem = best(repeat, lambda: bounds.problem("path", phases))
    x = problem.join(path, keyframes.variables)
    times, free = timed(repeat, lambda: Solver(bounds.options).solve(problem, x))
    row = describe(case, problem, free) | {"ms": min(times), "keys_ms": keys_ms, "setup_ms": setup_ms}
    row |= {"median_ms": float(np.median(times))}
    if bounds.collisions:
        ms, (problem, result) = best(repeat, lambda: collision_free(bounds, phases, free))
        rows = bounds.paths.collision_constraints(phases)
        row = describe(case, problem, result) | {"ms": ms, "keys_ms": keys_ms, "setup_ms": setup_ms}
        row |= {"free_ms": min(times), "penetration": rows.deepest_penetration(*problem.split(result.x))[0]}
        active = [
            y for y, about in zip(result.y_in, problem.constraints.in_rows, strict=True) if about.kind == "collision"
        ]
        row |= {"rows": len(active), "active": int(np.count_nonzero(np.array(active) > 1e-6))}
    return row


def collision_free(bounds: PathBounds, phases: Any, free: Result) -> tuple[PathProblem, Result]:
    """Return the problem and result with collision constraints, from the free path."""
    rows = bounds.paths.active(phases)
    return solve_constrained(lambda given: bounds.problem("path", phases, active=given), rows, free, bounds.options)


def describe(case: str, problem: PathProblem, result: Result) -> dict[str, Any]:
    """Return the figures of a result."""
    return {
        "case": case,
        "slices": problem.phases.total,
        "unknowns": problem.n,
        "iterations": len(result.iterations) - 1,
        "violation": result.violation,
        "cost": result.cost,
        "status": result.status.name.lower(),
        "parts_ms": {part: round(1e3 * seconds, 1) for part, seconds in result.seconds.items()},
    }


def beside_komo(python: str | None, repeat: int) -> list[dict[str, Any]]:
    """Return our row and, given an interpreter with `robotic`, those of KOMO."""
    world = world_of(locked=True)
    actions = actions_of(world)
    cost: Any = JointCost(world)
    bounds = PathBounds(world, cost, slices=20, options=SOLVED)
    rows = [warm_row("ours", bounds, actions, 4 * repeat)]
    if python is None:
        return rows
    phases = bounds.phases(actions)
    problem = bounds.problem("path", phases)
    words = task_text(world, phases, keyframes_of(bounds, actions).keyframes, cost, TOLERANCES, repeat)
    with tempfile.TemporaryDirectory() as folder:
        task, scene = Path(folder) / "task.json", Path(folder) / "scene.g"
        task.write_text(json.dumps(words), encoding="utf-8")
        scene.write_text(scene_text(world), encoding="utf-8")
        script = Path(__file__).resolve().with_name("komo.py")
        command = [str(Path(python).absolute()), str(script), str(task), str(scene)]
        # KOMO leaves a log where it runs.
        ran = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    if ran.returncode:
        sys.stderr.write(f"{python} could not run KOMO: {ran.stderr.strip().splitlines()[-1:]}\n")
        return rows
    for line in ran.stdout.splitlines():
        row = json.loads(line)
        path = np.array(row.pop("path"))
        variables = problem.modes.guess(path[phases.keyframes])
        values = problem.constraints.evaluate(path, variables).equality
        poses = np.array([info.kind == "pose_continuity" for info in problem.constraints.eq_rows])
        cost_here = problem.costs(problem.join(path, variables)).total
        row |= {"slices": phases.total, "iterations": row.pop("evaluations"), "cost": cost_here}
        # KOMO constrains resting limbs differently, so only grasps and placements are compared.
        row |= {
            "violation": float(np.abs(values[poses]).max()),
            "status": f"feasible in {row.pop('good')} of {row.pop('runs')}",
        }
        rows.append(row)
    return rows


def growth(repeat: int) -> list[dict[str, Any]]:
    """Return rows over 20 to 320 slices, and over 1 to 4 objects with 10 slices a phase."""
    world = world_of()
    ergonomics = Ergonomics(world, dreba.load("convex"))
    rows = []
    for slices in (5, 10, 20, 40, 80):
        bounds = PathBounds(world, ergonomics, slices=slices, options=SOLVED)
        rows.append(warm_row(f"{4 * slices} slices", bounds, actions_of(world), repeat))
    for count in (1, 2, 3, 4):
        several = world_of(count)
        bounds = PathBounds(several, ergonomics, slices=10, options=SOLVED)
        rows.append(warm_row(f"{count} objects", bounds, actions_of(several), repeat))
    return rows


def show(rows: list[dict[str, Any]]) -> None:
    """Print rows as a table."""
    for row in rows:
        more = "".join(
            f", {words} {row[key]:{form}}"
            for key, words, form in (
                ("median_ms", "median", ".0f"),
                ("keys_ms", "key frames", ".0f"),
                ("setup_ms", "set up", ".1f"),
                ("free_ms", "first without", ".0f"),
                ("rows", "collision rows", "d"),
                ("active", "active", "d"),
                ("penetration", "deepest [m]", ".4f"),
            )
            if key in row
        )
        print(
            f"{row['case']:16} {row['unknowns']:6d} unknowns {row['ms']:9.1f} ms {row['iterations']:4d} its "
            f"violation {row['violation']:.1e} cost {row['cost']:9.4f} {row['status']}{more}",
            flush=True,
        )


def slope(rows: list[dict[str, Any]], by: Callable[[dict[str, Any]], float]) -> float:
    """Return the exponent with which time grows."""
    return float(np.polyfit(np.log([by(row) for row in rows]), np.log([row["ms"] for row in rows]), 1)[0])


def main() -> None:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--komo", metavar="PYTHON", help="interpreter that has `robotic`")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--no-growth", action="store_true", help="leave out how time grows with slices and objects")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    print(stamp())
    same = beside_komo(options.komo, options.repeat)
    print(f"\nthe same problem in KOMO (homing {HOMING}, quadratic posture cost):")
    show(same)
    for row in same[1:]:
        fastest, median = (row[key] / same[0][key] for key in ("ms", "median_ms"))
        print(f"{row['case']}: {fastest:.1f} times ours by the fastest runs, {median:.1f} times by medians")
    world = world_of()
    ergonomics = Ergonomics(world, dreba.load("convex"))
    print("\nshipped cost, 4 x 10 slices, without collisions and with:")
    cases = [("without", False), ("with collisions", True)]
    plain = [
        warm_row(name, PathBounds(world, ergonomics, options=OPTIONS, collisions=on), actions_of(world), options.repeat)
        for name, on in cases
    ]
    show(plain)
    grown = [] if options.no_growth else growth(min(options.repeat, 3))
    if grown:
        print("\ngrowth:")
        show(grown)
        print(f"time grows as slices^{slope(grown[:5], lambda row: row['slices']):.2f}", end=", ")
        print(f"as objects^{slope(grown[5:], lambda row: row['slices']):.2f}")
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "same": same, "plain": plain, "growth": grown}))


if __name__ == "__main__":
    main()
