"""Licences of what the package brings along: allowed, or an exception with a reason; the README lists them."""

from __future__ import annotations

import copy
import runpy
from importlib.metadata import distribution

import pytest

from tests.support.paths import ROOT

pytest.importorskip("packaging", reason="packaging is not installed")
LICENCES = runpy.run_path(str(ROOT / "docs" / "licences.py"))


@pytest.fixture(scope="module")
def packages():
    return LICENCES["shipped"]()


def test_every_licence_is_allowed_or_an_exception(packages) -> None:
    assert {"numpy", "qpsolvers", "certifi", "docutils"} <= set(packages), "pip install -e '.[dev]'"
    assert LICENCES["not_allowed"](packages) == []


def test_exceptions_have_reasons_and_are_needed() -> None:
    policy = LICENCES["POLICY"]
    for name, one in policy["exceptions"].items():
        assert one["reason"]
        assert one["licence"] not in policy["allowed"], name


def test_a_licence_that_is_not_listed_is_named() -> None:
    policy = copy.deepcopy(LICENCES["POLICY"])
    del policy["exceptions"]["qpsolvers"]
    found = {"qpsolvers": distribution("qpsolvers")}
    assert LICENCES["not_allowed"](found, policy) == [
        f"qpsolvers {distribution('qpsolvers').version}: licence LGPL-3.0"
    ]


def test_the_readme_lists_every_direct_dependency() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    before, after = LICENCES["MARKS"]
    listed = readme.split(before)[1].split(after)[0]
    assert LICENCES["direct"]() == LICENCES["rows"](listed), "run: python docs/licences.py"
