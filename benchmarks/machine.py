"""Machine and package versions of a benchmark, printed with every table of figures."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

PACKAGES = ("dreba", "numpy", "pandas", "scipy", "mcap", "ergonomics-metrics")


def machine() -> dict[str, Any]:
    """Processor, cores, system and versions of Python and the installed packages."""
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": {name: number for name in PACKAGES if (number := _version(name))},
    }


def processor() -> str:
    """Name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())


def stamp() -> str:
    """The machine as one line of text."""
    on = machine()
    versions = ", ".join(f"{name} {number}" for name, number in on["versions"].items())
    return f"{on['processor']}, {on['cores']} cores, {on['system']}, Python {on['python']}; {versions}"


def pin_to_one_core() -> int | None:
    """Pin this process to its last available core; return its number, None if the system does not support it."""
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
