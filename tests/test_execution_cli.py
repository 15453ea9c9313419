"""`lgp run` from the command line: output, exit codes, the page while it runs, and every kind of bad input."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.execution_plans import saved
from tests.lgp_worlds import needs_robots

pytestmark = needs_robots


def lgp_run(*arguments: str) -> subprocess.CompletedProcess[str]:
    code = "from lgp.cli import main; main()"
    return subprocess.run([sys.executable, "-c", code, "run", *arguments], capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return saved(tmp_path_factory.mktemp("cli"))


def test_a_run_with_its_page_prints_one_object(folder: Path) -> None:
    page = folder / "page"
    page.mkdir(exist_ok=True)
    (page / "index.html").write_text("<title>a page</title>", encoding="utf-8")
    done = lgp_run(str(folder), "--speed", "0", "--port", "0", "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["state"] == "finished"
    assert len(summary["actions"]) == 3
    assert "page: http://127.0.0.1:" in done.stderr


def test_a_run_that_fails_exits_with_1(folder: Path) -> None:
    done = lgp_run(str(folder), "--speed", "0", "--no-page", "--fault", "stuck@1", "--patience", "1")
    assert done.returncode == 1
    assert done.stdout.startswith("failed after")
    assert "was not finished in time" in done.stderr


def test_trajectories_are_exported_without_a_run(folder: Path, tmp_path: Path) -> None:
    done = lgp_run(str(folder), "--export", str(tmp_path / "robot.mcap"), "--json")
    assert done.returncode == 0, done.stderr
    assert len(json.loads(done.stdout)["actions"]) == 3


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere",), "cannot be read as a plan"),
        (("{}", "--fault", "burnt@1"), "unknown kind"),
        (("{}", "--fault", "moved@9"), "the plan has 3 actions"),
        (("{}", "--replay", "none.mcap"), "no such recording"),
        (("{}", "--host", "203.0.113.1", "--port", "1"), "--port"),
    ],
)
def test_bad_input_is_one_line(folder: Path, arguments: tuple[str, ...], words: str) -> None:
    done = lgp_run(*(text.format(folder) for text in arguments), "--speed", "0")
    assert done.returncode == 2
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert done.stdout == ""
