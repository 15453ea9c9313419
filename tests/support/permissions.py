"""Commands that heed permissions, also where the tests run as root, who may read everything."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from pathlib import Path

from tests.support.paths import ROOT

_DROP = 24
"""PR_CAPBSET_DROP of prctl(2): a program that is started afterwards lacks the capability."""
_OVERRIDES = (1, 2)
"""CAP_DAC_OVERRIDE and CAP_DAC_READ_SEARCH of capabilities(7)."""


def _heed_permissions() -> None:
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    for capability in _OVERRIDES if prctl else ():
        prctl(_DROP, capability, 0, 0, 0)


def run_heeding(*words: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a command of this package, such as `reba score ...`, without the rights of root over files."""
    return subprocess.run(
        [sys.executable, "-P", "-m", *map(str, words)],
        capture_output=True, text=True, timeout=120, check=False, env={"PYTHONPATH": str(ROOT)}, cwd=ROOT,
        preexec_fn=_heed_permissions,
    )  # fmt: skip
