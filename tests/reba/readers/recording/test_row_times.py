"""Times of rows: damaged, rounded, and starting again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import reba
from reba.readers.recording.row_times import row_times
from tests.support.says import says

TENTHS = np.arange(60) / 10


@pytest.mark.parametrize("times", [TENTHS, TENTHS[::-1], np.zeros(4), np.zeros(0), np.array([2.0, np.nan, 1.0])])
def test_other_times_stay_as_they_are(times: np.ndarray) -> None:
    np.testing.assert_array_equal(row_times(times).time, times)


@pytest.mark.parametrize("first", [0.0, 1.7e9])
@pytest.mark.parametrize("at", [0, 25, 59])
@pytest.mark.parametrize("wrong", [-2e9, 4e9])
def test_a_time_of_another_century_is_damaged(first: float, at: int, wrong: float) -> None:
    times = TENTHS + first
    times[at] = wrong
    found = row_times(times)
    np.testing.assert_array_equal(np.isnan(found.time), np.arange(60) == at)
    says(found.notes[0], "1 times are far")


@pytest.mark.parametrize("wrong", [0.0, 100.0])
def test_a_time_far_from_both_neighbours_is_damaged(wrong: float) -> None:
    times = TENTHS + 10
    times[[20, 59]] = wrong, 0.0
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(row_times(times).time)), [20, 59])


@pytest.mark.parametrize("scale", [1.0, 1e6])
@pytest.mark.parametrize("order", [np.random.default_rng(2).permutation(400), np.arange(400)[::-1]])
def test_rows_in_no_order_are_sorted(tmp_path: Path, scale: float, order: np.ndarray) -> None:
    time = np.arange(400) / 10
    frame = pd.DataFrame({"time": time * scale, "trunk_flexion": time}).iloc[order]
    frame.to_csv(tmp_path / "table.csv", index=False)
    table = reba.read(tmp_path / "table.csv")
    np.testing.assert_allclose(table.data["time"], time)
    np.testing.assert_allclose(table.data["trunk_flexion"], time)
    says("; ".join(table.quality.warnings), "sorted")
    assert "far from" not in str(table.quality.warnings)


def test_times_that_start_again_go_on_by_one_step() -> None:
    found = row_times(np.concatenate([TENTHS, TENTHS[:35], TENTHS[5:]]))
    np.testing.assert_allclose(found.time, np.arange(150) / 10, atol=1e-12)
    assert found.seams == pytest.approx((6.0, 9.5))
    says(found.notes[0], "start again 2 times", "not known")


def test_parts_joined_in_another_order_are_no_restart() -> None:
    assert row_times(np.concatenate([TENTHS + 6, TENTHS])).seams == ()


@pytest.mark.parametrize("step", [1.0, 60.0])
def test_rows_of_one_rounded_time_are_spread(step: float) -> None:
    times = TENTHS[3:] * step
    found = row_times(np.floor(times / step) * step)
    np.testing.assert_allclose(found.time, times, atol=1e-9)
    says(found.notes[0], "51 samples have the time of the one before", f"rounded to {step:g} s")


def test_two_rows_of_each_time_are_not_spread() -> None:
    assert (np.diff(row_times(np.repeat(TENTHS, 2)).time) == 0).sum() == 60


def test_a_table_joined_from_two_takes_keeps_all_rows_in_their_order(tmp_path: Path) -> None:
    lines = [f"{time:.1f},{index}" for index, time in enumerate([*TENTHS, *TENTHS])]
    path = tmp_path / "joined.csv"
    path.write_text("\n".join(["time,trunk_flexion", *lines]))
    table = reba.read(path)
    np.testing.assert_array_equal(table.data["trunk_flexion"], np.arange(120))
    np.testing.assert_allclose(table.data["time"], np.arange(120) / 10, atol=1e-9)
    assert table.quality.seams == pytest.approx((6.0,))
    says(" ".join(table.quality.warnings), "the clock restarts at 6.00 s")


def test_a_damaged_time_is_accounted_for(tmp_path: Path) -> None:
    lines = [f"{1_700_000_000_000 + 100 * index if index != 20 else 0},{index}" for index in range(60)]
    path = tmp_path / "damaged.csv"
    path.write_text("\n".join(["time,trunk_flexion", *lines]))
    table = reba.read(path)
    assert table.data["time"].iloc[[0, -1]].tolist() == pytest.approx([0.0, 5.9])
    (account,) = table.quality.accounts
    assert (account["read"], account["used"], account["not_used"]) == (60, 59, {"no_time": 1})


def test_a_damaged_time_leaves_its_row_out_of_blocks_and_table(tmp_path: Path) -> None:
    path = tmp_path / "doubled.csv"
    path.write_text("time,trunk_flexion,load\n0.0,10,1\n0.1,20,2\n3.5,,\n0.2,30,3\n")
    table = reba.read(path)
    assert table.data[["time", "trunk_flexion", "load"]].to_numpy().tolist() == [[0, 10, 1], [0.1, 20, 2], [0.2, 30, 3]]
    (account,) = table.quality.accounts
    assert (account["read"], account["used"], account["not_used"]) == (4, 3, {"no_time": 1})
