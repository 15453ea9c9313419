"""Feed every reader and loader with damaged files: each must read the file or refuse it with one error of the package.

    python fuzz/run.py --inputs 2000 --seed 0 --jobs 2           all targets
    python fuzz/run.py --targets mcap c3d --inputs 10000         some
    python fuzz/run.py --targets mcap --seed 0 --only 1234       one input again, with its traceback
    python fuzz/run.py --replay FILE --targets mcap              a saved input again, with its traceback

Inputs are small valid files with structure-aware mutations; number and seed say which. Each is used in a process that
may map 1 GiB beyond what the imports took and is stopped after `--seconds`. Another error than one of the package's
own, a message of several lines, a crash, a hang and too much memory are findings: the input is saved, and the exit
code is 1.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}
sys.path.insert(0, str(Path(__file__).resolve().parent))

from check import MEMORY, Result, work
from targets import TARGETS

SECONDS = 20.0
BATCH = 1000
"""Inputs of one process; a fresh one follows, so that jobs share the work evenly."""
START = 120.0
"""[s] That a process may take to import and read the seeds."""


@dataclass
class Tally:
    """What became of the inputs of one target; `findings` are (number, what); `grown` is memory [bytes]."""

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
        """Count those of another part of the same target."""
        self.outcomes += other.outcomes
        self.findings += other.findings
        self.grown, self.slowest = max(self.grown, other.grown), max(self.slowest, other.slowest)


def run_batch(name: str, seed: int, numbers: range, seconds: float = SECONDS, memory: int = MEMORY) -> Tally:
    """Try inputs in processes of their own; one that crashes or hangs is replaced and its input is a finding."""
    tally = Tally()
    context = multiprocessing.get_context("spawn")
    while len(numbers):
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=work, args=(name, seed, numbers, memory, theirs), daemon=True)
        process.start()
        theirs.close()
        current, began, allowed = None, time.monotonic(), START
        failed = ""
        while True:
            try:
                if not ours.poll(allowed):
                    failed = f"no end after {allowed:g} s"
                    break
                number, told = ours.recv()
            except (EOFError, OSError):
                failed = "" if current == -1 else "the process ended"
                break
            if number == -1:
                tally.grown = max(tally.grown, told)
            elif told is not None:
                tally.add(number, told, time.monotonic() - began)
            current, began, allowed = number, time.monotonic(), seconds
        if failed:
            process.kill()
        process.join()
        ours.close()
        if not failed:
            break
        if current is None:
            raise RuntimeError(f"{name}: the seeds are not read: {failed}, exit code {process.exitcode}")
        tally.add(current, Result("finding", f"{failed}, exit code {process.exitcode}"), time.monotonic() - began)
        numbers = range(current + 1, numbers.stop)
    return tally


def run(names: list[str], seed: int, inputs: int, jobs: int, seconds: float = SECONDS) -> dict[str, Tally]:
    """Return what became of the first `inputs` inputs of each target."""
    parts = [(name, range(first, min(first + BATCH, inputs))) for first in range(0, inputs, BATCH) for name in names]
    with ThreadPoolExecutor(jobs) as pool:
        tallies = list(pool.map(lambda part: run_batch(part[0], seed, part[1], seconds), parts))
    found = {name: Tally() for name in names}
    for (name, _), tally in zip(parts, tallies, strict=True):
        found[name].join(tally)
    return found


def show(found: dict[str, Tally], took: float) -> str:
    """Return the table of all targets."""
    lines = [f"{'target':10} {'inputs':>8} {'read':>8} {'refused':>8} {'findings':>8} {'slowest s':>9} {'grown MB':>8}"]
    total: Counter[str] = Counter()
    for name, tally in found.items():
        some = tally.outcomes
        total += some
        lines.append(
            f"{name:10} {some.total():8} {some['read']:8} {some['refused']:8} {some['finding']:8} "
            f"{tally.slowest:9.2f} {tally.grown / 1e6:8.0f}"
        )
    lines.append(f"{'all':10} {total.total():8} {total['read']:8} {total['refused']:8} {total['finding']:8}")
    lines.append(f"memory bound {MEMORY >> 20} MiB beyond the imports; {took:.0f} s")
    return "\n".join(lines)


def replay(name: str, data: bytes) -> None:
    """Use one input in this process and let every error pass through."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / TARGETS[name].file
        path.write_bytes(data)
        print(TARGETS[name].use(path))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=2000, help="of each target")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="that one input may take")
    parser.add_argument("--targets", nargs="+", choices=list(TARGETS), default=list(TARGETS), metavar="NAME")
    parser.add_argument("--only", type=int, help="number of one input to use again")
    parser.add_argument("--replay", type=Path, help="file to use again")
    parser.add_argument("--save", type=Path, default=Path("out/fuzz"), help="folder of the inputs that were findings")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    given = parser.parse_args()
    if given.only is not None or given.replay is not None:
        name = given.targets[0]
        replay(name, given.replay.read_bytes() if given.replay else TARGETS[name].input(given.seed, given.only))
        return 0
    began = time.monotonic()
    found = run(given.targets, given.seed, given.inputs, given.jobs, given.seconds)
    print(show(found, time.monotonic() - began))
    for name, tally in found.items():
        for number, what in tally.findings:
            given.save.mkdir(parents=True, exist_ok=True)
            saved = given.save / f"{name}-{given.seed}-{number}{Path(TARGETS[name].file).suffix}"
            saved.write_bytes(TARGETS[name].input(given.seed, number))
            print(f"{name} {number}: {what}; again: python fuzz/run.py --targets {name} --replay {saved}")
    if given.json:
        table = {
            name: {**tally.outcomes, "slowest_s": tally.slowest, "grown_bytes": tally.grown}
            for name, tally in found.items()
        }
        given.json.write_text(json.dumps({"seed": given.seed, "memory": MEMORY, "targets": table}, indent=1) + "\n")
    return 1 if any(tally.findings for tally in found.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
