"""Growth of search and path problems with the number of actions: the toolbox of two, three and four parts.

    OMP_NUM_THREADS=1 python benchmarks/toolbox.py [--parts 2 3 4] [--seconds 300] [--cost NAME] [--collisions]

The parts are those of the scene `toolbox_full`, in its order: 8, 14 and 20 actions at least. For each number of parts,
two lines of CPU seconds, which depend less on other load than wall-clock time:
- search: until the best plan is proven or the time limit is reached, with the remaining gap;
- given: the actions of that plan without a search: time of poses, sequence and path alone.
"""

from __future__ import annotations

import argparse
import json
import time
import tomllib
from pathlib import Path
from typing import Any

from machine import machine, stamp

import lgp
from lgp.kinematics.world import World
from lgp.planner import task_of
from lgp.scene.model import Scene
from lgp.scene.scene_file import SHIPPED, read_scene

SCENE = "toolbox_full"
BRING, FASTEN = 3, 3
"""Actions that bring a part, and that fasten and release one; the last one is not released."""


def scene_of(parts: int) -> Scene:
    """Scene with its first parts only."""
    values = tomllib.loads((SHIPPED / f"{SCENE}.toml").read_text(encoding="utf-8"))
    included, excluded = list(values["objects"])[:parts], list(values["objects"])[parts:]
    for key in ("initial", "goal"):
        values[key] = [atom for atom in values[key] if not any(part in atom for part in excluded)]
    values["objects"] = {part: values["objects"][part] for part in included}
    values["joints"] = [joint for joint in values["joints"] if set(joint["parts"]) <= set(included)]
    values["depth"] = BRING * parts + FASTEN * (parts - 1) - 1
    return read_scene(values, f"toolbox of {parts}")


def row_of(what: str, parts: int, plan: lgp.Plan, seconds: float) -> dict[str, Any]:
    """Figures of one plan."""
    search = plan.search
    return {
        "what": what,
        "parts": parts,
        "actions": len(plan.actions),
        "status": plan.status,
        "reason": plan.reason,
        "cost": plan.costs.get("total"),
        "gap": search["gap"],
        "expanded": search["expanded"],
        **{level: numbers["solved"] for level, numbers in search["levels"].items()},
        "cpu_seconds": seconds,
        "level_seconds": {level: numbers["seconds"] for level, numbers in search["levels"].items()},
        "sequence_of_actions": list(plan.actions),
    }


def measure(parts: int, seconds: float, cost: str | None, collisions: bool) -> list[dict[str, Any]]:
    """Rows for one number of parts."""
    scene = scene_of(parts)
    world, rows = World(scene), []
    task = task_of(scene)
    options: dict[str, Any] = {"world": world, "collisions": collisions}
    start = time.process_time()
    plan = lgp.plan(scene, cost, seconds=seconds, **options)
    rows.append(row_of("search", parts, plan, time.process_time() - start))
    rows[-1]["ground_actions"], rows[-1]["atoms"] = len(task.actions), len(task.atoms)
    if plan.feasible:
        start = time.process_time()
        followed = lgp.plan(scene, cost, sequence=plan.actions, **options)
        rows.append(row_of("given", parts, followed, time.process_time() - start))
    return rows


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", type=int, nargs="+", default=[2, 3, 4], choices=[2, 3, 4])
    parser.add_argument("--seconds", type=float, default=300.0, help="wall-clock time of each search")
    parser.add_argument("--cost", help="dREBA model; acceleration cost only without it")
    parser.add_argument("--collisions", action="store_true", help="collision-free paths")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    print(stamp())
    names = f"{'cost':>8} {'gap':>6} {'nodes':>6} {'poses':>6} {'seqs':>5} {'paths':>5} {'CPU s':>7}"
    print(f"{'parts':>5} {'':7}{'actions':>7} {names}  status")
    rows = []
    for parts in arguments.parts:
        for row in measure(parts, arguments.seconds, arguments.cost, arguments.collisions):
            rows.append(row)
            cost = "-" if row["cost"] is None else f"{row['cost']:.3f}"
            print(
                f"{parts:5d} {row['what']:7}{row['actions']:7d} {cost:>8} {row['gap']:6.2f} {row['expanded']:6d} "
                f"{row['pose']:6d} {row['sequence']:5d} {row['path']:5d} {row['cpu_seconds']:7.1f}  {row['status']}",
                flush=True,
            )
    if arguments.json:
        arguments.json.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
