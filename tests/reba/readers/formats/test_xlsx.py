"""Excel workbooks: the same tables as CSV files, several sheets, units, dates; bounded and refused in one line."""

from __future__ import annotations

import datetime as dt
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pandas as pd
import pytest

import reba
from reba.readers.formats import is_recording, open_recording
from reba.readers.formats.file_content import ANY_BYTES
from tests.support.paths import DATASETS
from tests.support.says import says

ANGLES = np.linspace(5.0, 60.0, 40)
Rows = list[list[Any]]


def book(folder: Path, sheets: dict[str, Rows], name: str = "shift.xlsx") -> Path:
    workbook = openpyxl.Workbook()
    workbook.remove(workbook.active)
    for title, rows in sheets.items():
        sheet = workbook.create_sheet(title)
        for row in rows:
            sheet.append(row)
    workbook.save(folder / name)
    return folder / name


def posture(names: tuple[str, ...] = ("time", "trunk_flexion", "neck_flexion"), step: float = 0.1) -> Rows:
    return [list(names), *([at * step, float(angle), 10] for at, angle in enumerate(ANGLES))]


def test_a_posture_table_is_that_of_the_csv_file(tmp_path: Path) -> None:
    source = DATASETS / "simulated_assembly.csv"
    pd.read_csv(source, comment="#").to_excel(tmp_path / "shift.xlsx", index=False)
    assert is_recording(tmp_path / "shift.xlsx")
    ours, theirs = reba.read(tmp_path / "shift.xlsx"), reba.read(source)
    assert (ours.profile, ours.topic, ours.unmeasured) == (theirs.profile, "shift", theirs.unmeasured)
    for column in theirs.data.columns:
        if theirs.data[column].dtype.kind == "f":
            np.testing.assert_allclose(ours.data[column], theirs.data[column], err_msg=column)
        else:
            assert ours.data[column].astype(str).tolist() == theirs.data[column].astype(str).tolist(), column
    mean = [reba.score(table, load=3.0).summary()["reba"]["mean"] for table in (ours, theirs)]
    assert mean[0] == pytest.approx(mean[1])


@pytest.mark.parametrize("above", [[], [["Trial 5"]], [["Trial 5"], [], ["made on", dt.datetime(2024, 5, 1)]]])
def test_titles_units_and_gaps(tmp_path: Path, above: Rows) -> None:
    rows: Rows = [["Time (s)", "Trunk Flexion [rad]", "neck_flexion (deg)", None, "note"]]
    rows += [[at / 10, float(np.radians(angle)), 10.0, None, None] for at, angle in enumerate(ANGLES)]
    rows[4][1:] = ["#N/A", "n/a", None, "lost"]
    table = reba.read(book(tmp_path, {"Data": above + rows}))
    expected = ANGLES.copy()
    expected[3] = np.nan
    np.testing.assert_allclose(table.data["trunk_flexion"], expected)
    assert np.flatnonzero(table.data["neck_flexion"].isna()).tolist() == [3]
    np.testing.assert_allclose(table.data["time"], np.arange(40) / 10)
    assert list(table.data.columns[-1:]) == ["note"]


def test_a_row_of_units_and_numbers_as_texts(tmp_path: Path) -> None:
    rows: Rows = [["time", "trunk_flexion", "neck_flexion"], ["ms", "rad", "deg"]]
    rows += [[at * 100, f"{np.radians(angle):.9f}".replace(".", ","), "10"] for at, angle in enumerate(ANGLES)]
    table = reba.read(book(tmp_path, {"Data": rows}))
    np.testing.assert_allclose(table.data["trunk_flexion"], ANGLES, atol=1e-6)
    np.testing.assert_allclose(table.data["neck_flexion"], 10.0)
    np.testing.assert_allclose(table.data["time"], np.arange(40) / 10)


def test_dates_times_of_day_and_durations(tmp_path: Path) -> None:
    start = dt.datetime(2024, 5, 1, 12, 0, 0)
    for cells, epoch in (
        ([start + dt.timedelta(seconds=at) for at in range(40)], start.replace(tzinfo=dt.UTC).timestamp()),
        ([(start + dt.timedelta(seconds=at)).time() for at in range(40)], 0.0),
        ([dt.timedelta(seconds=at) for at in range(40)], 0.0),
    ):
        rows: Rows = [
            ["time", "trunk_flexion"],
            *([cell, float(angle)] for cell, angle in zip(cells, ANGLES, strict=True)),
        ]
        table = reba.read(book(tmp_path, {"Data": rows}))
        np.testing.assert_allclose(np.diff(table.data["time"]), 1.0, atol=1e-6)
        assert table.epoch == pytest.approx(epoch)


@pytest.mark.parametrize("blank", [None, 3, 20])
def test_times_of_day_go_on_after_midnight(tmp_path: Path, blank: int | None) -> None:
    start = dt.datetime(2024, 5, 1, 23, 59, 50)
    cells: list[Any] = [(start + dt.timedelta(seconds=at)).time() for at in range(40)]
    if blank is not None:
        cells[blank] = None
    rows: Rows = [["time", "trunk_flexion"]]
    rows += [[cell, float(angle)] for cell, angle in zip(cells, ANGLES, strict=True)]
    sheet = book(tmp_path, {"Data": rows})
    (tmp_path / "shift.csv").write_text("".join(f"{'' if row[0] is None else row[0]},{row[1]}\n" for row in rows))
    timed = np.arange(40) != blank
    for path in (sheet, tmp_path / "shift.csv"):
        table = reba.read(path)
        np.testing.assert_allclose(np.diff(table.data["time"]), np.diff(np.flatnonzero(timed)), atol=1e-6)
        np.testing.assert_allclose(table.data["trunk_flexion"], ANGLES[timed])


def test_points(tmp_path: Path) -> None:
    source = open_recording(DATASETS / "balancing_keypoints.trc").streams[0]
    (block,) = source.blocks()
    names = [f"{name}_{axis}" for name in block.names for axis in "xyz"]
    values = block.values.reshape(len(block.time), -1)
    rows: Rows = [["time", *names]]
    rows += [
        [float(time), *(None if np.isnan(value) else float(value) for value in row)]
        for time, row in zip(block.time[:50], values[:50], strict=True)
    ]
    table = reba.read(book(tmp_path, {"Data": rows}))
    assert table.profile == reba.read(DATASETS / "balancing_keypoints.trc").profile


def test_the_sheet_that_is_a_table_is_read_and_named(tmp_path: Path) -> None:
    path = book(tmp_path, {"Notes": [["Recorded by Ann"], ["on Monday"]], "Empty": [], "Angles": posture()})
    table = reba.read(path)
    np.testing.assert_allclose(table.data["trunk_flexion"], ANGLES)
    says(next(text for text in table.quality.warnings if "sheet" in text), "'Angles' was read; left out: 'Notes'")
    listed = {topic["name"]: (topic["usable"], topic["why"]) for topic in reba.info(path).topics}
    assert listed["Angles"][0]
    assert not listed["Notes"][0]
    says(listed["Notes"][1], "no row of column names")


def test_two_tables_are_a_question(tmp_path: Path) -> None:
    path = book(tmp_path, {"Left": posture(), "Right": posture(step=0.2)})
    with pytest.raises(reba.ProfileError) as caught:
        reba.read(path)
    says(caught, "Left", "Right", "--topic")
    np.testing.assert_allclose(np.diff(reba.read(path, topic="Right").data["time"]), 0.2)


@pytest.mark.parametrize("state", ["hidden", "veryHidden"])
def test_a_hidden_sheet_is_read_only_alone(tmp_path: Path, state: str) -> None:
    path = book(tmp_path, {"Old": posture(step=0.2), "New": posture()})
    workbook = openpyxl.load_workbook(path)
    workbook["Old"].sheet_state = state
    workbook.active = workbook["New"]
    workbook.save(path)
    table = reba.read(path)
    np.testing.assert_allclose(np.diff(table.data["time"]), 0.1)
    says(next(text for text in table.quality.warnings if "sheet" in text), "'New' was read; left out: 'Old' (hidden)")
    assert {topic["name"]: topic["why"] for topic in reba.info(path).topics}["Old"].startswith("hidden")
    while workbook["New"].max_row > 1:
        workbook["New"].delete_rows(1)
    workbook.save(path)
    np.testing.assert_allclose(np.diff(reba.read(path).data["time"]), 0.2)


def test_the_rate_of_a_table_without_times(tmp_path: Path) -> None:
    path = book(tmp_path, {"Data": [row[1:] for row in posture()]})
    with pytest.raises(reba.ReadError) as caught:
        reba.read(path)
    says(caught, "sheet 'Data'", "no time column", "--rate")
    np.testing.assert_allclose(reba.read(path, rate=25.0).data["time"], np.arange(40) / 25)


@pytest.mark.parametrize(
    ("rows", "what"),
    [
        ([["Trial 5"]], "sheet 'Data': no row of column names"),
        ([["time", "trunk_flexion"]], "no rows"),
        ([["time", "trunk_flexion"], [0, 1], [1, "#DIV/0!"]], "sheet 'Data' row 3: '#DIV/0!' | not a number"),
        ([["title"], ["time", "trunk_flexion"], [0, 1], [], [1, "x"]], "sheet 'Data' row 5: 'x'"),
        ([["Format Version", 1.23], [None, "Type", "Bone"]], "sheet 'Data': an export of Motive | the .csv file"),
        ([["time", "trunk_flexion"], ["soon", 3], ["later", 3]], "row 2 | 'soon' | not a time"),
    ],
)
def test_what_is_wrong_names_sheet_and_row(tmp_path: Path, rows: Rows, what: str) -> None:
    with pytest.raises(reba.ReadError) as caught:
        reba.read(book(tmp_path, {"Data": rows}))
    says(caught, *what.split(" | "), "; ")


def sheet_of(rows: str) -> str:
    return (
        '<?xml version="1.0"?><worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main">'
        f'<dimension ref="A1:XFD1048576"/><sheetData>{rows}</sheetData></worksheet>'
    )


def with_sheet(folder: Path, xml: str) -> Path:
    path = book(folder, {"Data": posture()})
    with zipfile.ZipFile(path) as file:
        members = {name: file.read(name) for name in file.namelist()}
    members["xl/worksheets/sheet1.xml"] = xml.encode()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in members.items():
            file.writestr(name, data)
    return path


HEADER = (
    '<row r="1"><c r="A1" t="inlineStr"><is><t>time</t></is></c><c r="B1" t="inlineStr"><is><t>knee</t></is></c></row>'
)


def test_bombs_are_refused(tmp_path: Path) -> None:
    wide = "".join(f'<row r="{at}"><c r="XFD{at}"><v>1</v></c></row>' for at in range(2, 90))
    for xml, what in (
        (sheet_of(HEADER + " " * (2 * ANY_BYTES)), "unpacked, which no recording"),
        (sheet_of(f'{HEADER}<row r="99999999999"><c><v>1</v></c></row>'), "more than 1048576 rows"),
        (sheet_of(HEADER + wide), "10000 columns"),
    ):
        with pytest.raises(reba.ReadError) as caught:
            reba.read(with_sheet(tmp_path, xml))
        says(caught, what)


@pytest.mark.parametrize(
    "xml",
    [
        "",
        "<worksheet",
        sheet_of('<row r="x"><c r="A1"><v>1</v></c></row>'),
        sheet_of(f'{HEADER}<row r="2"><c r="A2" t="s"><v>999</v></c></row>'),
        sheet_of(f'{HEADER}<row r="2"><c r="A2"><v>1e</v></c><c r="B2" t="e"><v>x</v></c></row>'),
        '<!DOCTYPE a [<!ENTITY b "bb"><!ENTITY c "&b;&b;">]>' + sheet_of(f"{HEADER}&c;"),
    ],
)
def test_damaged_sheets_are_refused_in_one_line(tmp_path: Path, xml: str) -> None:
    with pytest.raises(reba.ReadError) as caught:
        reba.read(with_sheet(tmp_path, xml))
    says(caught, "; ")


def test_cut_anywhere_and_other_archives(tmp_path: Path) -> None:
    path = book(tmp_path, {"Data": posture()})
    data = path.read_bytes()
    for cut in range(1, len(data), 397):
        path.write_bytes(data[:cut])
        with pytest.raises(reba.ReadError):
            reba.read(path)
    for first, content, what in (
        ("mimetype", "application/vnd.oasis.opendocument.spreadsheet", "OpenDocument | .xlsx or .csv"),
        ("[Content_Types].xml", "<Types/>", "without a workbook | .xlsx or .csv"),
    ):
        with zipfile.ZipFile(path, "w") as file:
            file.writestr(first, content)
        with pytest.raises(reba.ReadError) as caught:
            reba.read(path)
        says(caught, *what.split(" | "))


def test_without_openpyxl_the_command_to_install_it_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    path = book(tmp_path, {"Data": posture()})
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(reba.RebaError) as caught:
        reba.read(path)
    says(caught, "openpyxl", 'pip install "dreba[xlsx]"')
