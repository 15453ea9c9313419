"""Speed of scoring postures, compared with one pass over the same memory and with another package.

    python benchmarks/scoring.py [--json FILE] [--frames 1000000] [--repeat 9]

Pinned to one core. `reba.score_array` scores frames x 22 float64 angles (both arms, every column of the score table);
`numpy.sum` of the same array is the lower limit of reading it. The two are timed alternately, and the shortest time of
each is taken. `ergonomics-metrics` (one frame a call, no range) scores the same kind of frames after a warm-up: body
once and both arms, which is the same work, and one arm alone.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from machine import machine, pin_to_one_core, stamp

SIDES = ("left", "right")
PEER_FRAMES = 20_000
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
    print(f"{given.frames:,} frames x 22 angles, best of {given.repeat}")
    print(f"{'':44}{'ms':>10}{'frames/s':>14}{'x np.sum':>10}")
    for row in rows:
        print(f"{row['what']:44}{row['ms']:10.1f}{row['frames_per_second']:14,.0f}{row['times_sum']:10.1f}")
    ratio = peer_ratio(rows)
    if ratio is not None:
        print(f"reba.score_array is {ratio:.0f} times as fast as ergonomics-metrics with both arms")
    if given.json:
        figures = {"machine": machine(), "frames": given.frames, "repeat": given.repeat, "rows": rows, "ratio": ratio}
        given.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


def measure(frames: int, repeat: int) -> list[dict[str, Any]]:
    """One row of figures for each thing measured, np.sum first; times scaled to `frames`."""
    import numpy as np

    import reba

    rng = np.random.default_rng(SEED)
    angles = rng.uniform(-120.0, 120.0, (frames, len(reba.COLUMNS)))
    holes = angles.copy()
    holes[:, -2:] = np.nan  # wrist twist is what most sources lack
    holes[rng.random(frames) < 0.05, 0] = np.nan
    jobs: dict[str, Callable[[], object]] = {
        "numpy.sum": angles.sum,
        "reba.score_array, all measured": lambda: reba.score_array(angles),
        "reba.score_array, wrist twist not measured": lambda: reba.score_array(holes),
        "reba.score_array, arms against gravity": lambda: reba.score_array(angles, None, gravity),
    }
    gravity = reba.Rules(upper_arm_reference="gravity")
    best = dict.fromkeys(jobs, float("inf"))
    for _ in range(repeat):
        for name, job in jobs.items():
            best[name] = min(best[name], seconds(job))
    for sides, words in ((SIDES, "both arms"), (SIDES[:1], "one arm")):
        peer = peer_seconds(angles[:PEER_FRAMES], sides)
        if peer is not None:
            best[f"ergonomics-metrics, {words} (scaled)"] = peer * frames
    base = best["numpy.sum"]
    return [
        {"what": name, "ms": took * 1e3, "frames_per_second": frames / took, "times_sum": took / base}
        for name, took in best.items()
    ]


def seconds(job: Callable[[], object]) -> float:
    """Return how long one call takes."""
    start = time.perf_counter()
    job()
    return time.perf_counter() - start


def peer_seconds(angles: Any, sides: Sequence[str]) -> float | None:
    """Seconds a frame of ergonomics-metrics, angles to the score of some arms; None if it is not installed."""
    try:
        from ergonomics.reba import RebaScore
    except ImportError:
        return None
    import reba

    at = {name: column for column, name in enumerate(reba.COLUMNS)}
    body = angles[:, [at[name] for name in ("neck_flexion", "neck_twist", "trunk_flexion", "trunk_twist")]].tolist()
    knees = angles[:, at["knee_flexion_left"]].tolist()
    names = ("upper_arm_flexion", "shoulder_elevation", "upper_arm_abduction", "lower_arm_flexion", "wrist_flexion")
    arms = list(zip(*(angles[:, [at[f"{name}_{side}"] for name in names]].tolist() for side in sides), strict=True))
    score = RebaScore()

    def run(count: int) -> None:
        for (neck, neck_twist, trunk, trunk_twist), knee, both in zip(
            body[:count], knees[:count], arms[:count], strict=True
        ):
            score.set_body([neck, abs(neck_twist) > 10, trunk, abs(trunk_twist) > 10, False, knee, 0])
            score_a, _ = score.compute_score_a()
            for upper, raised, abducted, lower, wrist in both:
                score.set_arms([upper, raised > 10, abducted > 30, False, lower, wrist, False])
                score_b, _ = score.compute_score_b()
                score.compute_score_c(score_a, score_b)

    run(2_000)
    return min(seconds(lambda: run(len(body))) for _ in range(3)) / len(body)


def peer_ratio(rows: list[dict[str, Any]]) -> float | None:
    """Return how many times as fast as the other package the core is, both with everything measured and both arms."""
    by_name = {row["what"]: row["ms"] for row in rows}
    peer = next((ms for name, ms in by_name.items() if name.startswith("ergonomics-metrics")), None)
    return None if peer is None else peer / by_name["reba.score_array, all measured"]


if __name__ == "__main__":
    main()
