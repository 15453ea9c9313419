"""Time of value and gradient: NumPy single and batch for every kind, and the exported C functions.

Usage: python benchmarks/surrogate_speed.py [--json FILE]
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np
from machine import machine, stamp

import dreba

BATCH = 10_000
REPEATS = 7
NET_POSES = 5_000

LOOP = """
#include <stdio.h>
#include <time.h>
double dreba(const double angles[22], double load, const double coupling[2], double activity, double *gradient);
int main(void)
{
    static double poses[%(poses)d][22];
    double gradient[22], sum = 0.0, best = 1e9;
    const double coupling[2] = {0.0, 0.0};
    if (fread(poses, sizeof poses, 1, stdin) != 1) return 1;
    for (int repeat = 0; repeat < 15; ++repeat) {
        struct timespec a, b;
        clock_gettime(CLOCK_MONOTONIC, &a);
        for (int turn = 0; turn < 20; ++turn)
            for (int i = 0; i < %(poses)d; ++i) {
                sum += dreba(poses[i], 0.0, coupling, 0.0, gradient) + gradient[i %% 22];
            }
        clock_gettime(CLOCK_MONOTONIC, &b);
        const double ns = ((b.tv_sec - a.tv_sec) * 1e9 + (b.tv_nsec - a.tv_nsec)) / (20.0 * %(poses)d);
        if (ns < best) best = ns;
    }
    printf("%%.1f\\n", best + 0.0 * sum);
    return 0;
}
"""


def best(work: Callable[[], object], times: int) -> float:
    """Shortest time per call of several rounds [s]."""
    rounds = []
    for _ in range(REPEATS):
        began = perf_counter()
        for _ in range(times):
            work()
        rounds.append((perf_counter() - began) / times)
    return min(rounds)


def native(model: dreba.Surrogate, poses: np.ndarray, flags: str) -> float | None:
    """Time per call of the exported C function in a native loop [ns], None without a compiler."""
    compiler = shutil.which("gcc")
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        source = dreba.export_model(model, Path(folder) / "cost.c", to="c")
        loop = Path(folder) / "loop.c"
        loop.write_text("#define _POSIX_C_SOURCE 199309L\n" + LOOP % {"poses": len(poses)})
        program = Path(folder) / "loop"
        command = [compiler, "-std=c99", *flags.split(), "-o", str(program), str(loop), str(source), "-lm"]
        subprocess.run(command, check=True)
        data = np.ascontiguousarray(poses).tobytes()
        return float(subprocess.run([str(program)], input=data, capture_output=True, check=True).stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    print(stamp())
    rows = []
    poses = dreba.sample(BATCH, rng=3).angles
    few = dreba.sample(NET_POSES, rng=4)
    models = {name: dreba.load(name) for name in ("quadratic", "convex", "soft")}
    models["net of DEBA's size"] = dreba.NetModel(epochs=2).fit(few.angles, few.reba)
    print(f"{'':20}{'batch, poses/s':>16}{'single, us':>12}{'C -O2, ns':>11}{'C -O3 -ffast-math, ns':>23}")
    for name, model in models.items():
        batch = BATCH / best(lambda model=model: model.value_and_gradient(poses), 3)
        single = best(lambda model=model: model.value_and_gradient(poses[0]), 300) * 1e6
        rows.append({"kind": name, "batch_per_second": batch, "single_us": single})
        text = f"{name:20}{batch:16,.0f}{single:12.0f}"
        if name in ("quadratic", "convex", "soft"):
            for width, flags in ((11, "-O2"), (23, "-O3 -ffast-math -march=native")):
                nanoseconds = native(model, poses[:1000], flags)
                rows[-1][f"c_ns {flags}"] = nanoseconds
                text += f"{nanoseconds:{width}.0f}" if nanoseconds is not None else f"{'-':>{width}}"
        print(text)
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
