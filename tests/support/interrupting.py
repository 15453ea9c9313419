"""A command as its console script runs it, stopped by a signal at a chosen moment after it began to listen."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.support.paths import ROOT

SCRIPTS: dict[str, str] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]
CODE = """
import importlib, os, signal, sys
mark, module, function, *sys.argv = sys.argv[1:]
signal.signal(signal.SIGINT, signal.default_int_handler)  # whoever runs the tests may have it ignored
install = signal.signal
def told(number, handler):
    global mark
    before = install(number, handler)
    if number == signal.SIGTERM and mark:
        descriptor, mark = int(mark), ""
        os.close(descriptor)
    return before
signal.signal = told
getattr(importlib.import_module(module), function)()
"""


@dataclass(frozen=True)
class Ended:
    """A command that has ended: exit code, output, and the seconds that it ran after it began to listen."""

    code: int
    out: str
    err: str
    seconds: float


@contextlib.contextmanager
def listening(words: Sequence[str | Path], **options: Any) -> Iterator[subprocess.Popen[str]]:
    """Start a command in a group of processes of its own, and give it when its handlers stand."""
    read, write = os.pipe()
    module, _, function = SCRIPTS[str(words[0])].partition(":")
    call = [sys.executable, "-c", CODE, str(write), module, function, *map(str, words)]
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    streams: dict[str, Any] = {
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
        "text": True,
        "env": env,
        **options,
    }
    with subprocess.Popen(call, pass_fds=[write], start_new_session=True, **streams) as running:
        os.close(write)
        with os.fdopen(read, "rb") as marks:
            marks.read()  # to the end: the command has closed its side
        try:
            yield running
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(running.pid, signal.SIGKILL)


def stopped(
    words: Sequence[str | Path], after: float | None, number: int = signal.SIGINT, times: int = 1, **options: Any
) -> Ended:
    """Run a command, send its group a signal some seconds after it began to listen, and return how it ended.

    Args:
        after: None lets it end by itself.
        times: of the signal, as an impatient user presses keys.
    """
    with listening(words, **options) as running:
        start = time.monotonic()
        for _ in range(0 if after is None else times):
            with contextlib.suppress(subprocess.TimeoutExpired):
                running.wait(after)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(running.pid, number)
            after = 0.02
        out, err = running.communicate(timeout=240)
        seconds = time.monotonic() - start
        deadline = time.monotonic() + 10.0
        while _alive(running.pid):
            assert time.monotonic() < deadline, f"{words}: processes are left behind"
            time.sleep(0.02)
    return Ended(running.returncode, out, err, seconds)


def _alive(group: int) -> bool:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(group, 0)
        return True
    return False
