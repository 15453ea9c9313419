"""Texts in cells: nothing that a spreadsheet computes, exactly the same text when read again, numbers as they are."""

from __future__ import annotations

import ast
import csv
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

import reba
from reba.cells import cell_of, cells_of, text_of
from tests.support.paths import ROOT

FORMULAS = ("=1+1", "+1+1", "-1+1", "@SUM(A1)", "\t=1", "\r=1", "=HYPERLINK(A1)", "-knee", " =1+1", "\uff1d1+1", "\n=1")


@pytest.mark.parametrize("text", FORMULAS)
def test_no_text_is_computed(text: str) -> None:
    assert cell_of(text) == f"'{text}"
    assert text_of(cell_of(text)) == text


@pytest.mark.parametrize("value", ["left arm", "'quoted'", "it's", "-5", "-5.25e-3", "+.5", -5, -5.25, True, None, ""])
def test_other_values_stay(value: object) -> None:
    assert cell_of(value) is value
    assert text_of(value) is value


@given(st.text(alphabet="'=+-@\t\r 1.ex", max_size=6))
def test_every_text_is_read_again(text: str) -> None:
    assert text_of(cell_of(text)) == text


def test_a_csv_that_is_written_has_no_formula_and_is_read_the_same(tmp_path: Path) -> None:
    words = ["=cmd|' /C calc'!A0", "'=x"]  # factors are checked where they are scored
    data = pd.DataFrame({"time": [0.0, 0.1], "trunk_flexion": [-5.5, 30.0], "support": words, "load": [1.0, -2.0]})
    given = tmp_path / "given.csv"
    data.to_csv(given, index=False)
    path = tmp_path / "table.csv"
    reba.write_postures(reba.read(given), path)
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    for cell in (*header, *rows[0], *rows[1]):
        assert not cell.startswith(("=", "+", "@")), cell
        assert not cell.startswith("-") or float(cell) < 0
    assert [row[header.index("trunk_flexion")] for row in rows] == ["-5.5", "30.0"]
    pd.testing.assert_frame_equal(reba.read(path).data, reba.read(given).data)
    assert reba.read(path).data["support"].tolist()[0] == words[0]


def test_two_columns_of_one_name_stay_two() -> None:
    data = pd.DataFrame([["=a", 1.0, "=b"]], columns=["x", "-x", "x"])
    assert cells_of(data).to_numpy().tolist() == [["'=a", 1.0, "'=b"]]
    assert list(cells_of(data).columns) == ["x", "'-x", "x"]
    assert list(data.columns) == ["x", "-x", "x"]


def test_every_table_for_spreadsheets_is_made_of_cells() -> None:
    bare = []
    for package in ("reba", "dreba", "lgp"):
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                called = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
                owner, _, name = called.rpartition(".")
                if name in ("to_csv", "to_excel") and not owner.startswith("cells_of("):
                    bare.append(f"{path.relative_to(ROOT)}: {called}")
                bare += [f"{path.relative_to(ROOT)}: {called}"] if called in ("csv.writer", "csv.DictWriter") else []
    assert bare == []
