"""The guide to surrogates: its examples print what they say, its links, kinds and commands exist."""

from __future__ import annotations

import doctest
import re

import dreba
from dreba.cli import cli
from tests.support.paths import ROOT

GUIDE = ROOT / "docs" / "surrogates.md"
TEXT = GUIDE.read_text(encoding="utf-8")


def test_examples_print_what_they_say() -> None:
    result = doctest.testfile(str(GUIDE), module_relative=False)
    assert result.attempted >= 10
    assert result.failed == 0


def test_kinds_commands_and_scripts_exist() -> None:
    kinds = TEXT.split("## The kinds")[1].split("**`quadratic`**")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", kinds, flags=re.MULTILINE)) == set(dreba.KINDS)
    assert set(re.findall(r"^    dreba (\w+)", TEXT, flags=re.MULTILINE)) <= set(cli.commands)
    for script in re.findall(r"benchmarks/\w+\.py", TEXT):
        assert (ROOT / script).exists(), script


def test_the_readme_leads_here() -> None:
    assert "docs/surrogates.md" in (ROOT / "README.md").read_text(encoding="utf-8")
