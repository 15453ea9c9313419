"""Where the processor time of a plan goes: by level of the search, and of one path iteration.

    OMP_NUM_THREADS=1 python benchmarks/plan_time.py [SCENE ...] [--against OLDER] [--repeat 3] [--json FILE]

Of each scene the run with the least total is shown. `--against` is a folder with another version of the packages, which
is run in turn, so that both see the same load. Imports are not part of a plan's time and are listed apart.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

SCENES = ("screwdriver", "screwdriver_panda")


def measured(scene: str) -> dict[str, Any]:
    """Return the processor times [s] of one plan, its cost, and whether its audit is clean."""
    begin = time.process_time()
    import lgp
    from lgp.path.bounds import PathBounds
    from lgp.planner import plan
    from lgp.sqp.solver import Solver

    imported = time.process_time()
    spent: Counter[str] = Counter()
    counted: Counter[str] = Counter()

    def timed(owner: type, name: str, label: Callable[..., tuple[str, Callable[[Any], int]]]) -> None:
        original = getattr(owner, name)

        def run(*args: Any, **options: Any) -> Any:
            start = time.process_time()
            result = original(*args, **options)
            key, count = label(*args)
            spent[key] += time.process_time() - start
            counted[key] += count(result)
            return result

        setattr(owner, name, run)

    def kind_of(_: Any, problem: Any, *__: Any) -> tuple[str, Callable[[Any], int]]:
        rows = getattr(problem.constraints, "in_rows", [])
        colliding = any(row.kind == "collision" for row in rows)
        on_all = len(problem.knots) == problem.phases.total
        key = ("collision rows" if colliding else "path") if on_all else "keyframes"
        return f"iteration, {key}", lambda result: len(result.iterations) - 1

    timed(PathBounds, "solve", lambda _, level, *__: (level, lambda result: 1))
    timed(Solver, "solve", kind_of)
    start = time.process_time()
    found = plan(lgp.load_scene(scene))
    total = time.process_time() - start
    return {
        "scene": scene,
        "imports": imported - begin,
        "plan": total,
        "cost": found.costs["total"],
        "clean": found.audit["clean"],
        "spent": {key: [spent[key], counted[key]] for key in spent},
    }


def in_process(scene: str, folder: Path) -> dict[str, Any]:
    """Return what a fresh interpreter measures with the packages of a folder."""
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    command = [sys.executable, __file__, "--one", scene]
    return dict(json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout))


def show(name: str, figures: dict[str, Any]) -> None:
    """Print one plan."""
    print(f"  {name}: {figures['plan']:.2f} s (imports {figures['imports']:.2f}), cost {figures['cost']:.4f}, ", end="")
    print("clean" if figures["clean"] else "not clean")
    for key, (seconds, count) in sorted(figures["spent"].items()):
        print(f"    {key:26} {count:5d} {seconds:7.2f} s {1e3 * seconds / max(count, 1):8.2f} ms each")


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES, metavar="SCENE")
    parser.add_argument("--against", type=Path, metavar="OLDER", help="folder with another version")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measured(options.one)))
        return
    from machine import machine, stamp

    print(stamp())
    rows = []
    versions = {"this version": Path(__file__).resolve().parents[1]}
    if options.against:
        versions["the older one"] = options.against.resolve()
    for scene in options.scenes:
        runs = [{name: in_process(scene, folder) for name, folder in versions.items()} for _ in range(options.repeat)]
        print(scene)
        for name in versions:
            rows.append({"version": name, **min((run[name] for run in runs), key=lambda run: run["plan"])})
            show(name, rows[-1])
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}))


if __name__ == "__main__":
    main()
