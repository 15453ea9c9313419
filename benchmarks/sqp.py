"""The sequential quadratic programming solver on path problems of 42 joints, by number of slices.

    OMP_NUM_THREADS=1 python benchmarks/sqp.py [--json FILE] [--slices 20 40 80] [--repeat 3]

The problem is `tests/support/sliced_paths.py`: accelerations, a dense posture cost on 23 joints, 76 nonlinear
equalities at four key slices, joint limits everywhere, optionally 8 pairs of spheres in every slice. Three tables, all
in milliseconds and the best of several runs:
- one QP (the third of a solve from rest) by back end, the active set cold and warm;
- whole solves: from rest, and warm from the path to places 1 cm away; also by PIQP, and with spheres;
- infeasible places out of reach.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from machine import machine

from lgp.sqp.active_set import ActiveSet
from lgp.sqp.backends import Piqp, QpSolvers
from lgp.sqp.problem import SolverOptions
from lgp.sqp.qp import QP, QPBackend, QPResult, residuals
from lgp.sqp.result import Result
from lgp.sqp.solver import Solver
from lgp.sqp.subproblem import SubproblemSolver
from tests.support.sliced_paths import PathProblem

SLICES = (20, 40, 80, 160, 320)
OPTIONS = SolverOptions(decrease=1e-4)
MARGIN = 0.4
BUDGET = 20.0
"""[s] Time limit of a solve by a slow back end."""


def best(work: Callable[[], Any], repeat: int) -> tuple[float, Any]:
    """Return the least milliseconds of several runs, and the last result."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times), result


def third_qp(problem: PathProblem) -> QP:
    """Return the QP of the third step of a solve from rest."""
    after = Solver(SolverOptions(iterations=2)).solve(problem, problem.start())
    model = problem.linearise(after.x, after.y_eq, after.y_in)
    return SubproblemSolver().qp(problem, model, after.x)


def qp_rows(slices: int, repeat: int) -> list[dict[str, Any]]:
    """Time one QP by back end."""
    qp = third_qp(PathProblem(slices))
    active = ActiveSet()
    solution = active.solve(qp)
    cases: list[tuple[str, QPBackend, QPResult | None]] = [
        ("active set cold", active, None),
        ("active set warm", active, solution),
        ("piqp", Piqp(), None),
        ("clarabel", QpSolvers("clarabel"), None),
    ]
    rows = []
    for name, backend, warm in cases:
        backend.solve(qp, warm)
        milliseconds, result = best(lambda backend=backend, warm=warm: backend.solve(qp, warm), repeat)
        errors = residuals(qp, result)
        rows.append(
            {
                "table": "qp",
                "slices": slices,
                "case": name,
                "ms": milliseconds,
                "iterations": result.iterations,
                "status": result.status.name,
                "violation": errors.primal,
                "cost": qp.objective(result.x),
            }
        )
    return rows


def solve_row(name: str, slices: int, repeat: int, work: Callable[[], Result]) -> dict[str, Any]:
    """Time a whole solve."""
    milliseconds, result = best(work, repeat)
    return {
        "table": "solve",
        "slices": slices,
        "case": name,
        "ms": milliseconds,
        "iterations": len(result.iterations) - 1,
        "status": result.status.name,
        "violation": result.violation,
        "cost": result.cost,
        "parts_ms": {part: 1e3 * seconds for part, seconds in result.seconds.items()},
    }


def solve_rows(slices: int, repeat: int) -> list[dict[str, Any]]:
    """Time whole solves: from rest, warm, by PIQP, with spheres, and out of reach."""
    problem, near, far = PathProblem(slices), PathProblem(slices, shift=0.01), PathProblem(slices, shift=0.7)
    spheres, warmer = PathProblem(slices, spheres=True, margin=MARGIN), Solver(OPTIONS)
    # Warm starts; not timed.
    path, sphere_solver = warmer.solve(problem, problem.start()), Solver(OPTIONS)
    nearby = sphere_solver.solve(spheres, spheres.start())
    other = PathProblem(slices, shift=0.01, spheres=True, margin=MARGIN)
    slow = SolverOptions(decrease=OPTIONS.decrease, seconds=BUDGET)
    return [
        solve_row("from rest", slices, repeat, lambda: Solver(OPTIONS).solve(problem, problem.start())),
        solve_row("warm, places 1 cm away", slices, repeat, lambda: warmer.solve(near, path.x, warm=path)),
        solve_row("warm, PIQP", slices, 1, lambda: Solver(slow, Piqp()).solve(near, path.x, warm=path)),
        solve_row("spheres, from rest", slices, 1, lambda: Solver(OPTIONS).solve(spheres, spheres.start())),
        solve_row("spheres, warm", slices, repeat, lambda: sphere_solver.solve(other, nearby.x, warm=nearby)),
        solve_row("out of reach", slices, 1, lambda: Solver(slow).solve(far, far.start())),
    ]


def main() -> None:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--slices", type=int, nargs="+", default=SLICES)
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    rows = []
    print(f"{'T':>4} {'case':24} {'ms':>8} {'steps':>5} {'violation':>9} {'cost':>11}  status")
    for measure in (qp_rows, solve_rows):
        for slices in options.slices:
            for row in measure(slices, options.repeat):
                rows.append(row)
                print(
                    f"{slices:4d} {row['case']:24} {row['ms']:8.1f} {row['iterations']:5d} {row['violation']:9.1e} "
                    f"{row['cost']:11.5f}  {row['status'].lower()}",
                    flush=True,
                )
    for name in ("from rest", "warm, places 1 cm away"):
        chosen = [row for row in rows if row["case"] == name]
        if len(chosen) > 1:
            growth = np.polyfit(np.log([r["slices"] for r in chosen]), np.log([r["ms"] for r in chosen]), 1)[0]
            print(f"{name}: time grows as T^{growth:.2f}")
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1))


if __name__ == "__main__":
    main()
