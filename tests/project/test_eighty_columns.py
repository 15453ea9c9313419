"""Every command of the three packages in a terminal of 80 columns: its help, its messages and its output.

A terminal breaks longer lines wherever its edge is, so none may be longer, but for a single word that is.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest

import dreba.cli
import lgp.cli
import reba.cli
from tests.support.paths import DATASETS
from tests.support.terminal import in_a_terminal

pytestmark = pytest.mark.slow

GROUPS = {"reba": reba.cli.cli, "dreba": dreba.cli.cli, "lgp": lgp.cli.cli}
ASSEMBLY, KEYPOINTS = str(DATASETS / "simulated_assembly.csv"), str(DATASETS / "balancing_keypoints.trc")
PALLETS = str(DATASETS / "simulated_palletising.mcap")
ABSENT = "a_recording_that_is_not_there.mcap"
OUTPUTS = (
    ["reba", "score", PALLETS, KEYPOINTS, "--load", "8"], ["reba", "score", KEYPOINTS, "--error", "inertial"],
    ["reba", "info", KEYPOINTS], ["reba", "explain", KEYPOINTS, "--at", "1"], ["reba", "improve", PALLETS, "--all"],
    ["reba", "compare", ASSEMBLY, KEYPOINTS], ["reba", "profiles"], ["dreba", "card", "quadratic"], ["lgp", "scenes"],
    ["dreba", "evaluate", "quadratic", "-n", "300"], ["reba", "live", KEYPOINTS], ["lgp", "plan", "no_such_scene"],
    ["lgp", "improve", KEYPOINTS, "--at", "1", "--heights", "0.9", "0.9", "--step", "0.4"],
)  # fmt: skip
PROGRESS = re.compile(r"━ +\d+% ")
RUN_ALL = """
import importlib, json, sys
for words in json.load(open(sys.argv[1])):
    print("== " + json.dumps(words), flush=True)
    sys.argv = words
    try:
        importlib.import_module(words[0] + ".cli").main()
    except SystemExit as stop:
        print(f"== exit {stop.code}", flush=True)
"""


def commands() -> list[list[str]]:
    """Return each command with its help, without arguments that it needs, and with arguments that are wrong."""
    calls: list[list[str]] = [[name, *words] for name in GROUPS for words in ((), ("--no-such-option",), ("nonsense",))]
    for name, group in GROUPS.items():
        for word, command in group.commands.items():
            calls += [[name, word, *more] for more in (("--help",), ("--no-such-option",), (ABSENT,) * 2)]
            if any(one.required for one in command.params):
                calls.append([name, word])
    return [*calls, *OUTPUTS]


def on_a_terminal(calls: list[list[str]], columns: int, file: Path) -> dict[str, str]:
    """Return what a terminal of a width gets from each call, without styles."""
    file.write_text(json.dumps(calls), encoding="utf-8")
    text = in_a_terminal([sys.executable, "-c", RUN_ALL, str(file)], columns)
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text).replace("\r\n", "\n")
    parts = re.split(r"(?m)^== (?=\[)(.*)\n", text)[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, str], dict[str, str]]:
    file = tmp_path_factory.mktemp("calls") / "calls.json"
    return on_a_terminal(commands(), 80, file), on_a_terminal(commands(), 400, file)


def shown(text: str) -> list[str]:
    """Return the lines without those of progress bars, whose states depend on the time that commands take."""
    return [line for line in text.splitlines() if not PROGRESS.search(line)]


def test_no_line_is_broken_by_the_terminal(printed: tuple[dict[str, str], dict[str, str]]) -> None:
    long = [
        (call, line)
        for call, text in printed[0].items()
        for line in shown(text)
        if len(line) > 80 and " " in line.strip() and not line.startswith(("{", "=="))
    ]
    assert long == []


def test_nothing_is_cut(printed: tuple[dict[str, str], dict[str, str]]) -> None:
    def words(text: str) -> set[str]:
        bare = re.sub(r"[─│┃┏┓┗┛━┡┩┠┨├┤┼╇]", " ", "\n".join(shown(text)))
        # Of recordings a wide terminal has names where a narrow one has numbers.
        return {word for word in bare.split() if re.search(r"\w", word) and not re.search(r"/|\.(csv|mcap|trc)", word)}

    narrow, wide = printed
    assert narrow.keys() == wide.keys()
    for call, text in narrow.items():
        assert "\u2026" not in text, call
        assert not re.search(r"\d *\n *(%|s|min|deg|degrees|kg|cm)\b", text), call
        # A wide terminal has names of recordings as headings, a narrow one numbers and letters.
        assert words(wide[call]) - words(text) <= {"recording"}, call


def test_every_command_has_help_and_errors_of_one_message(printed: tuple[dict[str, str], dict[str, str]]) -> None:
    narrow = printed[0]
    for name, group in GROUPS.items():
        for word in group.commands:
            text = narrow[json.dumps([name, word, "--help"])]
            assert text.startswith(f"Usage: {name} {word}")
            assert "Example" in text, text
            for more in (["--no-such-option"], [ABSENT, ABSENT]):
                text = narrow[json.dumps([name, word, *more])]
                assert text.endswith("== exit 2\n"), text
                first, *others = text.splitlines()[:-1]
                assert first.startswith(f"{name}: "), text
                assert all(line.startswith("  ") for line in others), text
