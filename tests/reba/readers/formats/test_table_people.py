"""Tables with rows of several people, or of several recordings: never one person made of two."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import reba
from reba.errors import ProfileError
from tests.support.says import says

N = 80
PLACES = {
    "left_hip": (0.0, 0.1, 0.9), "right_hip": (0.0, -0.1, 0.9), "left_shoulder": (0.0, 0.2, 1.4),
    "right_shoulder": (0.0, -0.2, 1.4), "left_elbow": (0.0, 0.2, 1.1), "right_elbow": (0.0, -0.2, 1.1),
    "left_wrist": (0.2, 0.2, 1.0), "right_wrist": (0.2, -0.2, 1.0), "nose": (0.1, 0.0, 1.6),
}  # fmt: skip


def postures(flexion: float, start: float = 0.0, step: float = 0.1) -> pd.DataFrame:
    time = start + step * np.arange(N)
    return pd.DataFrame(
        {"time": time.round(6), "trunk_flexion": flexion + np.linspace(0, 5, N), "knee_flexion_left": 3.0}
    )


def points(lean: float, start: float = 0.0) -> pd.DataFrame:
    columns = {"time": (start + 0.1 * np.arange(N)).round(6)}
    for name, place in PLACES.items():
        for axis, value in zip("xyz", place, strict=True):
            columns[f"{name}_{axis}"] = value + (axis == "x") * (lean * place[2] + 0.01 * np.sin(np.arange(N)))
    return pd.DataFrame(columns)


def both(one: pd.DataFrame, other: pd.DataFrame, column: str, ids: tuple[object, object]) -> pd.DataFrame:
    """Return the rows of both in the order of time."""
    rows = pd.concat([one.assign(**{column: ids[0]}), other.assign(**{column: ids[1]})])
    return rows.sort_values("time", kind="stable").reset_index(drop=True)


def saved(path: Path, table: pd.DataFrame) -> Path:
    if path.suffix == ".xlsx":
        table.to_excel(path, index=False)
    elif path.suffix == ".parquet":
        table.to_parquet(path)
    else:
        table.to_csv(path, index=False)
    return path


@pytest.mark.parametrize("ending", [".csv", ".parquet", ".xlsx"])
@pytest.mark.parametrize("make", [postures, points])
@pytest.mark.parametrize(
    ("column", "ids"), [("person_id", (3, 7)), ("Worker", ("Ann", "Bo")), ("track id", (1.0, 2.0))]
)
def test_two_people_at_once_are_a_question(tmp_path: Path, ending, make, column, ids) -> None:
    other = make(0.6, start=0.05)
    path = saved(tmp_path / f"two{ending}", both(make(0.0), other, column, ids))
    labels = [f"{one:g}" if isinstance(one, float) else str(one) for one in ids]
    with pytest.raises(ProfileError) as caught:
        reba.read(path)
    says(caught.value, *labels, "--topic")
    alone = reba.read(saved(tmp_path / f"alone{ending}", other))
    table = reba.read(path, topic=labels[1])
    np.testing.assert_allclose(table.data["trunk_flexion"], alone.data["trunk_flexion"], atol=1e-9)
    np.testing.assert_allclose(np.diff(table.data["time"]), 0.1, atol=1e-6)
    mine, *others = table.quality.accounts
    assert (mine["read"], mine["used"]) == (N, N)
    assert {"other_stream": N} in [account["not_used"] for account in others if account["stream"] == labels[0]]


def test_people_one_below_the_other_are_a_question(tmp_path: Path) -> None:
    table = pd.concat([postures(0).assign(subject="S1"), postures(60).assign(subject="S2")])
    with pytest.raises(ProfileError) as caught:
        reba.read(saved(tmp_path / "stacked.csv", table))
    says(caught.value, "S1", "S2")
    assert reba.read(tmp_path / "stacked.csv", topic="S2").data["trunk_flexion"].min() == 60


def test_people_of_a_table_without_times_are_a_question(tmp_path: Path) -> None:
    table = both(postures(0), postures(60, start=0.05), "person", (0, 1)).drop(columns="time")
    path = saved(tmp_path / "untimed.csv", table)
    with pytest.raises(ProfileError) as caught:
        reba.read(path, rate=10)
    says(caught.value, "--topic")
    one = reba.read(path, rate=10, topic="1")
    np.testing.assert_allclose(one.data["time"], np.arange(N) / 10)


@pytest.mark.parametrize("step", [0.1, 2.0])
def test_an_id_that_a_tracker_renewed_is_one_person(tmp_path: Path, step: float) -> None:
    table = postures(0, step=step).assign(track_id=np.repeat([3, 8], [30, N - 30]))
    read = reba.read(saved(tmp_path / "renewed.csv", table))
    assert len(read.data) == N
    assert any("3 " in text and "8 " in text and "one person" in text for text in read.quality.warnings)


@pytest.mark.parametrize(
    ("column", "values"), [("id", np.arange(N)), ("id", np.zeros(N)), ("weight", np.arange(N) % 2)]
)
def test_other_columns_name_nobody(tmp_path: Path, column: str, values: np.ndarray) -> None:
    read = reba.read(saved(tmp_path / "rows.csv", postures(0).assign(**{column: values})))
    assert (len(read.data), read.quality.warnings) == (N, ())


def test_frames_without_a_row_take_their_time(tmp_path: Path) -> None:
    table = postures(0).drop(columns="time").assign(frame=np.arange(5, N + 5))
    read = reba.read(saved(tmp_path / "frames.csv", table[(table.frame < 20) | (table.frame >= 40)]), rate=10)
    np.testing.assert_allclose(read.data["time"], np.r_[np.arange(15), np.arange(35, N)] / 10)


def long(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of points with a row for each point and frame."""
    rows = [
        {"time": row["time"], "landmark": name, "id": number, **{axis: row[f"{name}_{axis}"] for axis in "xyz"}}
        for _, row in table.iterrows()
        for number, name in enumerate(PLACES)
    ]
    return pd.DataFrame(rows)


@pytest.mark.parametrize("start", [0.0, 0.05])
def test_people_in_rows_of_points_are_a_question(tmp_path: Path, start: float) -> None:
    table = both(long(points(0.0)), long(points(0.6, start=start)), "subject", ("Ann", "Bo"))
    path = saved(tmp_path / "long.csv", table)
    with pytest.raises(ProfileError) as caught:
        reba.read(path)
    says(caught.value, "Ann", "Bo", "--topic")
    alone = reba.read(saved(tmp_path / "alone.csv", points(0.6, start=start)))
    np.testing.assert_allclose(reba.read(path, topic="Bo").data, alone.data, atol=1e-9)


def test_rows_of_points_are_accounted_for_once(tmp_path: Path) -> None:
    read = reba.read(saved(tmp_path / "points.csv", points(0.0)))
    assert [(account["read"], account["used"]) for account in read.quality.accounts] == [(N, N)]


def test_numbers_of_points_are_no_people(tmp_path: Path) -> None:
    read = reba.read(saved(tmp_path / "long.csv", long(points(0.0))))
    assert len(read.data) == N


def test_rows_that_repeat_a_point_are_noted(tmp_path: Path) -> None:
    table = pd.concat([long(points(0.0)), long(points(0.6))])
    read = reba.read(saved(tmp_path / "long.csv", table))
    assert any(f"{N * len(PLACES)} of {2 * N * len(PLACES)} rows" in text for text in read.quality.warnings)


def test_a_unit_of_rows_of_points_is_their_unit(tmp_path: Path) -> None:
    table = long(points(0.0)).rename(columns={axis: f"{axis} (in)" for axis in "xyz"})
    read = reba.read(saved(tmp_path / "long.csv", table))
    assert not any("unit of the points" in text for text in read.quality.warnings)
