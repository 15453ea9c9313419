"""Error of the soft tables per REBA class and temperature on held-out balanced poses, beside the published one.

Usage: python benchmarks/soft.py [--poses 100000] [--domain human|paper] [--fit] [--json FILE]

Without --fit the shipped model is measured (domain human); with it a model is fitted to 100,000 poses of the domain.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
from pathlib import Path
from time import perf_counter

import numpy as np
from machine import machine, stamp

import dreba

FIT_POSES = 100_000
SEEDS = {"train": 1, "held out": 9}
COLD = 0.001


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poses", type=int, default=100_000)
    parser.add_argument("--domain", default="human")
    parser.add_argument("--fit", action="store_true")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    print(stamp())
    held_out = dreba.sample(options.poses, domain=options.domain, rng=SEEDS["held out"])
    if options.fit:
        poses = dreba.sample(FIT_POSES, domain=options.domain, rng=SEEDS["train"])
        began = perf_counter()
        model = dreba.SoftModel().fit(poses.angles, poses.reba)
        print(f"fitted {len(model.ladder)} temperatures to {FIT_POSES:,} poses in {perf_counter() - began:.0f} s")
    else:
        model = dreba.load("soft")
    print(f"{'':10}" + "".join(f"{score:>6}" for score in dreba.PUBLISHED) + f"{'all':>7}{'max':>7}{'acc.':>7}")
    print(f"{'Table I':10}" + "".join(f"{rmse:6.2f}" for rmse in dreba.PUBLISHED.values()))
    rows = []
    for temperature in model.temperatures_:
        evaluation = dreba.evaluate(model, held_out, temperature=temperature)
        rmse = [error.rmse for error in evaluation.classes.values()]
        rows.append({"temperature": temperature, "rmse": evaluation.rmse, "worst_class": max(rmse)})
        text = "".join(f"{value:6.2f}" for value in rmse)
        print(f"T = {temperature:4g}  {text}{evaluation.rmse:7.3f}{max(rmse):7.3f}{evaluation.rounded_accuracy:7.3f}")
    if options.domain != "paper":  # whose score is not that of any rules
        exact = dreba.SoftModel(learn=False).fit(held_out.angles, held_out.reba)
        off = np.abs(exact.value(held_out.angles, temperature=COLD) - held_out.reba) > 0.01
        print(f"unfitted at T = {COLD:g} deg: {off.mean():.2%} of poses off by more than 0.01 (those on a threshold)")
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
