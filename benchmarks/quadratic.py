"""Refit of the model of the paper: time, error per REBA class beside Table I, speed of value and gradient.

    python benchmarks/quadratic.py [--json FILE] [--poses 10000] [--repeat 7]

Pinned to one core. Every model is fitted to balanced poses with seed 1 and evaluated on as many with seed 2. "refit
from nothing" draws the poses and fits, in a process that has only imported the package. Speeds are the best of
`--repeat` rounds in which all kinds take turns; the net has the size of DEBA (3 x 124 + 7 ReLU units).
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from machine import machine, pin_to_one_core, stamp

FORMS: dict[str, dict[str, Any]] = {
    "paper's form, convex": {},
    "paper's form, plain least squares": {"curvature": "any"},
    "paper's form, no intercept": {"intercept": False},
    "paper's form, low classes weigh more": {"class_power": 1.0},
    "free joint quadratics": {"free": True},
}
DOMAINS = ("paper", "human")
BATCH = 100_000
SINGLES = 2_000


def main() -> None:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--repeat", type=int, default=7)
    arguments = parser.parse_args()
    core = pin_to_one_core()
    print(f"{stamp()}; pinned to core {core}")
    sampling, refit = times(arguments.poses)
    print(
        f"100,000 balanced poses drawn in {sampling:.2f} s; refit of {arguments.poses:,} from nothing in {refit:.2f} s"
    )
    rows = errors(arguments.poses)
    show_errors(rows)
    speeds = speed(arguments.repeat)
    for row in speeds:
        print(
            f"{row['kind']:28}{row['batch_per_second']:14,.0f} poses/s in a batch{row['single_us']:10.1f} us one pose"
        )
    if arguments.json:
        figures = {"machine": machine(), "sampling_s": sampling, "refit_s": refit, "errors": rows, "speed": speeds}
        arguments.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


def times(poses: int) -> tuple[float, float]:
    """Seconds to draw 100,000 poses, and to draw `poses` and fit the paper's form; the refit comes first."""
    import dreba
    import dreba.surrogates.library

    start = time.perf_counter()
    drawn = dreba.sample(poses, domain="paper", rng=1)
    dreba.QuadraticModel(domain="paper").fit(drawn.angles, drawn.reba)
    refit = time.perf_counter() - start
    start = time.perf_counter()
    dreba.sample(100_000, rng=1)
    return time.perf_counter() - start, refit


def errors(poses: int) -> list[dict[str, Any]]:
    """RMSE and bias per class of every form in every domain, and the distance to Table I."""
    import dreba
    from dreba.surrogates.metrics import distance_to_published

    rows = []
    for domain in DOMAINS:
        train, held_out = (dreba.sample(poses, domain=domain, rng=seed) for seed in (1, 2))
        for name, options in FORMS.items():
            model = dreba.QuadraticModel(domain=domain, **options).fit(train.angles, train.reba)
            evaluation = dreba.evaluate(model, held_out)
            rows.append(
                {"domain": domain, "form": name, "distance": distance_to_published(evaluation), **evaluation.to_dict()}
            )
    return rows


def show_errors(rows: list[dict[str, Any]]) -> None:
    """Print RMSE and bias per class, the published row first."""
    from dreba.surrogates.metrics import PUBLISHED, PUBLISHED_OVERALL

    print(f"{'RMSE per REBA class':46}" + "".join(f"{score:6}" for score in PUBLISHED) + "   all     d")
    published = "".join(f"{rmse:6.2f}" for rmse in PUBLISHED.values())
    print(f"{'published, Table I':46}{published}{PUBLISHED_OVERALL:6.2f}")
    for row in rows:
        shown = "".join(f"{row['classes'][str(score)]['rmse']:6.2f}" for score in PUBLISHED)
        overall = row["overall"]["rmse"]
        print(f"{row['domain'] + ': ' + row['form']:46}{shown}{overall:6.2f}{row['distance']:6.2f}")
        print(f"{'    bias':46}" + "".join(f"{row['classes'][str(score)]['bias']:+6.2f}" for score in PUBLISHED))


def speed(repeat: int) -> list[dict[str, Any]]:
    """Poses per second and microseconds per pose of value and gradient, for the quadratics and a net."""
    import dreba

    poses = dreba.sample(BATCH, rng=1)
    some = list(poses.angles[:SINGLES])
    small = poses.rows(slice(0, 2000))
    models = {"quadratic": dreba.QuadraticModel().fit(small.angles, small.reba)}
    if "net" in dreba.KINDS:
        models["net of DEBA's size"] = dreba.KINDS["net"]().fit(small.angles, small.reba)
    jobs: dict[tuple[str, str], Callable[[], object]] = {}
    for name, model in models.items():
        jobs[name, "batch"] = lambda model=model: model.value_and_gradient(poses.angles)
        jobs[name, "single"] = lambda model=model: [model.value_and_gradient(pose) for pose in some]
    best = dict.fromkeys(jobs, float("inf"))
    for _ in range(repeat):
        for key, job in jobs.items():
            start = time.perf_counter()
            job()
            best[key] = min(best[key], time.perf_counter() - start)
    return [
        {
            "kind": name,
            "batch_per_second": BATCH / best[name, "batch"],
            "single_us": 1e6 * best[name, "single"] / SINGLES,
        }
        for name in models
    ]


if __name__ == "__main__":
    main()
