"""What a surrogate is for: the true REBA reached when it is minimised on reach tasks.

Usage: python benchmarks/enabler.py [--tasks 40] [--seed 100] [--space bench|wide] [--json FILE]

Every method solves the same generated tasks (one hand at a point, two hands on a box) from the same random and neutral
starts with the same SLSQP; the exact score judges the result. A task that is not reached counts as 12. "Best known" is
the best score that any of the methods reached on a task from any start: a pool, not a proof.
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
    """Return the methods: the shipped models, a net of DEBA's size, and stages with and without a free start."""
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
    kind: reach.Starts, chosen: Sequence[reach.Method], given: Sequence[reach.ReachTask], seed: int
) -> list[dict[str, object]]:
    """Return one row per method."""
    count = STARTS[kind]
    beginnings = reach.starts(kind, len(given) * count, seed).reshape(len(given), count, -1)
    outcomes = [reach.run(method, given, beginnings) for method in chosen]
    best = reach.best_known(outcomes)
    print(f"\n{kind} starts: {len(given)} tasks x {count}, best known mean {best.mean():.2f}")
    print(f"{'method':28}{'REBA':>6}{'= best':>8}{'best of':>9}{'infeas.':>9}{'evals':>7}{'figure':>8}{'ms':>7}")
    rows = []
    for method, found in zip(chosen, outcomes, strict=True):
        share, of_starts = found.share_best(best), found.share_best_of_starts(best)
        print(
            f"{method.name:28}{found.mean:6.2f}{share:8.2f}{of_starts:9.2f}{found.infeasible:9.3f}"
            f"{found.evaluations:7.0f}{found.constraint_evaluations:8.0f}{found.seconds * 1e3:7.0f}"
        )
        rows.append(
            {
                "starts": kind, "method": method.name, "mean": found.mean, "best": share, "best_of_starts": of_starts,
                "infeasible": found.infeasible, "evaluations": found.evaluations,
                "figure_evaluations": found.constraint_evaluations, "seconds": found.seconds,
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
    given = reach.tasks(options.tasks, options.seed, options.space)
    chosen = methods(options.net_poses)
    kinds: tuple[reach.Starts, ...] = ("random", "neutral")
    rows = [row for kind in kinds for row in table(kind, chosen, given, options.seed)]
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
