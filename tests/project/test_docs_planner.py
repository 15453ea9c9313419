"""The page about the planner: the files and scripts that it names exist."""

from __future__ import annotations

import re

import pytest

from tests.support.paths import ROOT


@pytest.mark.parametrize("page", ["planner", "references"])
def test_named_files_exist(page: str) -> None:
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    named = re.findall(r"`((?:lgp|benchmarks)/[\w/.]+)`", text)
    assert named
    assert [name for name in named if not (ROOT / name).exists()] == []
    assert [name for name in re.findall(r"\]\((\w+\.md)\)", text) if not (ROOT / "docs" / name).exists()] == []
