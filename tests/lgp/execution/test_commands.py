"""`lgp run` from the command line: output, exit codes, the page while it runs, and every kind of bad input."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from lgp.cli import main
from tests.support.execution_plans import saved, small_plan
from tests.support.lgp_worlds import needs_robots

pytestmark = [pytest.mark.slow, needs_robots]


class Done(NamedTuple):
    """How a command ended."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def lgp_run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    def command(*arguments: str) -> Done:
        monkeypatch.setattr(sys, "argv", ["lgp", "run", *arguments])
        with pytest.raises(SystemExit) as stop:
            main()
        return Done(stop.value.code, *capsys.readouterr())

    return command


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return saved(tmp_path_factory.mktemp("cli"))


def test_a_run_with_its_page_prints_one_object(folder: Path, lgp_run: Callable[..., Done]) -> None:
    page = folder / "page"
    page.mkdir(exist_ok=True)
    own = f'<meta name="plan" content="{small_plan().digest}">'
    (page / "index.html").write_text(own, encoding="utf-8")  # drawing a page takes seconds
    done = lgp_run(str(folder), "--speed", "0", "--port", "0", "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["state"] == "finished"
    assert len(summary["actions"]) == 3
    assert "page: http://127.0.0.1:" in done.stderr


def test_a_run_that_fails_exits_with_1(folder: Path, lgp_run: Callable[..., Done]) -> None:
    done = lgp_run(str(folder), "--speed", "0", "--no-page", "--fault", "stuck@1", "--patience", "1.5")
    assert done.returncode == 1
    assert done.stdout.startswith("failed after")
    assert "was not finished in time" in done.stderr


def test_trajectories_are_exported_without_a_run(folder: Path, tmp_path: Path, lgp_run: Callable[..., Done]) -> None:
    done = lgp_run(str(folder), "--export", str(tmp_path / "robot.mcap"), "--json")
    assert done.returncode == 0, done.stderr
    assert len(json.loads(done.stdout)["actions"]) == 3


@pytest.mark.parametrize(
    ("arguments", "fact"),
    [
        (("nowhere",), "nowhere"),
        (("{}", "--fault", "burnt@1"), "known are moved"),
        (("{}", "--fault", "moved@9"), "3 actions"),
        (("{}", "--replay", "none.mcap"), "none.mcap"),
        (("{}", "--host", "203.0.113.1", "--port", "1"), "--port"),
    ],
)
def test_bad_input_is_one_line(
    folder: Path, lgp_run: Callable[..., Done], arguments: tuple[str, ...], fact: str
) -> None:
    done = lgp_run(*(text.format(folder) for text in arguments), "--speed", "0")
    assert done.returncode == 2
    assert fact in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert done.stdout == ""
