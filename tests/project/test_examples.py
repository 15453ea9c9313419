"""Every script of examples/ runs as a newcomer runs it: in an empty folder, without arguments."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.lgp_worlds import needs_robots
from tests.support.paths import ROOT

pytestmark = pytest.mark.slow

SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
ROBOTS = {"cost_in_pinocchio", "study"}
"""Those that plan with robots, whose descriptions are an extra."""
README = (ROOT / "examples" / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "script",
    [pytest.param(script, marks=[needs_robots] if script.stem in ROBOTS else [], id=script.stem) for script in SCRIPTS],
)
def test_an_example_runs_and_prints(script: Path, tmp_path: Path) -> None:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-W", "error", str(script)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=environment,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


def test_the_list_names_every_example() -> None:
    assert [script.name for script in SCRIPTS if f"`{script.name}`" not in README] == []
