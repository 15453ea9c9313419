"""The README: its example runs as printed, its commands exist, its columns are the package's."""

from __future__ import annotations

import doctest
import re

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


def test_every_angle_column_is_described() -> None:
    for column in reba.COLUMNS:
        base = column.removesuffix("_left").removesuffix("_right")
        assert base in README, column
