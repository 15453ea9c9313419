"""Outcome of one input, and the process that tests inputs under a memory limit."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Literal, NamedTuple

from targets import TARGETS, Target

MEMORY = 1 << 30
"""Memory limit of a process beyond its mapping after reading all seeds [bytes]."""

Outcome = Literal["read", "refused", "finding"]


class Result(NamedTuple):
    """Outcome of one input; `what` names the error."""

    outcome: Outcome
    what: str


def check(target: Target, data: bytes) -> Result:
    """Use one input: it is read, refused with an error of the package in one line, or a finding."""
    # Not at the head of this file: `guided` follows the branches of what is imported after it.
    from reba.errors import RebaError

    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    path = folder / target.file
    path.write_bytes(data)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            target.use(path)
    except RebaError as error:
        text = str(error)
        if "\n" in text or not 0 < len(text) < 20_000:
            return Result(
                "finding", f"{type(error).__name__} of {len(text)} characters, {text.count(chr(10))} newlines"
            )
        return Result("refused", type(error).__name__)
    except BaseException as error:  # every other exception is a finding
        if isinstance(error, KeyboardInterrupt):
            raise
        place = traceback.extract_tb(error.__traceback__)
        own = [f for f in place if any(part in f.filename for part in ("/reba/", "/dreba/", "/lgp/"))] or place
        where = f"{Path(own[-1].filename).name}:{own[-1].lineno}" if own else "an unknown place"
        return Result("finding", f"{type(error).__name__} at {where}: {' '.join(str(error).split())[:160]}")
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return Result("read", "")


def report(pipe: Connection, number: int, target: Target, data: bytes, seconds: float) -> Result:
    """Use one input, send its number before and its result and processor time [s] after it, and return the result.

    Beyond `seconds` of processor time, which other programs do not use up as they do time of the clock, the system ends
    the process.
    """
    pipe.send((number, None))
    with processor_time(seconds):
        began = time.process_time()
        result = check(target, data)
        took = time.process_time() - began
    pipe.send((number, (result, took)))
    return result


@contextlib.contextmanager
def processor_time(seconds: float) -> Iterator[None]:
    """End this process by SIGPROF if it computes longer than that meanwhile, if the system supports it."""
    if not hasattr(signal, "setitimer"):
        yield
        return
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def work(name: str, seed: int, numbers: range, memory: int, seconds: float, pipe: Connection) -> None:
    """Test inputs one after another, see `report`; send the memory at the end."""
    target = TARGETS[name]
    # Libraries in C print messages about damaged files.
    with open(os.devnull, "w") as null:
        os.dup2(null.fileno(), sys.stderr.fileno())
    for data in target.seeds:
        check(target, data)
    before = peak()
    limit(memory)
    for number in numbers:
        report(pipe, number, target, target.input(seed, number), seconds)
    pipe.send((-1, peak() - before))
    pipe.close()


def limit(memory: int) -> None:
    """Limit the mapping of this process to `memory` bytes more than now, if the system supports it."""
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (mapped + memory, mapped + memory))


def peak() -> int:
    """Peak resident memory of this process [bytes], 0 if the system does not report it."""
    try:
        import resource
    except ImportError:
        return 0
    held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return held if sys.platform == "darwin" else held * 1024
