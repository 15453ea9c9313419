"""The OpenSim reader: header keys, separators, units, damage, and the real motions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reba.errors import ReadError
from reba.readers.formats.opensim import open_opensim, sniff
from reba.readers.recording.stream import ReadLog
from tests.support.paths import RECORDINGS
from tests.support.says import says

SMALL = """Coordinates
version=1
nRows=3
nColumns=4
inDegrees=yes

Units are S.I. units (second, meters, Newtons, ...)

endheader
time\tpelvis_tilt\tknee_angle_r\tpelvis_ty
      0.00\t     -1.5\t      20.25\t      0.9
      0.01\t     -1.6\t      20.5\t      0.91
      0.02\t     -1.7\t      21\t      0.92
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "small.mot"
    path.write_bytes(text.encode())
    return path


def test_columns_keep_their_names_and_numbers(tmp_path: Path) -> None:
    recording = open_opensim(write(tmp_path, SMALL))
    (stream,) = recording.streams
    assert (stream.name, stream.kind, stream.unit, stream.up, stream.count) == ("small", "joints", "deg", "y", 3)
    assert stream.names == ("pelvis_tilt", "knee_angle_r", "pelvis_ty")
    log = ReadLog()
    (block,) = stream.blocks(log)
    np.testing.assert_array_equal(block.time, [0, 0.01, 0.02])
    np.testing.assert_array_equal(block.values, [[-1.5, 20.25, 0.9], [-1.6, 20.5, 0.91], [-1.7, 21, 0.92]])
    assert (log.messages, log.skipped, log.warnings, log.time_source) == (3, 0, [], "time column")


@pytest.mark.parametrize(
    ("old", "new", "unit"),
    [("=yes", "=no", "rad"), ("=yes", "=Yes", "deg"), ("inDegrees=yes\n", "", ""), ("=yes", "=perhaps", "")],
)
def test_the_unit_is_the_stated_one(tmp_path: Path, old: str, new: str, unit: str) -> None:
    recording = open_opensim(write(tmp_path, SMALL.replace(old, new)))
    assert recording.streams[0].unit == unit
    assert bool(recording.log.warnings) == ("perhaps" in new)


@pytest.mark.parametrize("change", [("\t", ","), ("\t", "   "), ("\n", "\r\n"), ("\n", "\t\n"), ("time", "\ufefftime")])
def test_separators_and_line_ends_do_not_matter(tmp_path: Path, change: tuple[str, str]) -> None:
    text = SMALL.replace(*change) if change[0] != "time" else "\ufeff" + SMALL
    (block,) = open_opensim(write(tmp_path, text)).streams[0].blocks()
    assert block.names == ("pelvis_tilt", "knee_angle_r", "pelvis_ty")
    np.testing.assert_array_equal(block.values[:, 1], [20.25, 20.5, 21])


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("nRows=3", "nRows=999999999999", "'999999999999' rows | file has 3"),
        ("nColumns=4", "datacolumns 9", "'9' columns | file has 4"),
        ("knee_angle_r", "pelvis_tilt", "'pelvis_tilt' | more than once | 'pelvis_tilt_2'"),
        ("0.02\t", "0.005\t", "time runs backwards 1 times"),
        ("0.02\t", "0.01\t", "1 samples have the time of the one before"),
        ("\t      0.92\n", "", "line 13 ends after 3 of 4 numbers"),
    ],
)
def test_what_is_odd_is_noted(tmp_path: Path, old: str, new: str, what: str) -> None:
    recording = open_opensim(write(tmp_path, SMALL.replace(old, new)))
    says(" ".join([*recording.log.warnings, recording.log.ended_abnormally or ""]), *what.split(" | "))
    assert len(recording.streams[0].names) == 3


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("endheader", "", "no line 'endheader'"),
        ("20.5", "2o.5", "line 12: '2o.5' is not a number"),
        ("20.5", "inf", "line 12: 'inf' is not a finite number"),
        ("20.5\t", "", "line 12 has 3 numbers, expected 4"),
        ("20.5", "20.5\t3", "line 12 has 5 numbers, expected 4"),
        ("time", "zeit", "line 10 | column names | 'time' first | zeit"),
        ("version=1", "DataType=Quaternion", "DataType is 'Quaternion', expected double"),
        (SMALL[SMALL.index("      0.00") :], "", "no complete row | line 10"),
        (SMALL[SMALL.index("time\t") :], "", "'endheader' | line 9"),
    ],
)
def test_damage_is_told_with_its_line(tmp_path: Path, old: str, new: str, what: str) -> None:
    with pytest.raises(ReadError) as caught:
        open_opensim(write(tmp_path, SMALL.replace(old, new)))
    says(caught, *what.split(" | "))


def test_sniff_looks_at_the_content() -> None:
    assert sniff(Path("a.txt"), SMALL.encode())
    assert sniff(Path("a.sto"), b"name\ndatacolumns 3\n")
    assert not sniff(Path("a.mot"), b"\x00\x01\x02")
    assert not sniff(Path("a.csv"), b"time,endheader\n")


REAL = [
    ("balancing_pose2sim/balancing_LSTM.mot", "deg", 100, 68, "knee_angle_r", (1, 67)),
    ("irsst_box_lift/inverse_kin.mot", "deg", 88, 25, "elbow_flexion", (25, 138)),
    ("running_opensim/subject02_running_arms_ik.mot", "", 600, 160, "knee_angle_r", (-112, -5)),
    ("squat_opencap/squats1_videoAndMocap.mot", "deg", 801, 35, "knee_angle_r", (-1, 89)),
]


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="the real recordings are not beside the checkout")
@pytest.mark.parametrize(("name", "unit", "count", "columns", "joint", "limits"), REAL)
def test_real_files(name: str, unit: str, count: int, columns: int, joint: str, limits: tuple[float, float]) -> None:
    (stream,) = open_opensim(RECORDINGS / name).streams
    assert (stream.unit, stream.count, len(stream.names)) == (unit, count, columns)
    values = np.concatenate([block.values for block in stream.blocks(names=[joint])])
    assert values.shape == (count, 1)
    assert limits[0] <= values.min() < values.max() <= limits[1]


@pytest.mark.parametrize("word", ["", "nan", "NaN", "-nan(ind)", "-1.#IND", "1.#QNAN", "#N/A", "--", "NULL"])
def test_a_cell_without_a_number_is_a_gap(tmp_path: Path, word: str) -> None:
    (block,) = open_opensim(write(tmp_path, SMALL.replace("      20.5", word))).streams[0].blocks()
    np.testing.assert_array_equal(block.values[:, 1], [20.25, np.nan, 21.0])


@pytest.mark.parametrize("separator", ["\t", ";", " "])
def test_decimal_commas_are_read(tmp_path: Path, separator: str) -> None:
    head, _, rows = SMALL.partition("pelvis_ty\n")
    rows = "\n".join(separator.join(line.split()) for line in rows.splitlines()).replace(".", ",")
    (block,) = open_opensim(write(tmp_path, f"{head}pelvis_ty\n{rows}\n")).streams[0].blocks()
    np.testing.assert_allclose(block.values[:, 1], [20.25, 20.5, 21.0])
    np.testing.assert_allclose(block.time, [0.0, 0.01, 0.02])
