"""The README: its example runs as printed, its commands exist, its columns are the package's."""

from __future__ import annotations

import doctest
import re
from pathlib import Path

import pytest

import reba
from reba.cli import cli
from tests.support.paths import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_example_prints_what_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    result = doctest.testfile(str(ROOT / "README.md"), module_relative=False)
    assert result.attempted >= 6
    assert result.failed == 0


def test_commands_and_links_exist() -> None:
    named = set(re.findall(r"^    reba (\w+)", README, flags=re.MULTILINE))
    assert named
    assert named <= set(cli.commands)
    for link in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / link).exists(), link


def test_the_profile_in_the_documentation_loads(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "recordings.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)
    own = tmp_path / "mylab.toml"
    own.write_text(block)
    table = tmp_path / "log.csv"
    rows = [f"{i / 10},{10 + i},{i},{2 * i},{35 + i}" for i in range(30)]
    table.write_text("\n".join(["time,back_bend,back_turn,arm_raise,elbow", *rows]))
    data = reba.read(table, profile=own).data
    assert data["trunk_flexion"].iloc[0] == pytest.approx(10.0)
    assert data["lower_arm_flexion_right"].iloc[3] == pytest.approx(33.0)
    assert data["upper_arm_flexion_right"].iloc[-1] == pytest.approx(58.0)


def test_every_angle_column_is_described() -> None:
    for column in reba.COLUMNS:
        base = column.removesuffix("_left").removesuffix("_right")
        assert base in README, column
