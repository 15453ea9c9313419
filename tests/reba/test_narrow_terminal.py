"""At 80 columns no word and no number is cut: what a wide terminal shows is all there."""

from __future__ import annotations

import io
import re
import sys
from pathlib import Path

import click
import pytest
from rich.table import Table

import dreba.cli
import lgp.cli
import reba
import reba.cli
from reba.command_line import echo, print_json, run
from reba.terminal import Console, Text
from tests.support.paths import DATASETS
from tests.support.says import says

ASSEMBLY = str(DATASETS / "simulated_assembly.csv")
PALLETS = str(DATASETS / "simulated_palletising.mcap")
KEYPOINTS = str(DATASETS / "balancing_keypoints.trc")
GROUPS = {"reba": reba.cli.cli, "dreba": dreba.cli.cli, "lgp": lgp.cli.cli}
COMMANDS = (
    ("score", PALLETS, "--load", "8"),
    ("score", PALLETS, KEYPOINTS, ASSEMBLY, "--error", "inertial"),
    ("compare", ASSEMBLY, KEYPOINTS),
    ("explain", PALLETS, "--at", "28.8", "--error", "optical"),
    ("improve", PALLETS, "--load", "8", "--all"),
    ("improve", PALLETS, "--load", "8", "--at", "28.8"),
    ("info", PALLETS),
    ("info", KEYPOINTS),
    ("profiles",),
)


def output(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], group: str, *words: str, width: int = 80
) -> tuple[int, str]:
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.setattr(sys, "argv", [group, *words])
    with pytest.raises(SystemExit) as stop:
        run(GROUPS[group], group)
    return int(stop.value.code or 0), capsys.readouterr().out


def words_of(text: str) -> set[str]:
    """Return words and numbers, without names of files, which may be longer than a line."""
    files = {path.name for path in DATASETS.iterdir()}
    words = (word for word in re.split(r"[\s│┃]+", text) if re.search(r"\w", word))
    return {word for word in words if not any(name in word for name in files)}


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: " ".join(command)[:20])
def test_no_word_is_cut(
    command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    _, wide = output(monkeypatch, capsys, "reba", *command, width=400)
    _, narrow = output(monkeypatch, capsys, "reba", *command)
    assert "\u2026" not in narrow
    assert all(len(line) <= 80 for line in narrow.splitlines())
    assert not re.search(r"\d *\n *(%|s|min|deg|degrees|kg|cm)\b", narrow), "a number stands apart from its unit"
    # A wide terminal has the names of recordings as headings and labels, a narrow one numbers and letters.
    assert words_of(wide) - words_of(narrow) <= {"recording"}


def test_a_verdict_stands_beside_its_name_and_a_sustained_score_is_a_range(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    _, text = output(monkeypatch, capsys, "reba", "score", PALLETS, KEYPOINTS, "--load", "8")
    # Of the folder that is common to all recordings nothing is told.
    found = re.findall(r"^(\d): (\S+\.\w+): ", text, re.MULTILINE)
    assert found == [("1", Path(PALLETS).name), ("2", Path(KEYPOINTS).name)]
    row = next(line.split() for line in text.splitlines() if re.match(r" *2 +\d", line))
    held = reba.score(reba.read(KEYPOINTS), load=8).summary()["held"]
    assert row[5] == f"{held['reba']}-{held['reba_high']}"


@pytest.mark.parametrize("group", GROUPS)
def test_a_name_alone_prints_readable_help(
    group: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, text = output(monkeypatch, capsys, group)
    assert code == 0
    lines = text.splitlines()
    assert lines[0] == f"Usage: {group} [OPTIONS] COMMAND [ARGS]..."
    assert len(lines) > 12
    assert all(len(line) <= 80 for line in lines)
    assert not any(line.endswith("...") for line in lines[1:])
    for name, command in GROUPS[group].commands.items():
        assert any(line.split()[:1] == [name] for line in lines)
        assert isinstance(command, click.Command)


@pytest.mark.parametrize("width", range(30, 90, 3))
@pytest.mark.parametrize("make", [str, Text])
def test_a_number_stays_with_its_unit(width: int, make: type) -> None:
    text = (
        "High risk. 90th percentile REBA 9; 15 s (9 %) at REBA 8 or more; worst at 28 s, 65 s, 2 min 20 s; over 60 deg"
    )
    whole = ("REBA 9;", "15 s", "(9 %)", "REBA 8", "28 s,", "65 s,", "2 min 20 s;", "60 deg")
    table = Table("what")
    table.add_row(make(text))
    for one in (make(text), table):
        stream = io.StringIO()
        Console(file=stream, width=width).print(one)
        shown = stream.getvalue()
        assert all(part in shown for part in whole), shown
        assert all(len(line) <= width for line in shown.splitlines())
        assert " ".join(re.sub(r"[│┃]", " ", shown).split()).count("worst at") == 1


def printed(table: Table, width: int) -> str:
    out = io.StringIO()
    Console(file=out, width=width).print(table)
    return out.getvalue()


def test_a_table_without_room_is_printed_row_by_row() -> None:
    table = Table(title="of /a/very/long/path/that/is/no/word")
    for heading in ("name", Text("two\nlines", keep="\n"), "third"):
        table.add_column(heading, no_wrap=heading == "name")
    table.add_row("some name of many words", "123456.789", "incomprehensibilities")
    table.add_row("b", "", "1")
    assert printed(table, 80).splitlines()[0].strip() == "of /a/very/long/path/that/is/no/word"
    assert "some name of many words" in printed(table, 80)
    lines = [" ".join(line.split()) for line in printed(table, 40).splitlines()]
    assert lines == [
        "of /a/very/long/path/that/is/no/word", "name some name of many words", "two lines 123456.789",
        "third incomprehensibilities", "", "name b", "third 1", "",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("reba", "explain", "a.csv"), ("--at", "Time of the frame", "`reba explain --help`")),
        (("dreba", "export", "m.json"), ("--to", "casadi", "`dreba export --help`")),
        (("lgp", "simulate-study"), ("CONDITION=PLAN_DIR", "`lgp simulate-study --help`")),
        (("reba", "score", "a.csv", "--no-such"), ("--no-such", "`reba score --help`")),
        (("reba", "nonsense"), ("nonsense", "`reba --help`")),
    ],
    ids=" ".join,
)
def test_what_is_missing_or_unknown_is_named_with_its_help(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], said: tuple[str, ...]
) -> None:
    group, *rest = words
    monkeypatch.setattr(sys, "argv", [group, *rest])
    with pytest.raises(SystemExit) as stop:
        run(GROUPS[group], group)
    assert stop.value.code == 2
    says(capsys.readouterr().err, *said)


class Screen(io.StringIO):
    """A terminal that keeps what is printed on it."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("err", [False, True])
def test_messages_end_their_lines_between_words_and_data_does_not(monkeypatch: pytest.MonkeyPatch, err: bool) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    out, errors = Screen(), Screen()
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(sys, "stderr", errors)
    echo("results are in plan/page: report.html, summary.json, runs.parquet and paths.parquet", err=err)
    lines = (errors if err else out).getvalue().splitlines()
    assert len(lines) == 3
    assert all(len(line) <= 40 for line in lines)
    assert "summary.json" in lines[1]
    out.truncate(out.seek(0))
    print_json({"text": "as long as this one is, more than forty columns"})
    assert len(out.getvalue().splitlines()) == 1
