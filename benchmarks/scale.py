"""Thousands of recordings into one dataset: throughput, memory over time, and Dask compared with local processes.

    python benchmarks/scale.py [--recordings 2000] [--minutes 10] [--json FILE]

Writes posture tables of real movements (the recordings of `datasets/`, and of ../shared/recordings if it exists, with
random speed, offset and noise) to a temporary folder, scores them with `reba score DIR -o OUT/` and samples the memory
of the processes twice per second. The full run takes about ten minutes on two idle cores, and 8 GB of disk.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "datasets"))

import psutil
import pyarrow as pa
import pyarrow.parquet as pq
from machine import machine, stamp
from whole_command import make_recording

import reba
from reba.batch.manifest import MANIFEST
from reba.batch.parallel import run_parallel
from reba.errors import RebaError

ROOT = Path(__file__).resolve().parents[1]
RATE = 60
"""Frames per second, as inertial suits record."""
NOISE = 0.3
"""Standard deviation of the noise added to every angle [deg], so that all recordings differ."""
INTERVAL = 0.5
"""Time between two samples of memory [s]."""
QUARTERS = 4
CODE = "import sys; from reba.cli import main; sys.argv[0] = 'reba'; main()"


@dataclass(frozen=True)
class Measured:
    """Measurements of one run of the command.

    Attributes:
        seconds: wall-clock time, start of Python included.
        cpu: seconds of processor time of the command and its processes.
        result: `dataset` of its JSON.
        memory: (samples, 3): seconds, MB of the command, MB of its largest worker.
    """

    seconds: float
    cpu: float
    result: dict[str, Any]
    memory: np.ndarray


def movements() -> list[np.ndarray]:
    """Angles (n, 22) of real and simulated movements at `RATE`; NaN where they were not measured."""
    places = [*(ROOT / "datasets").glob("*.*"), *(ROOT.parent / "shared" / "recordings").glob("*/*.*")]
    recorded = []
    for place in sorted(places):
        if place.suffix in (".py", ".md"):
            continue
        try:
            data = reba.read(place).data
        except RebaError:  # markers without a body, files beside a recording
            continue
        time_, angles = data["time"].to_numpy(), data[list(reba.COLUMNS)].to_numpy(float)
        if len(time_) > 1 and np.isfinite(angles).mean() > 0.5:
            grid = np.arange(time_[0], time_[-1], 1.0 / RATE)
            recorded.append(np.stack([np.interp(grid, time_, column) for column in angles.T], axis=1))
    return recorded


def write_tables(folder: Path, number: int, minutes: float, jobs: int) -> int:
    """Write the recordings and return the frames of one."""
    frames = int(minutes * 60 * RATE)
    with tempfile.NamedTemporaryFile(suffix=".npz") as file:
        np.savez(file, *movements())
        file.flush()
        for _ in run_parallel(
            partial(write_table, folder=folder, movements=file.name, frames=frames), range(number), jobs=jobs
        ):
            pass
    return frames


def write_table(index: int, folder: Path, movements: str, frames: int) -> None:
    """Write one recording."""
    rng = np.random.default_rng(index)
    with np.load(movements) as known:
        source = known[known.files[index % len(known.files)]]
    # Forwards and backwards, so that the repeated movement is continuous.
    steps = np.abs((rng.uniform(0, len(source)) + rng.uniform(0.8, 1.2) * np.arange(frames)) % (2 * len(source)))
    places = np.minimum(steps, 2 * len(source) - 1 - steps).clip(0, len(source) - 1).astype(int)
    angles = source[places].astype(np.float32)
    angles += NOISE * rng.standard_normal(angles.shape, dtype=np.float32)
    columns = [np.arange(frames) / RATE, *np.ascontiguousarray(angles.T)]
    table = pa.table(dict(zip(["time", *reba.COLUMNS], columns, strict=True)))
    pq.write_table(table, folder / f"r{index:06d}.parquet", compression="zstd")


def score(inputs: Path, output: Path, *words: str, workers: list[int] | None = None) -> Measured:
    """Run the command in its own process and sample its memory until it ends.

    Args:
        inputs: folder of recordings.
        output: folder of the dataset.
        words: further options.
        workers: processes of a cluster, if that does the work.
    """
    command = [sys.executable, "-c", CODE, "score", str(inputs), "-o", f"{output}/", "--json", *words]
    samples = []
    with tempfile.TemporaryFile("w+") as output_file:
        start, before = time.perf_counter(), cpu()
        process = psutil.Popen(command, stdout=output_file, stderr=subprocess.PIPE, text=True)
        while process.poll() is None:
            samples.append((time.perf_counter() - start, megabytes(process.pid), largest(process, workers)))
            time.sleep(INTERVAL)
        seconds = time.perf_counter() - start
        if process.returncode:
            raise SystemExit(f"reba score ended with {process.returncode}: {process.stderr.read()}")
        output_file.seek(0)
        return Measured(seconds, cpu() - before, json.load(output_file)["dataset"], np.array(samples))


def cpu() -> float:
    """Processor time of all processes that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def megabytes(pid: int) -> float:
    """Resident memory of a process, 0 if it has ended."""
    try:
        return float(psutil.Process(pid).memory_info().rss / 1e6)
    except psutil.Error:
        return 0.0


def largest(process: psutil.Process, workers: list[int] | None) -> float:
    """Memory of the largest worker."""
    try:
        pids = [child.pid for child in process.children(recursive=True)] if workers is None else workers
    except psutil.Error:
        return 0.0
    return max(map(megabytes, pids), default=0.0)


def quarters(measured: Measured, output: Path) -> list[dict[str, float]]:
    """Median seconds per recording and peak memory in each quarter of a run."""
    with (output / MANIFEST).open() as lines:
        took = np.array([json.loads(line)["seconds"] for line in lines])
    edges = np.linspace(0.0, measured.seconds, QUARTERS + 1)
    rows = []
    for quarter, (low, high) in enumerate(pairwise(edges)):
        # A quarter shorter than the sampling interval takes the nearest sample.
        off = np.maximum(low - measured.memory[:, 0], measured.memory[:, 0] - high)
        seen = measured.memory[off <= max(0.0, off.min())]
        share = took[len(took) * quarter // QUARTERS : len(took) * (quarter + 1) // QUARTERS]
        rows.append(
            {"parent_mb": seen[:, 1].max(), "worker_mb": seen[:, 2].max(), "seconds_each": float(np.median(share))}
        )
    return rows


def on_cluster(inputs: Path, output: Path, jobs: int) -> Measured:
    """Score on a local Dask cluster with the same number of processes."""
    from distributed import Client, LocalCluster

    before = cpu()
    with (
        LocalCluster(n_workers=jobs, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster,
        Client(cluster) as client,
    ):
        pids = list(client.run(os.getpid).values())
        measured = score(inputs, output, "--scheduler", cluster.scheduler_address, workers=pids)
    return replace(measured, cpu=cpu() - before)


def first_recordings(folder: Path, source: Path, number: int) -> Path:
    """Folder with links to the first recordings."""
    folder.mkdir()
    for path in sorted(source.iterdir())[:number]:
        os.link(path, folder / path.name)
    return folder


def show(name: str, recordings: int, frames: int, jobs: int, measured: Measured) -> dict[str, Any]:
    """Figures of a run, printed and returned."""
    row = {
        "run": name,
        "recordings": recordings,
        "jobs": jobs,
        "seconds": measured.seconds,
        "cpu_seconds_per_recording": measured.cpu / recordings,
        "recordings_per_second": recordings / measured.seconds,
        "frames_per_second_and_job": recordings * frames / measured.seconds / jobs,
        "parent_mb": float(measured.memory[:, 1].max()),
        "worker_mb": float(measured.memory[:, 2].max()),
    }
    print(
        f"{name:26} {recordings:6d} {jobs:5d} {row['seconds']:9.1f} {row['recordings_per_second']:9.2f} "
        f"{row['cpu_seconds_per_recording']:10.3f} {row['frames_per_second_and_job']:13,.0f} "
        f"{row['parent_mb']:10.0f} {row['worker_mb']:10.0f}",
        flush=True,
    )
    return row


def measure(folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Write the recordings, run all cases and return the figures."""
    inputs, jobs = folder / "in", options.jobs
    inputs.mkdir()
    start = time.perf_counter()
    frames = write_tables(inputs, options.recordings, options.minutes, jobs)
    size = sum(path.stat().st_size for path in inputs.iterdir()) / 1e9
    print(
        f"{options.recordings} recordings of {options.minutes:g} min at {RATE} Hz, {frames} frames each, "
        f"{size:.2f} GB, written in {time.perf_counter() - start:.0f} s"
    )
    print(
        f"{'':26} {'recs':>6} {'jobs':>5} {'seconds':>9} {'recs/s':>9} {'CPU s/rec':>10} {'frames/s/job':>13} "
        f"{'parent MB':>10} {'worker MB':>10}"
    )
    few = first_recordings(folder / "few", inputs, options.subset)
    count = len(list(few.iterdir()))
    rows = [show("one process", count, frames, 1, score(few, folder / "one"))]
    rows += [show(f"{jobs} local processes", count, frames, jobs, score(few, folder / "local", "--jobs", str(jobs)))]
    rows += [show(f"{jobs} Dask workers", count, frames, jobs, on_cluster(few, folder / "dask", jobs))]
    whole = score(inputs, folder / "out", "--jobs", str(jobs))
    rows += [show("all, local processes", options.recordings, frames, jobs, whole)]
    over_time = quarters(whole, folder / "out")
    written = sum(path.stat().st_size for path in (folder / "out").rglob("*.parquet")) / 1e9
    again = score(inputs, folder / "out", "--jobs", str(jobs))
    if again.result["unchanged"] != options.recordings:
        raise SystemExit("the second run scored something again")
    rows += [show("all, nothing to do", options.recordings, frames, jobs, again)]
    if options.mcap:
        bags = folder / "bags"
        bags.mkdir()
        in_bag = make_recording(bags / "b0.mcap", options.minutes)
        for index in range(1, options.mcap):
            shutil.copyfile(bags / "b0.mcap", bags / f"b{index}.mcap")
        rows += [show("MCAP, 100 Hz", options.mcap, in_bag, jobs, score(bags, folder / "mcap", "--jobs", str(jobs)))]
    print("\nall, by quarter of the run   parent MB  worker MB  median s a recording")
    for quarter, row in enumerate(over_time, 1):
        print(f"{quarter:26d} {row['parent_mb']:11.0f} {row['worker_mb']:10.0f} {row['seconds_each']:12.3f}")
    manifest = (folder / "out" / MANIFEST).stat().st_size / options.recordings
    print(f"\nDask against local: {rows[2]['seconds'] / rows[1]['seconds']:.2f} times the time")
    print(f"scores: {written * 1e9 / options.recordings / 1e6:.2f} MB a recording, manifest: {manifest / 1e3:.1f} kB")
    return {"rows": rows, "quarters": over_time, "scores_gb": written, "input_gb": size, "frames": frames}


def main() -> None:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", type=int, default=2000)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--subset", type=int, default=100, help="recordings of the runs that are compared")
    parser.add_argument("--mcap", type=int, default=8, help="MCAP recordings, 0 for none")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    print(stamp())
    with tempfile.TemporaryDirectory() as folder:
        figures = measure(Path(folder), options)
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), **figures}, indent=1))


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
