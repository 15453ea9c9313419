"""Nothing that lies in the current folder is imported, however a command is started."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from reba.report.pdf import BROWSERS, find_browser
from tests.support.paths import ROOT

STARTS: dict[str, dict[str, str]] = {
    "as it is": {},
    "a safe path that is empty": {"PYTHONSAFEPATH": ""},
    "an empty entry first": {"PYTHONPATH": f"{os.pathsep}{ROOT}"},
    "an empty entry last": {"PYTHONPATH": f"{ROOT}{os.pathsep}"},
}
"""Variables of the environment."""


def run(folder: Path, call: list[str], variables: dict[str, str]) -> subprocess.CompletedProcess[str]:
    """Run Python with some variables."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **variables}
    return subprocess.run(
        [sys.executable, *call], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("command", ["reba", "dreba", "lgp"])
@pytest.mark.parametrize("start", STARTS)
def test_commands_import_nothing_of_the_current_folder(command: str, start: str, tmp_path: Path) -> None:
    for module in ("click", "numpy", "json", "random"):
        (tmp_path / f"{module}.py").write_text("raise SystemExit('imported ' + __file__)")
    done = run(tmp_path, ["-m", command, "--help"], STARTS[start])
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("Usage")


@pytest.mark.parametrize("start", STARTS)
def test_nor_do_the_processes_that_they_start(start: str, tmp_path: Path) -> None:
    (tmp_path / "click.py").write_text("raise SystemExit('imported')")
    enter = "import sys; from reba.import_path import leave_out_current_folder as leave; leave(); "
    started = "import subprocess; sys.exit(subprocess.call([sys.executable, '-c', 'import click']))"
    done = run(tmp_path, ["-P", "-c", enter + started], STARTS[start])
    assert (done.returncode, done.stderr) == (0, "")


def test_workers_of_a_program_import_nothing_of_the_current_folder_and_its_environment_stays(tmp_path: Path) -> None:
    (tmp_path / "click.py").write_text("raise SystemExit('imported')")
    (tmp_path / "program.py").write_text(
        "import joblib, os\n"  # its import sets a variable
        "from reba.batch.worker_pool import Processes\n"
        "if __name__ == '__main__':\n"
        "    before = dict(os.environ)\n"
        "    with Processes(1) as pool:\n"
        "        print('safe', pool.result(pool.submit(os.getenv, 'PYTHONSAFEPATH')), dict(os.environ) == before)\n"
    )
    done = run(tmp_path, ["program.py"], {})
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "safe 1 True\n")


def test_a_folder_that_the_user_names_stays(tmp_path: Path) -> None:
    (tmp_path / "click.py").write_text("raise SystemExit('mine')")
    done = run(tmp_path, ["-m", "reba", "--help"], {"PYTHONPATH": f"{os.curdir}{os.pathsep}{ROOT}"})
    assert done.stderr == "mine\n"


def test_the_folder_of_the_packages_stays() -> None:
    code = "from reba.import_path import *; leave_out_current_folder(); import dreba"
    done = run(ROOT, ["-S", "-c", code], {"PYTHONPATH": ""})
    assert (done.returncode, done.stderr) == (0, "")


def test_a_current_folder_that_is_gone_holds_nothing(tmp_path: Path) -> None:
    code = f"import os; os.rmdir({str(tmp_path)!r}); from reba.import_path import *; leave_out_current_folder()"
    assert run(tmp_path, ["-P", "-c", code], {}).stderr == ""


def test_no_browser_of_the_current_folder_is_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in BROWSERS:
        (tmp_path / name).write_text("#!/bin/sh\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", os.pathsep)
    found = find_browser()
    assert found is None or Path(found).is_absolute()
