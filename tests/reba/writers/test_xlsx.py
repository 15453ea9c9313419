"""Workbooks: sheets and values, the same bytes twice, and formulas that take every frame to its REBA."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest

import reba
from reba.errors import RebaError
from reba.posture.columns import COLUMNS
from reba.readers.formats.score_file import is_score_file
from reba.writers import xlsx
from tests.support.says import says
from tests.support.spreadsheet import Book

N = 40
RULES = [
    reba.PRESETS["measured"],
    reba.PRESETS["paper"],
    reba.PRESETS["measured"].replace(name="other", edges="upper", twist_and_bend="two", seated_knees=True),
    reba.PRESETS["measured"].replace(name="gravity", upper_arm_reference="gravity", two_sides="left", walking_legs=2),
]


def scored(rules: reba.Rules, seed: int = 0) -> reba.Scores:
    """Score random postures, some angles on edges and some not measured, with every factor."""
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-70.0, 130.0, (N, len(COLUMNS)))
    edges = rng.random(angles.shape) < 0.3
    angles[edges] = rng.choice([-60.0, -20.0, -5.0, 0.0, 5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0], edges.sum())
    angles[rng.random(angles.shape) < 0.03] = np.nan
    frames = pd.DataFrame(angles, columns=COLUMNS).assign(time=np.arange(N) / 10.0)
    return reba.score(
        frames,
        rules=rules,
        activity="none",
        load=rng.choice([0.0, 5.0, 7.0, 10.0, 12.0], N),
        shock=rng.random(N) < 0.2,
        coupling=rng.integers(0, 4, N),
        support=rng.choice(["bilateral", "unilateral", "walking", "sitting"], N),
        arm_supported_left=rng.random(N) < 0.3,
        static=rng.random(N) < 0.3,
        unstable=rng.random(N) < 0.3,
    )


@pytest.mark.parametrize("rules", RULES, ids=lambda rules: rules.name)
def test_the_formulas_take_every_frame_to_its_score(tmp_path: Path, rules: reba.Rules) -> None:
    scores = scored(rules)
    reba.write_scores(scores, tmp_path / "s.xlsx")
    book = Book(tmp_path / "s.xlsx")
    row, check = (book.row_of("Worksheet", text) for text in ("REBA", "The formulas agree with it"))
    low, high = (scores.data[name].tolist() for name in ("reba_low", "reba_high"))
    assert low != high  # some angles are not measured
    for frame in range(N):
        book.set("Worksheet", "B1", frame + 1)
        assert (book.value("Worksheet", f"C{row}"), book.value("Worksheet", f"D{row}")) == (low[frame], high[frame])
        assert book.value("Worksheet", f"B{check}") == "yes"


def test_sheets_hold_what_the_other_formats_do(tmp_path: Path) -> None:
    scores = scored(RULES[0])
    reba.write_scores(scores, tmp_path / "s.xlsx")
    reba.write_scores(scores, tmp_path / "s.csv")
    book = openpyxl.load_workbook(tmp_path / "s.xlsx", read_only=True)
    assert book.sheetnames == ["Summary", "Intervals", "Frames", "Worksheet", "Tables", "Details", "Record"]
    assert book["Record"].sheet_state == "hidden"
    frames = pd.read_excel(tmp_path / "s.xlsx", sheet_name="Frames")
    pd.testing.assert_frame_equal(frames, pd.read_csv(tmp_path / "s.csv"), check_dtype=False, rtol=1e-15)
    summary = pd.read_excel(tmp_path / "s.xlsx", sheet_name="Details").set_index("what")["value"]
    assert summary["reba.max"] == scores.summary()["reba"]["max"]
    assert summary["provenance.version"] == reba.__version__
    assert summary["rules.name"] == "measured"
    worst = pd.read_excel(tmp_path / "s.xlsx", sheet_name="Intervals")
    assert worst["worst [s]"].tolist() == [one["time"] for one in scores.summary()["worst"]]


def test_the_first_sheet_is_for_people(tmp_path: Path) -> None:
    scores = scored(RULES[0])
    reba.write_scores(scores, tmp_path / "s.xlsx")
    shown = pd.read_excel(tmp_path / "s.xlsx", sheet_name="Summary").set_index("what")
    value, highest = shown["value"], shown["highest, where angles were not measured"]
    summary = scores.summary()
    assert value["Result"] == summary["verdict"]["text"]
    for name, title in (("p90", "90th percentile"), ("mean", "mean"), ("max", "maximum")):
        low, high = (summary["range"][f"{name}_{end}"] for end in ("low", "high"))
        assert value[f"REBA, {title}"] == pytest.approx(low, abs=0.005)
        assert np.isnan(highest[f"REBA, {title}"]) if low == high else highest[f"REBA, {title}"] == round(high, 2)
    shares = value[[name for name in shown.index if "of the time]" in name]].astype(float)
    assert len(shares) == 6
    assert shares.sum() == pytest.approx(100.0, abs=0.05)
    assert not any(re.search(r"[a-z]\.[a-z]|_", name) for name in shown.index)  # words, no names of fields


def test_a_workbook_of_scores_is_read_back(tmp_path: Path) -> None:
    scores = scored(RULES[0])
    reba.write_scores(scores, tmp_path / "s.xlsx")
    again = reba.read(tmp_path / "s.xlsx")
    np.testing.assert_allclose(again.data[list(COLUMNS)], scores.angles, rtol=1e-15)


@pytest.mark.parametrize("rules", RULES, ids=lambda rules: rules.name)
def test_a_workbook_is_scored_again_by_the_rules_that_it_was_recorded_with(tmp_path: Path, rules: reba.Rules) -> None:
    scores = scored(rules)
    reba.write_scores(scores, tmp_path / "s.xlsx")
    again = reba.read_scores(tmp_path / "s.xlsx")
    assert again.rules == scores.rules
    for name in ("reba_low", "reba_high"):
        np.testing.assert_array_equal(again.data[name], scores.data[name])
    assert is_score_file(tmp_path / "s.xlsx")
    reba.write_postures(reba.read(tmp_path / "s.xlsx"), tmp_path / "p.xlsx")
    assert not is_score_file(tmp_path / "p.xlsx")


def test_characters_that_no_workbook_holds_are_written_as_their_codes(tmp_path: Path) -> None:
    given = tmp_path / "left\x1b[31m\udcff.csv"
    given.write_text('time,trunk_flexion,"note\x1b[2J"\n0,10,a\ufffeb\n1,20,\x07\n', encoding="utf-8")
    table = reba.read(given)
    reba.write_postures(table, tmp_path / "out.xlsx")
    reba.write_scores(reba.score(table), tmp_path / "scores.xlsx")
    frames = pd.read_excel(tmp_path / "out.xlsx", sheet_name="Frames")
    assert frames["note\\x1b[2J"].tolist() == ["a\\ufffeb", "\\x07"]
    for sheet in ("Summary", "Details"):
        assert "\x1b" not in pd.read_excel(tmp_path / "scores.xlsx", sheet_name=sheet).astype(str).to_string()


def test_a_sheet_of_another_program_with_the_name_is_a_sheet(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    book.active.title = "Frames"
    book.create_sheet("Record").append(["name", "value"])
    for row in (["time", "trunk_flexion"], [0.0, 10.0], [0.1, 20.0]):
        book["Frames"].append(row)
    book.save(tmp_path / "own.xlsx")
    read = reba.read(tmp_path / "own.xlsx")
    assert read.scored is None
    assert read.data["trunk_flexion"].tolist() == [10.0, 20.0]


def test_the_same_scores_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.xlsx", "b.xlsx"):
        reba.write_scores(scored(RULES[0]), tmp_path / name)
    assert (tmp_path / "a.xlsx").read_bytes() == (tmp_path / "b.xlsx").read_bytes()
    assert [path.name for path in tmp_path.iterdir()] != []


def test_more_frames_than_a_sheet_holds_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xlsx, "MOST_FRAMES", N - 1)
    with pytest.raises(RebaError) as error:
        reba.write_scores(scored(RULES[0]), tmp_path / "s.xlsx")
    says(error, f"{N - 1} frames", str(N), ".parquet", "--start")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("soffice") is None, reason="LibreOffice is not installed")
def test_libreoffice_computes_the_same(tmp_path: Path) -> None:
    reba.write_scores(scored(RULES[2]), tmp_path / "s.xlsx")
    command = ["soffice", f"-env:UserInstallation=file://{tmp_path}/user", "--headless", "--convert-to", "xlsx"]
    subprocess.run([*command, "--outdir", tmp_path / "out", tmp_path / "s.xlsx"], capture_output=True, check=True)
    sheet = openpyxl.load_workbook(tmp_path / "out" / "s.xlsx", data_only=True)["Worksheet"]
    cells = {row[0].value: row for row in sheet.iter_rows()}
    assert cells["The formulas agree with it"][1].value == "yes"
    assert isinstance(cells["REBA"][2].value, int)
