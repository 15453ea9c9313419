"""Speed of the distribution of REBA under measurement error, beside plain scores and beside sampling.

    python benchmarks/distribution.py [--json FILE] [--frames 1000000] [--repeat 9]

Pinned to one core; processor time. `reba.score_array(error=)` gives scores and their distribution of frames x 22
float64 angles; the time of the scores alone is taken off for the row of the distribution. Parts of the frames are timed
alternately, and the shortest time of each is taken. Sampling draws 1000 postures for each frame and scores them, on
fewer frames: its probabilities are off by up to 0.016 (one standard error), those of the distribution by rounding.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from machine import machine, pin_to_one_core, stamp

SAMPLES = 1000
SAMPLED_FRAMES = 30
AT_ONCE = 50_000
"""Frames of one call."""
SEED = 20250101


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--repeat", type=int, default=9)
    given = parser.parse_args()
    core = pin_to_one_core()
    rows = measure(given.frames, given.repeat)
    print(f"{stamp()}; pinned to core {core}")
    print(f"{given.frames:,} frames x 22 angles, {AT_ONCE:,} at once, best of {given.repeat} each")
    print(f"{'':52}{'ms':>10}{'frames/s':>14}{'x scores':>10}")
    for row in rows:
        print(f"{row['what']:52}{row['ms']:10.1f}{row['frames_per_second']:14,.0f}{row['times_scores']:10.1f}")
    if given.json:
        figures = {"machine": machine(), "frames": given.frames, "repeat": given.repeat, "rows": rows}
        given.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


def measure(frames: int, repeat: int) -> list[dict[str, Any]]:
    """One row of figures for each way, plain scores first; times scaled to `frames`."""
    import numpy as np

    import reba

    rng = np.random.default_rng(SEED)
    gravity = reba.Rules(upper_arm_reference="gravity")
    parts = [rng.uniform(-120.0, 120.0, (min(AT_ONCE, frames - start), 22)) for start in range(0, frames, AT_ONCE)]
    error = reba.MeasurementError.of("inertial")
    sd = np.array(error.sd)
    totals: dict[str, float] = {}
    for angles in parts:
        holes = angles.copy()
        holes[:, -2:] = np.nan  # wrist twist is what most sources lack
        few = angles[:SAMPLED_FRAMES]

        def sample(few: Any = few) -> None:
            for posture in few:
                scores = reba.score_array(posture + sd * rng.standard_normal((SAMPLES, 22)))
                np.bincount(scores.reba, minlength=16)

        jobs: dict[str, tuple[Callable[[], object], float]] = {
            "scores alone": (lambda angles=angles: reba.score_array(angles), 1.0),
            "with the distribution, all measured": (lambda angles=angles: reba.score_array(angles, error=error), 1.0),
            "with the distribution, wrist twist not measured": (
                lambda holes=holes: reba.score_array(holes, error=error),
                1.0,
            ),
            "with the distribution, arms against gravity": (
                lambda angles=angles: reba.score_array(angles, None, gravity, error=error),
                1.0,
            ),
            f"{SAMPLES} samples a frame (scaled)": (sample, len(angles) / len(few)),
        }
        best = dict.fromkeys(jobs, float("inf"))
        for _ in range(repeat):
            for name, (job, scale) in jobs.items():
                best[name] = min(best[name], seconds(job) * scale)
        for name, took in best.items():
            totals[name] = totals.get(name, 0.0) + took
    base = totals["scores alone"]
    totals["the distribution itself, all measured"] = totals["with the distribution, all measured"] - base
    return [
        {"what": name, "ms": took * 1e3, "frames_per_second": frames / took, "times_scores": took / base}
        for name, took in totals.items()
    ]


def seconds(job: Callable[[], object]) -> float:
    """Return the processor time of one call."""
    start = time.process_time()
    job()
    return time.process_time() - start


if __name__ == "__main__":
    main()
