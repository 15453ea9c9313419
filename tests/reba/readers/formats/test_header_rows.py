"""Tables with names in several rows or with numbered points: as the same table with a name for each column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from reba.errors import ProfileError
from reba.posture.columns import COLUMNS
from reba.posture.table import PostureTable
from reba.readers import read
from reba.readers.formats.header_rows import fields_of, names_of_rows
from reba.readers.formats.table_columns import LANDMARKS
from tests.reba.readers.test_partial_skeletons import COCO, PERSON
from tests.support.says import says

POINTS = {word: PERSON[name] for name, word in COCO.items()}
TIME = np.arange(80) / 30.0


def _wide(spelling: str = "{}_{}") -> pd.DataFrame:
    data = {
        spelling.format(word, axis): place[:, at] for word, place in POINTS.items() for at, axis in enumerate("xyz")
    }
    return pd.DataFrame({"time": TIME, **data})


def _expected(folder: Path) -> PostureTable:
    path = folder / "wide.csv"
    _wide().to_csv(path, index=False)
    return read(path)


def _same(measured: PostureTable, expected: PostureTable) -> None:
    assert measured.profile == expected.profile
    columns = [name for name in COLUMNS if name in expected.data]
    np.testing.assert_allclose(measured.data[columns], expected.data[columns], atol=1e-6)


def _rows(*header: list[str], index: bool = True) -> str:
    values = np.column_stack([TIME if index else np.arange(80), *POINTS.values()])
    return "\n".join([*map(",".join, header), *(",".join(map(repr, row)) for row in values.tolist())]) + "\n"


def _each(first: str, words: list[str]) -> list[str]:
    return [first, *(word for word in words for _ in "xyz")]


AXES = [*"xyz"] * len(POINTS)
MERGED = ["time", *(field for word in POINTS for field in (word, "", ""))]
HEADERS = {
    "repeated": [_each("time", list(POINTS)), ["", *AXES]],
    "merged": [MERGED, ["", *(axis.upper() for axis in AXES)]],
    "pandas": [_each("", list(POINTS)), ["", *AXES], ["time", *[""] * len(AXES)]],
}


@pytest.mark.parametrize("name", HEADERS)
def test_points_over_a_row_of_axes(tmp_path: Path, name: str) -> None:
    path = tmp_path / "rows.csv"
    path.write_text(_rows(*HEADERS[name]))
    _same(read(path), _expected(tmp_path))


@pytest.mark.parametrize("person", [[], [["individuals", *["anna"] * len(AXES)]]])
def test_rows_of_deeplabcut_have_no_times(tmp_path: Path, person: list[list[str]]) -> None:
    path = tmp_path / "dlc.csv"
    scorer = ["scorer", *["net_3d"] * len(AXES)]
    path.write_text(_rows(scorer, *person, _each("bodyparts", list(POINTS)), ["coords", *AXES], index=False))
    _same(read(path, rate=30.0), _expected(tmp_path))


def test_a_place_of_a_damaged_cell_is_its_line(tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    lines = _rows(*HEADERS["repeated"]).splitlines()
    lines[9] = lines[9].replace(lines[9].split(",")[1], "abc", 1)
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(Exception, match="line 10"):
        read(path)


ANGLES = pd.DataFrame({"time": TIME, "trunk_flexion": 10 + 20 * TIME, "knee_flexion_left": 30 - TIME})
ABOVE = {
    "groups": [["", "Trunk", "Knee"], list(ANGLES)],
    "merged": [["Time (s)", "Angles", ""], ["", "Trunk Flexion (deg)", "knee_flexion_left"]],
    "units": [["", "Trunk", "Knee"], list(ANGLES), ["[s]", "[deg]", "[deg]"]],
    "title": [["Subject", "Anna", ""], ["Trial", "three", ""], list(ANGLES)],
}


@pytest.mark.parametrize("name", ABOVE)
@pytest.mark.parametrize("suffix", ["csv", "xlsx", ";csv"])
def test_names_of_angles_below_groups_and_titles(tmp_path: Path, name: str, suffix: str) -> None:
    path, rows = tmp_path / f"groups.{suffix.strip(';')}", [*ABOVE[name], *ANGLES.to_numpy().tolist()]
    if suffix == "xlsx":
        pd.DataFrame([[cell if cell != "" else None for cell in row] for row in rows]).to_excel(
            path, index=False, header=False
        )
    else:
        mark = ";" if ";" in suffix else ","
        path.write_text("\n".join(mark.join(map(str, row)) for row in rows) + "\n")
    table = read(path)
    for column in ANGLES:
        np.testing.assert_allclose(table.data[column], ANGLES[column], err_msg=column)


def test_a_line_with_a_title_alone(tmp_path: Path) -> None:
    path = tmp_path / "title.csv"
    path.write_text("Trial 3\n" + ANGLES.to_csv(index=False, sep=";"))
    np.testing.assert_allclose(read(path).data["trunk_flexion"], ANGLES["trunk_flexion"])


@pytest.mark.parametrize(
    "levels", [("", ""), ("scorer", "bodyparts", "coords"), ("individuals", "bodyparts", "coords")]
)
def test_columns_of_several_levels(tmp_path: Path, levels: tuple[str, ...]) -> None:
    columns = [("net", word, axis)[-len(levels) :] for word in POINTS for axis in "xyz"]
    frame = pd.DataFrame(np.column_stack(list(POINTS.values())), index=pd.Index(TIME, name="time"))
    frame.columns = pd.MultiIndex.from_tuples(columns, names=[level or None for level in levels])
    frame.to_parquet(tmp_path / "levels.parquet")
    _same(read(tmp_path / "levels.parquet"), _expected(tmp_path))
    angles = ANGLES.set_axis(
        pd.MultiIndex.from_tuples([("time", ""), ("trunk", "flexion"), ("knee", "flexion")]), axis=1
    )
    angles.to_parquet(tmp_path / "angles.parquet")
    np.testing.assert_allclose(read(tmp_path / "angles.parquet").data["trunk_flexion"], ANGLES["trunk_flexion"])


def test_words_in_rows_of_numbers_are_no_names() -> None:
    assert names_of_rows([["time", "joint", "angle"], ["0", "trunk_flexion", "5.0"]]) is None


@pytest.mark.parametrize("rows", [["a,b,c", "1,2,3"], ["x,y,z,x,y,z,x,y,z,x,y,z", "1,2,3"], ["time,x,y,z", "0,1,2,3"]])
def test_other_tables_have_names_in_one_row(rows: list[str]) -> None:
    assert names_of_rows(fields_of(rows, ",")) is None


@pytest.mark.parametrize("spelling", ["{}_landmark_{}", "{}.{}", "{}_keypoint_{}"])
def test_words_behind_the_name_of_a_point(tmp_path: Path, spelling: str) -> None:
    path = tmp_path / "words.csv"
    _wide(spelling).to_csv(path, index=False)
    _same(read(path), _expected(tmp_path))


@pytest.mark.parametrize(
    "spelling", ["{axis}{number}", "{axis}_{number}", "landmark_{number}_{axis}", "{number}_{axis}"]
)
@pytest.mark.parametrize("first", [0, 1])
def test_33_numbered_points_are_those_of_mediapipe(tmp_path: Path, spelling: str, first: int) -> None:
    nose = POINTS["nose"]
    data = {
        spelling.format(axis=axis, number=number): POINTS.get(name, nose)[:, at]
        for number, name in enumerate(LANDMARKS, start=first)
        for at, axis in enumerate("xyz")
    }
    named = {f"{name}_{axis}": POINTS.get(name, nose)[:, at] for name in LANDMARKS for at, axis in enumerate("xyz")}
    path, other = tmp_path / "numbers.csv", tmp_path / "names.csv"
    pd.DataFrame({"time": TIME, **data}).to_csv(path, index=False)
    pd.DataFrame({"time": TIME, **named}).to_csv(other, index=False)
    measured = read(path)
    _same(measured, read(other))
    says(" ".join(measured.quality.warnings), "33 numbered points", "MediaPipe")


def test_other_numbers_of_points_are_a_question(tmp_path: Path) -> None:
    path = tmp_path / "numbers.csv"
    data = {
        f"{axis}{number}": place[:, at] for number, place in enumerate(POINTS.values()) for at, axis in enumerate("xyz")
    }
    pd.DataFrame({"time": TIME, **data}).to_csv(path, index=False)
    with pytest.raises(ProfileError) as caught:
        read(path)
    says(caught, "numbered points", "[points]", "--profile")


def test_a_long_table_calls_its_points_joint_name_and_gaps_missing(tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    rows = [(at, word, *place[at]) for at in range(80) for word, place in POINTS.items()]
    table = pd.DataFrame(rows, columns=["frame", "joint_name", "x", "y", "z"]).astype(dict.fromkeys("xyz", object))
    table.loc[table["frame"] == 5, ["x", "y", "z"]] = "missing"
    table.to_csv(path, index=False)
    measured, expected = read(path, rate=30.0), _expected(tmp_path)
    assert np.isnan(measured.data["knee_flexion_left"][5])
    kept = np.arange(80) != 5
    np.testing.assert_allclose(
        measured.data["knee_flexion_left"][kept], expected.data["knee_flexion_left"][kept], atol=1e-6
    )


def test_a_blank_line_below_the_axes_names_nothing() -> None:
    rows = [",,Hip,Hip,Hip,Knee,Knee,Knee,Foot,Foot,Foot,Toe,Toe,Toe", "Frame,Time" + 4 * ",X,Y,Z"]
    plain = names_of_rows(fields_of([*rows, "0,0.0,1,2,3"], ","))
    assert plain is not None
    assert names_of_rows(fields_of([*rows, "", "0,0.0,1,2,3"], ",")) == plain
