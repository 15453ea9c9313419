"""What a benchmark ran on: the machine and the versions, stamped on every table of figures."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

PACKAGES = ("dreba", "numpy", "pandas", "scipy", "mcap", "ergonomics-metrics")


def machine() -> dict[str, Any]:
    """Return processor, cores, system and the versions of Python and the packages that are installed."""
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": {name: found for name in PACKAGES if (found := _version(name))},
    }


def processor() -> str:
    """Return the name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())


def stamp() -> str:
    """Return the machine as one line of text."""
    on = machine()
    versions = ", ".join(f"{name} {number}" for name, number in on["versions"].items())
    return f"{on['processor']}, {on['cores']} cores, {on['system']}, Python {on['python']}; {versions}"


def pin_to_one_core() -> int | None:
    """Keep this process on the last core it may use; return its number, None where the system cannot do it."""
    if not hasattr(os, "sched_setaffinity"):
        return None
    core = max(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {core})
    return core


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""
