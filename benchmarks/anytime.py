"""Anytime behaviour of the search: cost of the best plan over CPU time, here and in other versions of this package.

    OMP_NUM_THREADS=1 python benchmarks/anytime.py [SCENE ...] [--seconds 60] [--against FOLDER ...] [--json FILE]

Each FOLDER is a checkout of another version, measured in the same run, one process at a time. Without a scene: one and
three of three boxes are brought to a table, by a person or a Panda. CPU seconds depend less on other load than
wall-clock time; a limit of `--seconds` is one of CPU time. Time itself costs nothing here.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

from machine import machine, stamp

MARKS = (1.0, 3.0, 10.0, 30.0, 60.0, 120.0)
"""CPU seconds at which the best cost is printed."""
BOXES = """title = "{count} of three boxes to one table, by a person or a robot"
domain = "screwdriver"
depth = 6
initial = ["on_table(a)", "on_table(b)", "on_table(c)", "free(human.right_hand)", "free(panda.hand)"]
goal = [{goal}]
human = {{ stature = 1.72, hands = ["right_hand"], tilt = 100 }}
robots.panda = {{ model = "panda", position = [1.15, 0.05, 0.75], yaw = 180, hands.hand = {{ tilt = 90 }} }}
tables.near = {{ position = [0.62, 0.0], size = [0.3, 0.8], height = 0.9 }}
tables.far = {{ position = [1.25, -0.6], size = [0.4, 0.3], height = 0.9 }}
objects.a = {{ size = [0.12, 0.05, 0.08], mass = 0.8, on = "table.far", at = [-0.1, 0, 0] }}
objects.b = {{ size = [0.12, 0.05, 0.08], mass = 0.8, on = "table.far", at = [0.1, 0, 0] }}
objects.c = {{ size = [0.12, 0.05, 0.08], mass = 0.8, on = "table.far", at = [0, 0.1, 0] }}
"""


def curve(scene: str, seconds: float, collisions: bool) -> dict[str, Any]:
    """Plan a scene; return the incumbents by CPU time, problems solved, status, gap, and when the search ended."""
    import lgp
    from lgp.path.bounds import PathBounds
    from lgp.path.costs import Weights

    incumbents: list[tuple[float, float]] = []
    problems: Counter[str] = Counter()
    began = time.process_time()
    solve = PathBounds.solve

    def watched(self: Any, level: str, *rest: Any, **more: Any) -> Any:
        if time.process_time() - began > seconds:
            raise KeyboardInterrupt  # which ends a search with the best plan so far
        result = solve(self, level, *rest, **more)
        problems[level] += not result.known
        if level == "path" and result.cost < min([cost for _, cost in incumbents], default=float("inf")):
            incumbents.append((time.process_time() - began, result.cost))
        return result

    PathBounds.solve = watched  # type: ignore[method-assign]  # works in every version
    # Older versions have no cost of time; without it all costs compare.
    weights = Weights(**{name: 0.0 for name in Weights.__dataclass_fields__ if name == "time"})
    plan = lgp.plan(scene, collisions=collisions, weights=weights)
    return {
        "package": str(Path(lgp.__file__).parent.parent),
        "scene": scene,
        "incumbents": incumbents,
        "problems": dict(problems),
        "status": plan.status,
        "gap": plan.search["gap"],
        "actions": list(plan.actions),
        "cpu_seconds": time.process_time() - began,
    }


def measure(folder: str, scene: str, seconds: float, collisions: bool) -> dict[str, Any]:
    """Measure a version in a process of its own."""
    command = [sys.executable, __file__, scene, "--one", "--seconds", str(seconds)]
    command += [] if collisions else ["--no-collisions"]
    environment = {"PYTHONPATH": folder, "OMP_NUM_THREADS": "1", "PATH": "/usr/bin:/bin"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout.splitlines()[-1]))


def main() -> None:
    """Print one line for each scene and version."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--seconds", type=float, default=60.0, help="CPU time of each search")
    parser.add_argument("--against", nargs="+", default=[], metavar="FOLDER", help="checkouts of other versions")
    parser.add_argument("--no-collisions", dest="collisions", action="store_false")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(curve(options.scenes[0], options.seconds, options.collisions)))
        return
    with tempfile.TemporaryDirectory() as folder:
        scenes = options.scenes or boxes(Path(folder))
        versions = [str(Path(__file__).resolve().parent.parent), *options.against]
        rows = []
        for scene in scenes:
            for version in versions:
                rows.append(measure(version, scene, options.seconds, options.collisions))
                show(rows[-1])
    print(f"\n{stamp()}")
    if options.json:
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1))


def boxes(folder: Path) -> list[str]:
    """Write the scenes of one and of three boxes."""
    files = []
    for count, names in (("one", "a"), ("three", "abc")):
        goal = ", ".join(f'"placed({name}, table.near)"' for name in names)
        files.append(folder / f"{count}_of_three.toml")
        files[-1].write_text(BOXES.format(count=count.capitalize(), goal=goal))
    return [str(file) for file in files]


def show(row: dict[str, Any]) -> None:
    """Print the best cost at each mark, and how the search ended."""
    print(f"{Path(row['scene']).name} with {row['package']}")
    reached = [mark for mark in MARKS if mark <= row["cpu_seconds"]]
    at = {mark: min([c for t, c in row["incumbents"] if t <= mark], default=None) for mark in reached}
    costs = (f"{mark:g} s {'-' if cost is None else format(cost, '.3f')}" for mark, cost in at.items())
    print("  best after " + ", ".join(costs))
    print("  incumbents " + ", ".join(f"{cost:.2f} at {at:.1f} s" for at, cost in row["incumbents"]))
    counts = ", ".join(f"{number} {level}" for level, number in row["problems"].items())
    print(f"  {row['status']}, gap {row['gap']:.1%} after {row['cpu_seconds']:.1f} s of CPU; {counts}", flush=True)


if __name__ == "__main__":
    main()
