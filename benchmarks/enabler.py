"""True REBA score at the minimum of each surrogate on reach tasks.

Usage: python benchmarks/enabler.py [--tasks 40] [--seed 100] [--space bench|wide] [--json FILE]

Every method solves the same generated tasks (one hand at a point, two hands on a box) from the same random and neutral
initial postures with the same SLSQP; the result is scored with the tables. An infeasible task counts as 12. "Best
known" is the lowest score of any method and initial posture on a task, and not a proven optimum.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # small matrices: threads only cost time
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from machine import machine, stamp

import dreba
from dreba.evaluation import reach_tasks as reach

STARTS = {"random": 3, "neutral": 2}
NET_POSES = 100_000


def methods(net_poses: int) -> list[reach.Method]:
    """Compared methods: shipped models, a net of DEBA's size, continuation with and without an unconstrained start."""
    graduated, quadratic, convex = (dreba.load(name) for name in ("graduated", "quadratic", "convex"))
    poses = dreba.sample(net_poses, rng=1)
    net = dreba.NetModel().fit(poses.angles, poses.reba)
    from_quadratic = dreba.GraduatedModel.of(quadratic, graduated.soft_)
    return [
        reach.method_of(graduated, name="graduated"),
        reach.method_of(from_quadratic, name="graduated, quadratic first"),
        reach.method_of(graduated, name="graduated, no free start", free_start=False),
        reach.method_of(convex, name="convex hinges"),
        reach.method_of(quadratic, name="quadratic (paper's form)"),
        *(reach.method_of(graduated, t, f"soft tables, {t:g} deg") for t in (8.0, 1.0)),
        reach.method_of(net, name="net of DEBA's size"),
    ]


def table(
    kind: reach.Starts, compared: Sequence[reach.Method], tasks: Sequence[reach.ReachTask], seed: int
) -> list[dict[str, object]]:
    """One row per method."""
    count = STARTS[kind]
    beginnings = reach.starts(kind, len(tasks) * count, seed).reshape(len(tasks), count, -1)
    outcomes = [reach.run(method, tasks, beginnings) for method in compared]
    best = reach.best_known(outcomes)
    print(f"\n{kind} starts: {len(tasks)} tasks x {count}, best known mean {best.mean():.2f}")
    print(f"{'method':28}{'REBA':>6}{'= best':>8}{'best of':>9}{'infeas.':>9}{'evals':>7}{'figure':>8}{'ms':>7}")
    rows = []
    for method, outcome in zip(compared, outcomes, strict=True):
        share, of_starts = outcome.share_best(best), outcome.share_best_of_starts(best)
        print(
            f"{method.name:28}{outcome.mean:6.2f}{share:8.2f}{of_starts:9.2f}{outcome.infeasible:9.3f}"
            f"{outcome.evaluations:7.0f}{outcome.constraint_evaluations:8.0f}{outcome.seconds * 1e3:7.0f}"
        )
        rows.append(
            {
                "starts": kind, "method": method.name, "mean": outcome.mean, "best": share, "best_of_starts": of_starts,
                "infeasible": outcome.infeasible, "evaluations": outcome.evaluations,
                "figure_evaluations": outcome.constraint_evaluations, "seconds": outcome.seconds,
                "best_known": float(best.mean()),
            }
        )  # fmt: skip
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", type=int, default=40)
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--space", choices=sorted(reach.SPACES), default="bench")
    parser.add_argument("--net-poses", type=int, default=NET_POSES, help="poses that the net is fitted to")
    parser.add_argument("--json", type=Path, default=None)
    options = parser.parse_args()
    print(stamp())
    tasks = reach.tasks(options.tasks, options.seed, options.space)
    compared = methods(options.net_poses)
    kinds: tuple[reach.Starts, ...] = ("random", "neutral")
    rows = [row for kind in kinds for row in table(kind, compared, tasks, options.seed)]
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
