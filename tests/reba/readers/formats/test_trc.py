"""The TRC reader: units, gaps, separators, subjects, damage, and the real recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reba.errors import ReadError
from reba.readers.formats.trc import open_trc, sniff
from tests.support.paths import RECORDINGS
from tests.support.says import says

SMALL = (
    "PathFileType\t4\t(X/Y/Z)\tsmall.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    "100\t100\t3\t2\tmm\t100\t1\t3\n"
    "Frame#\tTime\tRHip\t\t\tNeck\t\t\n"
    "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n"
    "\n"
    "1\t0.00\t100\t200\t300\t10\t1400\t-30\n"
    "2\t0.01\t\t\t\t11\t1401\t-31\n"
    "3\t0.02\t102\tNaN\t302\t12\t1402\t-32\n"
)


def write(folder: Path, text: str) -> Path:
    path = folder / "small.trc"
    path.write_bytes(text.encode())
    return path


def values(path: Path) -> np.ndarray:
    return np.concatenate([block.values for block in open_trc(path).streams[0].blocks()])


def test_points_are_metres_and_gaps_are_nan(tmp_path: Path) -> None:
    recording = open_trc(write(tmp_path, SMALL))
    (stream,) = recording.streams
    assert (stream.name, stream.kind, stream.names, stream.up) == ("small", "points", ("RHip", "Neck"), "")
    (block,) = stream.blocks()
    np.testing.assert_allclose(block.time, [0, 0.01, 0.02])
    np.testing.assert_allclose(block.values[:, 1], [[0.01, 1.4, -0.03], [0.011, 1.401, -0.031], [0.012, 1.402, -0.032]])
    np.testing.assert_allclose(block.values[0, 0], [0.1, 0.2, 0.3])
    assert np.isnan(block.values[1:, 0]).all()
    assert recording.log.warnings == []
    assert "33.3 % gaps" in recording.topics[0].why


@pytest.mark.parametrize(("unit", "metre"), [("mm", 0.001), ("cm", 0.01), ("m", 1.0), ("Meters", 1.0)])
def test_units(tmp_path: Path, unit: str, metre: float) -> None:
    assert values(write(tmp_path, SMALL.replace("\tmm\t", f"\t{unit}\t")))[0, 1, 1] == pytest.approx(1400 * metre)


@pytest.mark.parametrize(
    "change",
    [
        ("\t", ","), ("\n", "\r\n"), ("\n\n", "\n"), ("RHip\t\t\tNeck\t\t", "RHip\tNeck"), ("-32\n", "-32"),
        ("\t", "\t\t"), ("\n", "\n\n"), ("\n", "\r\r\n"), ("\n", "\t\t\n"), ("\n", "  \n"), ("\t", " \t "),
        ("RHip\t\t\tNeck\t\t", "RHip\t\t\tNeck"), ("RHip\t\t\tNeck\t\t", "RHip\t\tNeck\t"),
        ("Frame#\tTime\t", "Frame#\t\tTime\t\t"), ("Frame#\tTime\t", "Frame\tTime (s)\t"), ("Frame#\tTime\t", "\t\t"),
        ("\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n", "X1\tY1\tZ1\tX2\tY2\tZ2\n"), ("\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n", ""),
        ("\tmm\t", "\tMM \t"), ("\tmm\t", "\tmillimeter\t"), ("PathFileType", "\n\nPathFileType"),
        ("1\t0.00\t100\t200\t300\t10\t1400\t-30", "1\t\t0.00\t\t100\t\t200\t\t300\t\t10\t\t1400\t\t-30"),
    ],
)  # fmt: skip
def test_writing_variants_give_the_same(tmp_path: Path, change: tuple[str, str]) -> None:
    expected = values(write(tmp_path, SMALL))
    np.testing.assert_array_equal(values(write(tmp_path, SMALL.replace(*change))), expected)


def test_blanks_may_separate_where_no_value_is_missing(tmp_path: Path) -> None:
    whole = SMALL.replace("\t\t\t\t11", "\t101\t201\t301\t11")
    expected = values(write(tmp_path, whole))
    for separator in (" ", "   ", " \t "):
        np.testing.assert_array_equal(values(write(tmp_path, whole.replace("\t", separator))), expected)
    with pytest.raises(ReadError) as caught:
        open_trc(write(tmp_path, whole.replace("\t201", "").replace("\t", " ")))
    says(caught, "line 8 has 7 numbers, expected 8")


def test_doubled_tabs_between_some_fields_only(tmp_path: Path) -> None:
    whole = SMALL.replace("\t\t\t\t11", "\t101\t201\t301\t11").replace("NaN", "202")
    rows = whole.index("1\t0.00")
    mixed = whole[:rows] + whole[rows:].replace("\t3", "\t\t3").replace("\t1", "\t\t1")
    np.testing.assert_array_equal(values(write(tmp_path, mixed)), values(write(tmp_path, whole)))


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "mm"), (0.1, "cm"), (0.001, "m")])
@pytest.mark.parametrize("blank", ["", " "])
def test_without_a_unit_the_size_of_the_body_decides(tmp_path: Path, factor: float, unit: str, blank: str) -> None:
    lines = SMALL.splitlines()
    for at in (6, 7, 8):
        fields = lines[at].split("\t")
        lines[at] = "\t".join(fields[:2] + [str(float(field) * factor) if field else "" for field in fields[2:]])
    path = write(tmp_path, "\n".join(lines).replace("\tmm\t", f"\t{blank}\t"))
    assert values(path)[0, 1, 1] == pytest.approx(1.4)
    says(open_trc(path).log.warnings[0], "not stated", f"read as {unit},")


def test_gaps_at_the_end_of_a_row_may_lack_their_fields(tmp_path: Path) -> None:
    found = values(write(tmp_path, SMALL.replace("\t11\t1401\t-31", "")))
    assert np.isnan(found[1]).all()
    assert not np.isnan(found[2, 1]).any()


def test_several_subjects_give_a_stream_each(tmp_path: Path) -> None:
    text = SMALL.replace("RHip", "ann:RHip").replace("Neck", "box:Corner")
    assert [(stream.name, stream.names) for stream in open_trc(write(tmp_path, text)).streams] == [
        ("ann", ("RHip",)),
        ("box", ("Corner",)),
    ]
    text = SMALL.replace("RHip", "ann:RHip").replace("Neck", "ann:*12")
    recording = open_trc(write(tmp_path, text))
    assert [(stream.name, stream.names) for stream in recording.streams] == [("small", ("RHip",))]
    assert [(topic.name, topic.usable) for topic in recording.topics] == [("small", True), ("unlabelled", False)]


def test_time_is_counted_where_the_column_is_blank(tmp_path: Path) -> None:
    text = SMALL.replace("0.00", "").replace("0.01", "").replace("0.02", "")
    recording = open_trc(write(tmp_path, text))
    (block,) = recording.streams[0].blocks()
    np.testing.assert_allclose(block.time, [0, 0.01, 0.02])
    assert "counted from DataRate 100 Hz" in recording.log.warnings[0]


def test_rows_without_a_time_are_skipped(tmp_path: Path) -> None:
    recording = open_trc(write(tmp_path, SMALL.replace("0.01", "")))
    assert (recording.streams[0].count, recording.log.skipped) == (2, 1)
    assert recording.log.first_skipped == "line 8: no time"


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("\tmm\t", "\tfurlong\t", "line 3, Units: unit 'furlong' is unknown"),
        ("PathFileType", "FilePath", "line 1: 'PathFileType' expected"),
        ("\tX2\tY2\tZ2", "\tX2\tY2", "line 4 names 2 markers and line 5 has 5 coordinates"),
        ("1401", "14x1", "line 8: '14x1' is not a number"),
        ("1401", "inf", "line 8: 'inf' is not a finite number"),
        ("1401", "1401\t5", "line 8 has 9 numbers, expected 8"),
        (SMALL[SMALL.index("1\t0.00") :], "", "no row of numbers"),
        (SMALL[SMALL.index("Frame#") :], "", "the header ends at line 3 of 5"),
        ("RHip\t\t\tNeck", "*1\t\t\t*2", "none of its 2 markers has a label"),
    ],
)
def test_damage_is_told_with_its_line(tmp_path: Path, old: str, new: str, what: str) -> None:
    assert old in SMALL
    with pytest.raises(ReadError) as caught:
        open_trc(write(tmp_path, SMALL.replace(old, new)))
    says(caught, *what.split(" | "))


def test_a_wrong_count_and_a_cut_end_are_noted(tmp_path: Path) -> None:
    recording = open_trc(write(tmp_path, SMALL[:-10]))
    assert recording.streams[0].count == 2
    says(recording.log.ended_abnormally or "", "of 8 numbers")
    says(" ".join(recording.log.warnings), "'3' frames", "file has 2")


def test_sniff_looks_at_the_content() -> None:
    assert sniff(Path("a"), SMALL.encode())
    assert not sniff(Path("a.trc"), b"HIERARCHY\n")


REAL = [
    ("balancing_pose2sim/S00_P00_T01_BalancingTrial_0-100.trc", 100, 21, "RHip"),
    ("balancing_pose2sim/S00_P00_T01_BalancingTrial_0-100_filt_butterworth_LSTM.trc", 100, 64, "Neck"),
    ("irsst_box_lift/markers.trc", 93, 51, "STYLu"),
]


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="the real recordings are not beside the checkout")
@pytest.mark.parametrize(("name", "count", "markers", "marker"), REAL)
def test_real_files(name: str, count: int, markers: int, marker: str) -> None:
    (stream,) = open_trc(RECORDINGS / name).streams
    assert (stream.count, len(stream.names)) == (count, markers)
    (block,) = stream.blocks(names=[marker])
    assert block.values.shape == (count, 1, 3)
    assert np.nanmax(np.abs(block.values)) < 2.0


def test_decimal_commas_are_read(tmp_path: Path) -> None:
    head, _, rows = SMALL.partition("\n\n")
    text = head + "\n\n" + rows.replace(".", ",").replace("\t1400\t", "\t1400,0\t")
    np.testing.assert_array_equal(values(write(tmp_path, text)), values(write(tmp_path, SMALL)))
