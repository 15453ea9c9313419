"""Units behind names or below them, and points whose coordinates are columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import reba
from reba.readers.formats.table_columns import coordinates
from tests.support.paths import DATASETS
from tests.support.says import says

ANGLES = np.linspace(5.0, 60.0, 40)


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("trunk_flexion (deg)", 1.0),
        ("Trunk Flexion [°]", 1.0),
        ("trunk_flexion (rad)", np.pi / 180),
        ("Trunk-Flexion", 1.0),
    ],
)
@pytest.mark.parametrize("time", ["Time (s)", "time_ms", "time"])
def test_units_behind_names(tmp_path: Path, name: str, factor: float, time: str) -> None:
    seconds = np.arange(40) / 10 * (1000 if time.endswith("ms") else 1)
    pd.DataFrame({time: seconds, name: ANGLES * factor}).to_csv(tmp_path / "x.csv", index=False)
    table = reba.read(tmp_path / "x.csv")
    np.testing.assert_allclose(table.data["trunk_flexion"], ANGLES)
    np.testing.assert_allclose(table.data["time"], np.arange(40) / 10)


def test_a_row_of_units(tmp_path: Path) -> None:
    rows = [f"{at * 100},{np.radians(angle)},{angle}" for at, angle in enumerate(ANGLES)]
    (tmp_path / "x.csv").write_text("\n".join(["time,trunk_flexion,neck_flexion", "ms,rad,deg", *rows]) + "\n")
    table = reba.read(tmp_path / "x.csv")
    np.testing.assert_allclose(table.data["trunk_flexion"], ANGLES)
    np.testing.assert_allclose(table.data["neck_flexion"], ANGLES)
    np.testing.assert_allclose(table.data["time"], np.arange(40) / 10)


@pytest.mark.parametrize("form", ["{}_{}", "{}.{}", "{} {}"])
@pytest.mark.parametrize(("unit", "scale"), [("", 1.0), ("", 1000.0), (" (mm)", 1000.0), (" [cm]", 100.0)])
@pytest.mark.parametrize("upper", [False, True])
def test_points_by_their_coordinates(tmp_path: Path, form: str, unit: str, scale: float, upper: bool) -> None:
    source = DATASETS / "balancing_keypoints.trc"
    expected = reba.read(source)
    from reba.readers.formats import open_recording

    stream = open_recording(source).streams[0]
    (block,) = stream.blocks()
    columns = {
        form.format(name, axis.upper() if upper else axis) + unit: block.values[:, at, index] * scale
        for at, name in enumerate(block.names)
        for index, axis in enumerate("xyz")
    }
    pd.DataFrame({"time": block.time, **columns}).to_csv(tmp_path / "points.csv", index=False)
    table = reba.read(tmp_path / "points.csv")
    assert table.profile == expected.profile
    # Both are rounded in their files.
    difference = np.abs(table.data.to_numpy(float) - expected.data.to_numpy(float))
    assert np.nanmedian(difference) < 1e-6
    assert any("unit of the points" in text for text in table.quality.warnings) == (not unit)


def test_the_rate_of_a_table_without_times(tmp_path: Path) -> None:
    pd.DataFrame({"trunk_flexion": ANGLES, "neck_flexion": 5.0}).to_csv(tmp_path / "x.csv", index=False)
    with pytest.raises(reba.ReadError) as caught:
        reba.read(tmp_path / "x.csv")
    says(caught, "no time column", "--rate")
    table = reba.read(tmp_path / "x.csv", rate=25.0)
    np.testing.assert_allclose(table.data["time"], np.arange(40) / 25)
    says(table.quality.time_source, "25 Hz")


@pytest.mark.parametrize("name", ["simulated_assembly.csv", "balancing_keypoints.trc", "simulated_palletising.mcap"])
def test_a_rate_for_a_recording_with_times_is_refused(name: str) -> None:
    with pytest.raises(reba.ReadError) as caught:
        reba.read(DATASETS / name, rate=25.0)
    says(caught, name, "times", "leave the rate out")


@pytest.mark.parametrize(
    ("unit", "factor"), [("kg", 1.0), ("N", 1 / 9.80665), ("lb", 0.45359237), ("LBS", 0.45359237), ("g", 0.001)]
)
@pytest.mark.parametrize("below", [True, False])
def test_a_named_unit_of_the_load_is_its_unit(tmp_path: Path, unit: str, factor: float, below: bool) -> None:
    rows = [f"{at / 10},{5 + at},100" for at in range(12)]
    header = ["time,trunk_flexion,load", f"s,deg,{unit}"] if below else [f"time,trunk_flexion,Load ({unit})"]
    (tmp_path / "load.csv").write_text("\n".join([*header, *rows]))
    table = reba.read(tmp_path / "load.csv")
    np.testing.assert_allclose(table.data["load"], 100 * factor)
    assert table.quality.warnings == ()


def test_a_name_without_a_side_stands_for_both(tmp_path: Path) -> None:
    rows = [f"{at / 10},{5 + at},60,{at},{20 + at},0.5" for at in range(12)]
    header = "time,trunk_flexion,Knee Flexion,upper_arm_flexion,upper_arm_flexion_left,lower_arm_flexion (rad)"
    (tmp_path / "sides.csv").write_text("\n".join([header, *rows]))
    data = reba.read(tmp_path / "sides.csv").data
    for side in ("left", "right"):
        assert (data[f"knee_flexion_{side}"] == 60).all()
        np.testing.assert_allclose(data[f"lower_arm_flexion_{side}"], np.degrees(0.5))
    np.testing.assert_array_equal(data["upper_arm_flexion_left"], 20 + np.arange(12))
    np.testing.assert_array_equal(data["upper_arm_flexion_right"], np.arange(12))


@pytest.mark.parametrize(
    "form", ["{p}_{a}", "{p}.{A}", "{p} {a}", "{p}[{a}]", "{p} ({A})", "{a}_{p}", "{A} {p}", "{p}/{a}"]
)
def test_an_axis_stands_behind_or_before_the_point(form: str) -> None:
    names = [form.format(p=point, a=axis, A=axis.upper()) for point in ("left_hip", "nose") for axis in "xyz"]
    assert coordinates(names) == {"left_hip": tuple(names[:3]), "nose": tuple(names[3:])}
