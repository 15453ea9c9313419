"""Killed commands: what `reba score`, `lgp experiment` and `lgp run` give after kills at random moments.

    python benchmarks/kills.py [--kills 20] [--seed 0] [--only score experiment run cluster] [--json FILE]

Each job is run undisturbed, then killed (SIGKILL to all of its processes) at random moments, each time with the same
command started again, and at last run to its end. The results have to be those of the undisturbed job: every score, the
tables of the experiment but for the seconds that planning took, the goal of the run and a log that can be read. For the
cluster, one worker, then the scheduler, then the other worker is killed while a job runs. A few minutes on two cores.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from mcap.reader import make_reader

DATASETS = Path(__file__).resolve().parents[1] / "datasets"
RECORDINGS = 24
UNEQUAL = ("seconds", "planning_seconds")
"""Columns that a repeated job need not have equal."""


def command(*words: object) -> list[str]:
    """Return a command of this installation."""
    program, *rest = map(str, words)
    return [sys.executable, "-P", "-m", program, *rest]


def finish(words: Sequence[str]) -> float:
    """Run a command to its end; return its duration [s]."""
    start = time.monotonic()
    done = subprocess.run(words, capture_output=True, text=True, timeout=1800, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(words)} failed: {done.stderr[-2000:]}")
    return time.monotonic() - start


def kill_after(words: Sequence[str], seconds: float) -> bool:
    """Start a command and kill all of its processes after a time [s]; return False if it had ended by then."""
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return True
    return False


@dataclass
class Job:
    """A job: its command for an output folder, and what compares two such folders ("" if they are equal).

    Attributes:
        again: the command after a kill.
        prepare: makes the folder before the first start.
    """

    name: str
    first: Callable[[Path], list[str]]
    again: Callable[[Path], list[str]]
    difference: Callable[[Path, Path], str]
    prepare: Callable[[Path], None] = field(default=lambda folder: None)


def disturbed(job: Job, work: Path, kills: int, random: np.random.Generator) -> dict[str, object]:
    """Run a job undisturbed and with kills, and return how they compare."""
    calm, killed = work / job.name / "calm", work / job.name / "killed"
    for folder in (calm, killed):
        folder.parent.mkdir(parents=True, exist_ok=True)
        job.prepare(folder)
    seconds = finish(job.first(calm))
    done = ended = 0
    words = job.first(killed)
    while done < kills:
        start = time.monotonic()
        if kill_after(words, float(random.uniform(0.2, 0.9 * seconds))):
            done += 1
        else:  # it came to its end: begin anew
            ended += 1
            if words == job.first(killed):  # a busy machine may have become faster
                seconds = min(seconds, time.monotonic() - start)
            shutil.rmtree(killed, ignore_errors=True)
            job.prepare(killed)
            words = job.first(killed)
            continue
        words = job.again(killed)
    finish(words)
    difference = job.difference(calm, killed)
    return {"job": job.name, "kills": done, "ended before": ended, "equal": not difference, "difference": difference}


def tables_differ(calm: Path, killed: Path, pattern: str) -> str:
    """Return the first difference between the Parquet files of two folders."""
    names = sorted(str(file.relative_to(calm)) for file in calm.rglob(pattern))
    if not names or names != sorted(str(file.relative_to(killed)) for file in killed.rglob(pattern)):
        return f"other files than {len(names)}"
    for name in names:
        one, other = (pd.read_parquet(folder / name) for folder in (calm, killed))
        keys = [key for key in ("initial", "run", "condition", "slice") if key in one]
        one, other = (
            (table.sort_values(keys, ignore_index=True) if keys else table).drop(columns=list(UNEQUAL), errors="ignore")
            for table in (one, other)
        )
        try:
            pd.testing.assert_frame_equal(one, other, check_exact=True)
        except AssertionError as error:
            return f"{name}: {' '.join(str(error).split())[:200]}"
    rest = [file.name for file in killed.rglob(".*.part")]
    return f"left behind: {rest[:3]}" if rest else ""


def score_job(recordings: Path, where: Sequence[str] = ("--jobs", "2")) -> Job:
    """Return the scoring of a folder of recordings into a dataset."""

    def words(folder: Path) -> list[str]:
        return command("reba", "score", recordings, "-o", folder, *where)

    return Job("score", words, words, lambda calm, killed: tables_differ(calm, killed, "scores.parquet"))


def experiment_job() -> Job:
    """Return an experiment of a few draws."""

    def words(folder: Path) -> list[str]:
        return command("lgp", "experiment", "screwdriver", "--runs", 12, "--jobs", 2, "-o", folder)

    return Job("experiment", words, words, lambda calm, killed: tables_differ(calm, killed, "*.parquet"))


def run_job(plan: Path) -> Job:
    """Return a run of a plan, which is resumed after a kill."""

    def words(folder: Path, *more: str) -> list[str]:
        return command("lgp", "run", folder, "--speed", 10, "--no-page", *more)

    def again(folder: Path) -> list[str]:
        return words(folder, *(["--resume"] if (folder / "run.mcap").exists() else []))

    def difference(calm: Path, killed: Path) -> str:
        ends = [last_event(folder / "run.mcap") for folder in (calm, killed)]
        return "" if ends[0] == ends[1] else f"the runs end with {ends[0]!r} and {ends[1]!r}"

    return Job("run", words, again, difference, lambda folder: shutil.copytree(plan, folder) and None)


def last_event(log: Path) -> str:
    """Return the last event of a log, which can be read to its end."""
    with log.open("rb") as file:
        events = [
            json.loads(message.data)
            for _, channel, message in make_reader(file).iter_messages()
            if channel.topic.endswith("events")
        ]
    return str(events[-1].get("kind", events[-1].get("event", "")))


def cluster(work: Path) -> dict[str, object]:
    """Kill one worker, the scheduler, and the other worker while a folder is scored on a cluster."""
    recordings = make_recordings(work / "cluster-recordings", 1500)
    calm = work / "cluster" / "calm"
    finish(score_job(recordings).first(calm))
    outcomes, difference = [], ""
    for victims in (["worker 1"], ["scheduler"], ["worker 1", "scheduler", "worker 2"]):
        killed = work / "cluster" / " ".join(victims)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        port = address.rsplit(":", 1)[1]
        dask = [sys.executable, "-m", "dask"]
        started = {
            "scheduler": subprocess.Popen(
                [*dask, "scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard"],
                stderr=subprocess.DEVNULL, start_new_session=True,
            ),
            **{
                f"worker {number}": subprocess.Popen(
                    [*dask, "worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"],
                    stderr=subprocess.DEVNULL, start_new_session=True, cwd=work,
                )
                for number in (1, 2)
            },
        }  # fmt: skip
        time.sleep(6.0)
        job = subprocess.Popen(
            score_job(recordings, ("--scheduler", address)).first(killed), stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip
        time.sleep(4.0)
        for victim in victims:
            os.killpg(started[victim].pid, signal.SIGKILL)
            time.sleep(0.5)
        _, errors = job.communicate(timeout=1800)  # to end what hangs
        outcomes.append(f"{' + '.join(victims)}: exit {job.returncode}, {len(errors.splitlines())} lines")
        for process in started.values():
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        finish(score_job(recordings).first(killed))
        difference = difference or tables_differ(calm, killed, "scores.parquet")
    return {"job": "cluster", "kills": 5, "outcomes": outcomes, "equal": not difference, "difference": difference}


def make_recordings(folder: Path, count: int) -> Path:
    """Write posture tables, each shifted by its number."""
    folder.mkdir(parents=True)
    table = pd.read_csv(DATASETS / "simulated_assembly.csv")
    numbers = [name for name in table.columns if name != "time" and table[name].dtype == float]
    for number in range(count):
        table.assign(**{name: table[name] + number / 10 for name in numbers}).to_csv(
            folder / f"recording_{number:03d}.csv", index=False
        )
    return folder


def main() -> None:
    """Run the jobs and print a line for each."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--kills", type=int, default=20)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--only", nargs="*", default=["score", "experiment", "run", "cluster"])
    options.add_argument("--json", type=Path)
    given = options.parse_args()
    random = np.random.default_rng(given.seed)
    results = []
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        for job in given.only:
            if job == "cluster":
                results.append(cluster(work))
            elif job == "score":
                recordings = make_recordings(work / "recordings", RECORDINGS)
                results.append(disturbed(score_job(recordings), work, given.kills, random))
            elif job == "experiment":
                results.append(disturbed(experiment_job(), work, given.kills, random))
            else:
                plan = work / "plan"
                finish(command("lgp", "plan", "screwdriver", "--no-collisions", "-o", plan))
                results.append(disturbed(run_job(plan), work, given.kills, random))
            print(results[-1], flush=True)
    if given.json:
        given.json.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    if not all(result["equal"] for result in results):
        raise SystemExit("the results differ")


if __name__ == "__main__":
    main()
