"""--start, --end and --body at every command that reads a recording."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import reba
from lgp.cli import cli as lgp_cli
from reba.cli import cli
from tests.support.invoke import invoke
from tests.support.paths import DATASETS
from tests.support.says import says

RECORDING = str(DATASETS / "simulated_palletising.mcap")
READS = ("score", "info", "compare", "explain", "improve", "convert")
"""Commands with a recording as input; `live` follows one that has no end yet."""
INTERVAL = ("--start", "20", "--end", "30")


def run(*words: object) -> dict[str, Any]:
    result = invoke(cli, [*map(str, words), "--json"])
    assert result.exit_code == 0, (result.output, result.exception)
    return json.loads(result.stdout)


@pytest.mark.parametrize("command", [*(cli.commands[name] for name in READS), lgp_cli.commands["study"]])
def test_every_command_has_them(command: Any) -> None:
    assert {"--start", "--end", "--body"} <= {option for param in command.params for option in param.opts}


def test_each_command_uses_the_interval(tmp_path: Path) -> None:
    part = reba.read(RECORDING, start=20, end=30)
    (scored,) = run("score", RECORDING, *INTERVAL)["recordings"]
    assert scored["frames"] == len(part.data) == 251
    assert scored["accounts"][0]["not_used"] == {"outside_interval": 4405 - 251}
    assert scored["warnings"] == list(part.quality.warnings)
    assert run("info", RECORDING, *INTERVAL)["frames"] == 251
    assert run("compare", RECORDING, RECORDING, *INTERVAL)["a"]["frames"] == 251
    assert run("convert", RECORDING, *INTERVAL, "-o", tmp_path / "part.csv")["frames"] == 251
    assert 20 <= run("improve", RECORDING, *INTERVAL)["frames"][0]["time"] <= 30
    assert run("explain", RECORDING, *INTERVAL, "--at", 25)["time"] == 25.0
    outside = invoke(cli, ["explain", RECORDING, *INTERVAL, "--at", "50"])
    says(str(outside.exception), "lies outside", "20 to 30 s")


def test_each_recording_of_a_dataset_is_cut(tmp_path: Path) -> None:
    assert run("score", RECORDING, *INTERVAL, "-o", tmp_path / "out")["recordings"][0]["frames"] == 251
    again = run("score", RECORDING, "-o", tmp_path / "out")
    assert again["recordings"][0]["frames"] == 4405
    assert again["dataset"]["scored"] == {"other options": 1}


@pytest.mark.parametrize("words", [("--start", "nan"), ("--end", "x"), ("--start", "1e99")])
def test_what_is_no_time_is_refused(words: tuple[str, str]) -> None:
    result = invoke(cli, ["info", RECORDING, *words])
    assert result.exit_code == 2
    says(result.output.splitlines()[-1], words[0])
