"""Fuzz every reader and loader with damaged files: each must read a file or refuse it with one error of the package.

    python fuzz/run.py --inputs 2000 --seed 0 --jobs 2           all targets
    python fuzz/run.py --targets mcap c3d --inputs 10000         selected targets
    python fuzz/run.py --targets mcap --seed 0 --only 1234       one input again, with its traceback
    python fuzz/run.py --replay FILE --targets mcap              a saved input again, with its traceback
    python fuzz/run.py --engine atheris --inputs 2000            guided by coverage

Inputs are small valid files with structure-aware mutations, determined by seed and number; with `--engine atheris`
mutations of whatever reached new branches. Each is used in a process that may map 1 GiB beyond the memory of the
imports, and is stopped after `--seconds` of processor time. An error of another class than the package's, a message of
several lines, a crash, a timeout and exceeded memory are findings: the input is saved, and the exit code is 1.
"""

from __future__ import annotations

import argparse
import functools
import importlib.util
import json
import multiprocessing
import os
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}
sys.path.insert(0, str(Path(__file__).resolve().parent))

import guided
from check import MEMORY, Result, work
from targets import TARGETS

Engine = Callable[..., None]
"""Tests inputs in a process of its own, as `check.work` does."""

SECONDS = 20.0
"""Processor time that one input may take [s]."""
WAIT = 60.0
"""Time of the clock after which an input counts as hanging, in multiples of its processor time: machines are busy."""
BATCH = 1000
"""Inputs per process, small enough that jobs share the work evenly."""
START = 300.0
"""Time limit of a process for imports and seeds [s]."""


@dataclass
class Tally:
    """Outcomes of the inputs of one target; `findings` are (number, error); `grown` is memory [bytes]."""

    outcomes: Counter[str] = field(default_factory=Counter)
    findings: list[tuple[int, str]] = field(default_factory=list)
    grown: int = 0
    slowest: float = 0.0

    def add(self, number: int, result: Result, seconds: float) -> None:
        """Count one input."""
        self.outcomes[result.outcome] += 1
        self.slowest = max(self.slowest, seconds)
        if result.outcome == "finding":
            self.findings.append((number, result.what))

    def join(self, other: Tally) -> None:
        """Add the counts of another part of the same target."""
        self.outcomes += other.outcomes
        self.findings += other.findings
        self.grown, self.slowest = max(self.grown, other.grown), max(self.slowest, other.slowest)


def run_batch(name: str, seed: int, numbers: range, seconds: float = SECONDS, engine: Engine = work) -> Tally:
    """Test inputs in separate processes; one that crashes or hangs is replaced, and its input is a finding."""
    tally = Tally()
    context = multiprocessing.get_context("spawn")
    while len(numbers):
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=engine, args=(name, seed, numbers, MEMORY, seconds, theirs), daemon=True)
        process.start()
        theirs.close()
        current, began, allowed = None, time.monotonic(), START
        failed = ""
        while True:
            try:
                if not ours.poll(allowed):
                    failed = f"no end after {allowed:g} s"
                    break
                number, message = ours.recv()
            except (EOFError, OSError):
                failed = "" if current == -1 else "the process ended"
                break
            if number == -1:
                tally.grown = max(tally.grown, message)
            elif message is not None:
                tally.add(number, *message)
            current, began, allowed = number, time.monotonic(), WAIT * seconds
        if failed:
            process.kill()
        process.join()
        ours.close()
        if not failed:
            break
        if current is None:
            raise RuntimeError(f"{name}: the seeds are not read: {failed}, exit code {process.exitcode}")
        if process.exitcode == -getattr(signal, "SIGPROF", 0):
            failed = f"no end after {seconds:g} s of processor time"
        tally.add(current, Result("finding", f"{failed}, exit code {process.exitcode}"), time.monotonic() - began)
        numbers = range(current + 1, numbers.stop)
    return tally


def run(
    names: list[str], seed: int, inputs: int, jobs: int, seconds: float = SECONDS, engine: Engine = work
) -> dict[str, Tally]:
    """Outcomes of the first `inputs` inputs of each target."""
    # An engine that learns from its inputs keeps its process.
    batch = BATCH if engine is work else max(inputs, 1)
    parts = [(name, range(first, min(first + batch, inputs))) for first in range(0, inputs, batch) for name in names]
    with ThreadPoolExecutor(jobs) as pool:
        tallies = list(pool.map(lambda part: run_batch(part[0], seed, part[1], seconds, engine), parts))
    totals = {name: Tally() for name in names}
    for (name, _), tally in zip(parts, tallies, strict=True):
        totals[name].join(tally)
    return totals


def show(tallies: dict[str, Tally], took: float) -> str:
    """Table of all targets."""
    lines = [f"{'target':10} {'inputs':>8} {'read':>8} {'refused':>8} {'findings':>8} {'slowest s':>9} {'grown MB':>8}"]
    total: Counter[str] = Counter()
    for name, tally in tallies.items():
        outcomes = tally.outcomes
        total += outcomes
        lines.append(
            f"{name:10} {outcomes.total():8} {outcomes['read']:8} {outcomes['refused']:8} {outcomes['finding']:8} "
            f"{tally.slowest:9.2f} {tally.grown / 1e6:8.0f}"
        )
    lines.append(f"{'all':10} {total.total():8} {total['read']:8} {total['refused']:8} {total['finding']:8}")
    lines.append(f"memory bound {MEMORY >> 20} MiB beyond the imports; {took:.0f} s")
    return "\n".join(lines)


def replay(name: str, data: bytes) -> None:
    """Use one input in this process, without handling its errors."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / TARGETS[name].file
        path.write_bytes(data)
        print(TARGETS[name].use(path))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=2000, help="of each target")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--engine", choices=["mutations", "atheris"], default="mutations", help="source of the inputs")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of processor time that one input may take")
    parser.add_argument(
        "--minutes", type=float, default=float("inf"), help="most that a target gets of atheris; fewer inputs then"
    )
    parser.add_argument("--targets", nargs="+", choices=list(TARGETS), default=list(TARGETS), metavar="NAME")
    parser.add_argument("--only", type=int, help="number of one input to use again")
    parser.add_argument("--replay", type=Path, help="file to use again")
    parser.add_argument("--save", type=Path, default=Path("out/fuzz"), help="folder of the inputs that were findings")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    if options.only is not None or options.replay is not None:
        name = options.targets[0]
        replay(name, options.replay.read_bytes() if options.replay else TARGETS[name].input(options.seed, options.only))
        return 0
    engine: Engine = work
    if options.engine == "atheris":
        if importlib.util.find_spec("atheris") is None:
            parser.error("atheris is not installed; it is part of pip install '.[dev]' on Linux")
        options.save.mkdir(parents=True, exist_ok=True)
        engine = functools.partial(guided.work, options.save, options.minutes * 60)
    began = time.monotonic()
    tallies = run(options.targets, options.seed, options.inputs, options.jobs, options.seconds, engine)
    print(show(tallies, time.monotonic() - began))
    for name, tally in tallies.items():
        for number, what in tally.findings:
            options.save.mkdir(parents=True, exist_ok=True)
            saved = guided.input_file(options.save, name, options.seed, number)
            if engine is work:
                saved.write_bytes(TARGETS[name].input(options.seed, number))
            print(f"{name} {number}: {what}; again: python fuzz/run.py --targets {name} --replay {saved}")
    if options.json:
        table = {
            name: {**tally.outcomes, "slowest_s": tally.slowest, "grown_bytes": tally.grown}
            for name, tally in tallies.items()
        }
        options.json.write_text(json.dumps({"seed": options.seed, "memory": MEMORY, "targets": table}, indent=1) + "\n")
    return 1 if any(tally.findings for tally in tallies.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
