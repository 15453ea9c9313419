"""The complete command: an hour of JointState at 100 Hz from MCAP to Parquet and a summary, in one process on one core.

    python benchmarks/whole_command.py [--json FILE]

Writes recordings of 6, 15, 30 and 60 minutes (36 joints of human.urdf, positions and velocities, zstd) in a temporary
folder, runs `reba score FILE -o OUT.parquet --json` on each in a new process, and reports seconds and peak memory.
The target is a growth of memory of at most the posture table itself (23 float64 columns per frame).
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "datasets"))

from machine import machine
from palletising import JOINTS, simulate
from ros2_bag import Ros2Bag
from ros2_messages import NANOSECONDS

MINUTES = (6, 15, 30, 60)
RATE = 100
TABLE_BYTES = 23 * 8


def make_recording(path: Path, minutes: float) -> int:
    """Write a recording that repeats simulated palletising at 100 Hz; return the number of frames."""
    motion = simulate(np.random.default_rng(1))
    frames = int(minutes * 60 * RATE)
    places = np.arange(frames) * (1.0 / RATE) % motion.time[-1]
    positions = np.stack([np.interp(places, motion.time, column) for column in motion.position.T], axis=1)
    positions += np.random.default_rng(2).normal(0.0, 1e-3, positions.shape)
    velocities = np.gradient(positions, 1.0 / RATE, axis=0)
    with Ros2Bag(path, "benchmark") as bag:
        for frame in range(frames):
            stamp = NANOSECONDS * 1_700_000_000 + frame * (NANOSECONDS // RATE)
            bag.joints("/joint_states", stamp, JOINTS, positions[frame], velocities[frame])
    return frames


def run(path: Path, output: Path) -> tuple[float, float]:
    """Score a recording in a new process; return seconds and peak resident memory [MB]."""
    script = (
        "import os, sys, resource, subprocess; os.sched_setaffinity(0, {0});"
        "done = subprocess.run([sys.executable, '-m', 'reba', *sys.argv[1:]], stdout=subprocess.DEVNULL);"
        "print(done.returncode, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    start = time.perf_counter()
    command = [sys.executable, "-c", script, "score", str(path), "-o", str(output), "--json"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    seconds = time.perf_counter() - start
    status, peak = done.stdout.split()
    if status != "0":
        raise SystemExit(f"reba score ended with {status}: {done.stderr}")
    return seconds, int(peak) / 1024


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--minutes", type=float, nargs="+", default=MINUTES)
    options = parser.parse_args()
    rows = []
    print(
        f"{'minutes':>8} {'frames':>8} {'file MB':>8} {'seconds':>8} {'x real time':>12} {'peak MB':>8} {'table MB':>9}"
    )
    with tempfile.TemporaryDirectory() as folder:
        for minutes in options.minutes:
            path = Path(folder) / f"{minutes:g}min.mcap"
            frames = make_recording(path, minutes)
            seconds, peak = run(path, path.with_suffix(".parquet"))
            size, table = path.stat().st_size / 1e6, frames * TABLE_BYTES / 1e6
            rows.append({"minutes": minutes, "frames": frames, "file_mb": size, "seconds": seconds, "peak_mb": peak})
            print(
                f"{minutes:8g} {frames:8d} {size:8.1f} {seconds:8.2f} {minutes * 60 / seconds:12.0f} "
                f"{peak:8.0f} {table:9.1f}"
            )
            path.unlink()
    if len(rows) > 1:
        frames = rows[-1]["frames"] - rows[0]["frames"]
        growth = (rows[-1]["peak_mb"] - rows[0]["peak_mb"]) * 1024 * 1024 / frames
        print(f"memory grows by {growth:.0f} bytes a frame; a row of the posture table has {TABLE_BYTES}")
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1))


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
