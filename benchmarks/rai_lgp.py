"""A problem of rai-tutorials in `robotic` (LGP_Tool of rai): run by `benchmarks/tutorials.py`, where it is installed.

    python benchmarks/rai_lgp.py DATA lgp_single_pnp [PLANS]

DATA is the folder `data` of the tutorials. Solves the problem as their notebook does, PLANS times (each gives the next
plan), and prints a JSON line for each: the plan, seconds of CPU of its search and of the path of its full motion, what
the solver says of that path, and its joints. The files are read from a copy in which the corners of the trays are as
round as `robotic` 0.4.0 takes them (1 mm; 5 mm is half of what a tray is thick).
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import robotic as ry


def main() -> None:
    """Print a line for each plan of the problem of the command line."""
    data, name = Path(sys.argv[1]), sys.argv[2]
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "rai-tutorials" / "data"
        copy.mkdir(parents=True)
        (Path(folder) / "rai-robotModels").symlink_to(ry.raiPath("../rai-robotModels"))
        for file in data.glob(f"{name}.*"):
            text = file.read_text(encoding="utf-8")
            (copy / file.name).write_text(text.replace("0.01, 0.005]", "0.01, 0.001]"), encoding="utf-8")
        solve(copy / f"{name}.g", int(sys.argv[3]) if len(sys.argv) > 3 else 1)


def solve(file: Path, plans: int) -> None:
    """Print a line for each plan of a configuration."""
    config = ry.Config()
    config.addFile(str(file))
    started = time.process_time()
    # The tool does not keep the abstraction alive.
    abstraction = ry.default_LGP_TAMP_Abstraction(config, str(file.with_suffix(".lgp")))
    tool = ry.LGP_Tool(config, abstraction)
    for _ in range(plans):
        tool.solve(0)
        searched = time.process_time()
        komo = tool.get_fullMotionProblem(True)
        verdict = ry.NLP_Solver(komo.nlp(), verbose=0).solve()
        solved = time.process_time()
        line = {
            "plan": [[str(word) for word in action] for action in tool.getSolvedPlan()],
            "search": searched - started,
            "path": solved - searched,
            "feasible": bool(verdict.feasible),
            "equality": float(verdict.eq),
            "inequality": float(verdict.ineq),
            "joints": [name.partition(":")[0] for name in config.getJointNames()],
            "start": np.asarray(config.getJointState()).tolist(),
            "q": np.asarray(komo.getPath()).tolist(),
        }
        sys.stdout.write(json.dumps(line) + "\n")
        sys.stdout.flush()
        started = time.process_time()


if __name__ == "__main__":
    main()
