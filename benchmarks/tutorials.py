"""Problems of other projects as scenes of ours: two of rai-tutorials beside `robotic`, two of guided-tamp-benchmark.

    python benchmarks/tutorials.py [--robotic PYTHON --data FOLDER] [--saved FOLDER] [--only NAME ...] [--seconds 120]

- `lgp_single_pnp`, `lgp_bimanual_pnp`: the same robots, blocks and trays at the same places (in benchmarks/scenes).
  Each is solved by our search, and with the actions of `robotic` as a given sequence; the path of `robotic` gets the
  audit of ours. It needs an interpreter with `robotic` 0.4.0 (`python -m venv rai`, `rai/bin/pip install robotic==0.4.0
  numpy`, and Debian's liblapack3) and the folder `data` of https://github.com/MarcToussaint/rai-tutorials; without them
  ours is shown alone.
- `guided_shelf`, `guided_tunnel`: tasks 0 of guided-tamp-benchmark with its Panda, with the actions of their
  demonstrations and by our search. Its waiter is left out: its robot comes with that package
  (examples/scenes/waiter.toml is a task like it).

Seconds are those of the CPU. `--saved` keeps what `robotic` printed, and reads it the next time.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from machine import machine, stamp

import lgp
from lgp.kinematics.world import World
from lgp.plan_record import Plan
from lgp.scene.model import Scene

SCENES = Path(__file__).parent / "scenes"
RAI = ("lgp_single_pnp", "lgp_bimanual_pnp")
GUIDED = {
    "guided_shelf": ("grasp(panda.hand, box)", "place(panda.hand, box, table.shelf)"),
    "guided_tunnel": (
        "grasp(panda.hand, box)",
        "place(panda.hand, box, table.tunnel)",
        "grasp(panda.hand, box)",
        "place(panda.hand, box, table.far)",
    ),
}
"""Tasks of guided-tamp-benchmark, and the actions of their demonstrations."""
TRAY = 0.605
"""[m] Height of the trays in the tutorials, for the audit of their paths; those of our scenes are higher."""


def ours_of_action(action: list[str]) -> str:
    """An action of `robotic` as ours: `pick_touch objG table l_gripper` is `grasp(l.hand, objG)`."""
    name, item, *rest = action
    hands = [word.removesuffix("_gripper") + ".hand" for word in rest]
    if name == "pick_touch":
        return f"grasp({hands[1]}, {item})"
    if name == "place_straightOn":
        return f"place({hands[0]}, {item}, table.{rest[1]})"
    if name == "handover":
        return f"handover({hands[0]}, {item}, {hands[1]})"
    raise ValueError(f"{name}: no action of ours")


def rows_of_robotic(name: str, options: argparse.Namespace) -> list[dict[str, Any]]:
    """The plans of `robotic`, one each line that it prints; [] where it cannot run."""
    kept = options.saved and options.saved / f"{name}.jsonl"
    if kept and kept.is_file():
        return [json.loads(line) for line in kept.read_text(encoding="utf-8").splitlines()]
    if not (options.robotic and options.data):
        return skipped(name, "give --robotic PYTHON and --data FOLDER of rai-tutorials")
    if not (options.data / f"{name}.g").is_file():
        return skipped(name, f"{options.data} has no {name}.g, expected the folder `data` of rai-tutorials")
    script = Path(__file__).resolve().with_name("rai_lgp.py")
    found = shutil.which(options.robotic)
    if not found:
        return skipped(name, f"{options.robotic} is no program, expected a Python interpreter")
    # Absolute, as it runs in another folder, but no link is followed: those of a virtual environment make it one.
    words = [str(Path(found).absolute()), str(script), str(options.data.resolve()), name]
    with tempfile.TemporaryDirectory() as folder:
        run = subprocess.run(words, capture_output=True, text=True, check=False, cwd=folder)
    lines = [line for line in run.stdout.splitlines() if line.startswith("{")]
    if not lines:
        return skipped(name, (run.stderr.strip().splitlines() or ["it printed no plan"])[-1][:160])
    if kept:
        kept.parent.mkdir(parents=True, exist_ok=True)
        kept.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return [json.loads(line) for line in lines]


def skipped(name: str, why: str) -> list[dict[str, Any]]:
    """Print why a problem is not solved by `robotic`, and return no rows."""
    print(f"{name:18}robotic is skipped: {why}", flush=True)
    return []


def plan_of_robotic(scene: Scene, row: dict[str, Any]) -> Plan:
    """The path of `robotic` as a plan of the same scene, its phases as long as those of ours."""
    world = World(scene)
    actions = [ours_of_action(action) for action in row["plan"]]
    columns = [row["joints"].index(name.replace(".", "_")) for name in world.joints]
    path = np.array(row["q"])[:, columns]
    each = len(path) // len(actions)
    path = path[: each * len(actions)]
    numbered = [action.replace("(", f"({number}, ", 1) for number, action in enumerate(actions, start=1)]
    return Plan(
        scene=scene,
        feasible=True,
        status="given",
        reason="",
        joints=world.joints,
        start=np.array(row["start"])[columns],
        search={},
        actions=tuple(numbered),
        time=np.arange(1, len(path) + 1) * scene.phase_seconds / each,
        phase=np.repeat(np.arange(len(actions)), each),
        path=path,
    )


def solved(name: str, who: str, sequence: tuple[str, ...] | None, seconds: float) -> dict[str, Any]:
    """A plan of ours, from a search or with given actions."""
    started = time.process_time()
    plan = lgp.plan(SCENES / f"{name}.toml", cost=None, sequence=sequence, seconds=seconds)
    row = {"problem": name, "who": who, "seconds": time.process_time() - started, "verdict": plan.status}
    if not plan.feasible:
        return {**row, "actions": list(sequence or ()), "audit": plan.reason}
    return {**row, "actions": list(plan.actions), "audit": audited(plan)}


def audited(plan: Plan) -> str:
    """What the audit of ours finds, the largest of each kind."""
    found = lgp.audit_plan(plan)
    worst = {}
    for fault in found.faults:
        if fault.kind not in worst or worst[fault.kind].amount < fault.amount:
            worst[fault.kind] = fault
    if not worst:
        return "clean"
    return f"{len(found.faults)} faults: " + "; ".join(fault.what for fault in worst.values())


def compared(name: str, options: argparse.Namespace) -> list[dict[str, Any]]:
    """The rows of a problem of rai-tutorials."""
    rows, scene = [], lgp.load_scene(SCENES / f"{name}.toml")
    scene = scene.with_heights({tray: TRAY for tray in scene.tables if "tray" in tray})
    for theirs in rows_of_robotic(name, options)[:1]:
        actions = tuple(ours_of_action(action) for action in theirs["plan"])
        verdict = f"feasible {theirs['feasible']}, equalities {theirs['equality']:.2f}"
        audit = audited(plan_of_robotic(scene, theirs))
        seconds = theirs["search"] + theirs["path"]
        rows.append({"problem": name, "who": "robotic", "seconds": seconds, "verdict": verdict,
                     "actions": list(actions), "audit": audit})  # fmt: skip
        rows.append(solved(name, "ours, the actions of robotic", actions, options.seconds))
    return [*rows, solved(name, "ours", None, options.seconds)]


def show(row: dict[str, Any]) -> None:
    """Print a row."""
    print(f"{row['problem']:18}{row['who']:30}{row['seconds']:7.1f} s  {row['verdict']}")
    print(f"    {' '.join(row['actions'])}\n    audit: {row['audit']}", flush=True)


def main() -> None:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robotic", metavar="PYTHON", help="interpreter that has `robotic`")
    parser.add_argument("--data", type=Path, metavar="FOLDER", help="the folder `data` of rai-tutorials")
    parser.add_argument("--saved", type=Path, metavar="FOLDER", help="where to keep what `robotic` printed")
    parser.add_argument("--only", nargs="+", choices=[*RAI, *GUIDED], metavar="NAME")
    parser.add_argument("--seconds", type=float, default=120.0, help="longest time of a search")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    print(stamp())
    rows = []
    for name in options.only or [*RAI, *GUIDED]:
        if name in RAI:
            rows += compared(name, options)
        else:
            rows.append(solved(name, "ours, the demonstrated actions", GUIDED[name], options.seconds))
            rows.append(solved(name, "ours", None, options.seconds))
        for row in rows:
            if row["problem"] == name:
                show(row)
    if options.json:
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
