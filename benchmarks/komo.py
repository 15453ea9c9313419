"""The path problem of `benchmarks/path.py` in `robotic` (KOMO of rai): run by that script, where it is installed.

    python benchmarks/komo.py TASK.json SCENE.g

The task file holds the switches, weights and tolerances; each solve prints a JSON line. Modes are `stable` (the pose of
an object in the hand is one free variable of the mode), switches are those of KOMO, constraints are scaled by 10, and
the initial guess is KOMO's interpolation of its own keyframes, which are solved from ours: there are many local optima.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import robotic as ry

SCALE = [1e1]


def make(config: Any, task: dict[str, Any], slices: int, order: int) -> Any:
    """KOMO problem with `slices` per phase, of order 1 for keyframes and 2 for paths."""
    komo = ry.KOMO(config, float(len(task["switches"])), slices, order, False)
    seconds, home = task["seconds"], np.array(task["home"])
    # KOMO counts phases as seconds: accelerations are divided by seconds^2, integrals multiplied by seconds.
    scale = seconds**-1.5 if order == 2 else 1e-2
    komo.addControlObjective([], order, scale)
    for joint, (weight, target) in task["weights"].items():
        share = np.sqrt(weight * seconds / slices)
        komo.addObjective([], ry.FS.qItself, [joint], ry.OT.sos, [share], [target])
    komo.addControlObjective([], 0, np.sqrt(task["homing"] * seconds), home)
    komo.addQuaternionNorms()
    thing = task["thing"]
    for number, switch in enumerate(task["switches"], start=1):
        end = number + 1.0 if number < len(task["switches"]) else -1.0
        hand, time_ = switch["hand"], [float(number)]
        if switch["kind"] == "grasp":
            komo.addModeSwitch([float(number), end], ry.SY.stable, [hand, thing], number == 1)
            komo.addObjective(time_, ry.FS.positionDiff, [hand, thing], ry.OT.eq, SCALE)
        else:
            add_place(komo, switch, thing, time_, end)
        # z of the hand against straight down: cos(limit) - (-z . up) <= 0.
        limit = float(np.cos(np.radians(switch["tilt"])))
        komo.addObjective(time_, ry.FS.scalarProductZZ, ["world", hand], ry.OT.ineq, SCALE, [-limit])
    if order == 2:
        komo.addObjective([float(len(task["switches"]))], ry.FS.qItself, [], ry.OT.eq, [1.0], [], 1)
    return komo


def add_place(komo: Any, switch: dict[str, Any], thing: str, time_: list[float], end: float) -> None:
    """Constrain the object to lie level on a table top, within its borders."""
    table, (x, y), z = switch["table"], switch["reach"], switch["above"]
    komo.addModeSwitch([time_[0], end], ry.SY.stable, [table, thing], False)
    rows = np.array([[0.0, 0.0, 1e1]])
    komo.addObjective(time_, ry.FS.positionRel, [thing, table], ry.OT.eq, rows, [0.0, 0.0, z])
    for axis in (ry.FS.scalarProductXZ, ry.FS.scalarProductYZ):
        komo.addObjective(time_, axis, [thing, table], ry.OT.eq, SCALE)
    flat = np.array([[1e1, 0.0, 0.0], [0.0, 1e1, 0.0]])
    komo.addObjective(time_, ry.FS.positionRel, [thing, table], ry.OT.ineq, flat, [x, y, 0.0])
    komo.addObjective(time_, ry.FS.positionRel, [thing, table], ry.OT.ineq, -flat, [-x, -y, 0.0])


def solve(config: Any, task: dict[str, Any], tolerance: float | None, order: np.ndarray) -> dict[str, Any]:
    """Times and path of one solve, warm-started from KOMO's keyframes."""
    begin = time.perf_counter()
    keys = make(config, task, 1, 1)
    keys.initWithPath(np.array(task["keys"])[:, np.argsort(order)])
    ry.NLP_Solver(keys.nlp(), verbose=0).solve(0)
    waypoints = keys.getPath_qAll()
    between = time.perf_counter()
    komo = make(config, task, task["slices"], 2)
    nlp = komo.nlp()
    komo.initWithWaypoints(waypoints, 1, True)
    solver = ry.NLP_Solver(nlp, verbose=0)
    solver.setOptions(verbose=0, **({} if tolerance is None else {"stopTolerance": tolerance}))
    ready = time.perf_counter()
    result = solver.solve(0)
    done = time.perf_counter()
    path = np.array(komo.getPath())[:, order]
    return {
        "unknowns": int(nlp.getDimension()),
        "keys_ms": 1e3 * (between - begin),
        "setup_ms": 1e3 * (ready - between),
        "ms": 1e3 * (done - ready),
        "evaluations": int(result.evals),
        "feasible": bool(result.feasible),
        "scaled_equality": float(result.eq),
        "path": path.tolist(),
    }


def main() -> None:
    """Solve the task several times with each tolerance."""
    task = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    config = ry.Config()
    config.addFile(sys.argv[2])
    names = [name.split(":")[0] for name in config.getJointNames()]
    order = np.array([names.index(name) for name in task["joints"]])
    home = np.zeros(len(names))
    home[order] = task["home"]
    config.setJointState(home)
    task["home"] = home.tolist()
    for name, tolerance in task["tolerances"].items():
        # Results differ between runs. With the default the fastest run is reported, feasible or not; with a tighter
        # tolerance the fastest feasible one, if any.
        runs = [solve(config, task, tolerance, order) for _ in range(task["repeat"])]
        best = min(runs, key=lambda row, asked=tolerance is not None: (asked and not row["feasible"], row["ms"]))
        good = sum(row["feasible"] for row in runs)
        median = float(np.median([row["ms"] for row in runs]))
        row = {"case": name, **best, "median_ms": median, "good": good, "runs": len(runs)}
        sys.stdout.write(json.dumps(row) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
