"""Tables and progress bars with names that a terminal would obey."""

from __future__ import annotations

import io
from collections.abc import Callable
from unittest import mock

import pytest
import rich.text
from rich.cells import cell_len
from rich.table import Table

from reba.terminal import Console, ProgressBar, Text

NAME = "left\x1b[2J\x9b31m\u202e\x08arm [red]x[/red][/] :boom:"
SHOWN = r"left\x1b[2J\x9b31m\u202e\x08arm [red]x[/red][/] :boom:"


def printed(*what: object, width: int = 100) -> str:
    out = io.StringIO()
    Console(file=out, width=width).print(*what)
    return out.getvalue()


@pytest.mark.parametrize(
    "made", [str, Text, lambda name: Text.assemble(("", "bold"), name), lambda name: Text("").append(name)]
)
def test_lines_show_names(made: Callable[[str], str | rich.text.Text]) -> None:
    assert printed(made(NAME)) == f"{SHOWN}\n"
    assert printed(made("a\nb\tc")) == "a\\nb\\tc\n"


@pytest.mark.parametrize("width", [100, 60])
@pytest.mark.parametrize("made", [str, Text])
def test_tables_keep_their_columns(made: Callable[[str], str | rich.text.Text], width: int) -> None:
    table = Table(title=made(NAME))
    for heading in (made(NAME), Text("two\nlines", keep="\n")):
        table.add_column(heading, overflow="fold")
    table.add_row(made(NAME), made("1"))
    title, *lines = printed(table, width=width).splitlines()
    frame = [line for line in [title, *lines] if line[0] in "┏┃┡│└"]
    assert len({cell_len(line) for line in frame}) == 1
    assert "\x1b" not in "".join(lines)
    assert (f"│ {SHOWN} │ 1" in "\n".join(lines)) == (width == 100)


def test_progress_bars_show_names() -> None:
    out = io.StringIO()
    with (
        mock.patch("sys.stderr", out),
        mock.patch.object(out, "isatty", return_value=True),
        ProgressBar("scoring", 2) as bar,
    ):
        bar.advance(NAME)
        bar._progress.refresh()
    assert SHOWN in out.getvalue().replace("\x1b[38;5;58m", "")
    assert "\x1b[2J" not in out.getvalue()
