"""Python files of one's own before a command: what they register is there, and what is wrong in them is one line."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import lgp
from lgp.cli import cli
from lgp.extensions import run_extension
from lgp.kinematics import actions
from tests.support.invoke import invoke
from tests.support.says import says

GOOD = """
import lgp
lgp.register_action("stir", lgp.ActionKind(("hand", "object")))
if __name__ == "__main__":
    raise ValueError("not as a script")
"""


@pytest.fixture(autouse=True)
def _registered() -> Iterator[None]:
    before = dict(actions._registered)
    yield
    actions._registered.clear()
    actions._registered.update(before)


def test_a_command_runs_it_first(tmp_path: Path) -> None:
    file = tmp_path / "stir.py"
    file.write_text(GOOD)
    done = invoke(cli, ["--extension", str(file), "scenes"])
    assert done.exit_code == 0, done.output
    assert actions.kind_of("stir") is not None


@pytest.mark.parametrize(
    ("text", "facts"),
    [
        ("x = 1\ny = x / 0\n", ("line 2", "ZeroDivisionError")),
        ("import nowhere_at_all\n", ("line 1", "nowhere_at_all")),
        ("x = (1\n", ("own.py", "never closed")),
        ("import lgp\nlgp.register_action('grasp', lgp.ActionKind(('hand', 'object')))\n", ("'grasp'", "shipped")),
    ],
)
def test_what_is_wrong_in_it_is_one_line(tmp_path: Path, text: str, facts: tuple[str, ...]) -> None:
    file = tmp_path / "own.py"
    file.write_text(text)
    with pytest.raises(lgp.LgpError) as error:
        run_extension(str(file))
    says(error, "own.py", *facts)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(lgp.LgpError) as error:
        run_extension(str(tmp_path / "nothing.py"))
    says(error, "nothing.py", "cannot be read", "Python file")
