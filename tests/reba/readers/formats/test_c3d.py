"""The C3D reader: storage variants, gaps, subjects, damage, and the real trials against ezc3d."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reba.errors import ReadError
from reba.readers.formats.c3d import open_c3d, sniff
from reba.readers.recording.stream import Recording
from tests.support.c3d_bytes import DEC, INTEL, MIPS, c3d_bytes
from tests.support.paths import RECORDINGS
from tests.support.says import says

POINTS = np.arange(24.0).reshape(4, 2, 3) * 50.0 - 300.0


def opened(folder: Path, data: bytes) -> Recording:
    path = folder / "small.c3d"
    path.write_bytes(data)
    return open_c3d(path)


def values(recording: Recording, stream: int = 0) -> np.ndarray:
    return np.concatenate([block.values for block in recording.streams[stream].blocks()])


@pytest.mark.parametrize("processor", [INTEL, DEC, MIPS])
@pytest.mark.parametrize("scale", [-1.0, 0.5])
@pytest.mark.parametrize("analogs", [0, 3])
def test_every_way_of_storing_gives_the_same_metres(tmp_path: Path, processor: int, scale: float, analogs: int) -> None:
    data = c3d_bytes(["HEAD", "HAND"], POINTS, processor=processor, scale=scale, analogs=analogs)
    recording = opened(tmp_path, data)
    (stream,) = recording.streams
    assert (stream.name, stream.kind, stream.names, stream.count) == ("small", "points", ("HEAD", "HAND"), 4)
    np.testing.assert_allclose(values(recording), POINTS / 1000, atol=1e-9)
    assert recording.log.warnings == []
    assert [topic.name for topic in recording.topics] == ["small"] + ["analog"] * (analogs > 0)


def test_time_starts_at_the_first_frame(tmp_path: Path) -> None:
    recording = opened(tmp_path, c3d_bytes(["A", "B"], POINTS, first=701, rate=200.0))
    np.testing.assert_allclose(next(recording.streams[0].blocks()).time, [3.5, 3.505, 3.51, 3.515])


@pytest.mark.parametrize(
    ("unit", "metre"),
    [
        ("mm", 0.001), ("cm", 0.01), ("m", 1.0), ("METERS", 1.0), ("mete", 1.0), ("mill", 0.001), ("cent", 0.01),
        ("mm  ", 0.001), ("mm\0\0", 0.001), ("Metre", 1.0), ("millimet", 0.001), ("(mm)", 0.001), ("inch", 0.0254),
        ("feet", 0.3048),
    ],
)  # fmt: skip
def test_units(tmp_path: Path, unit: str, metre: float) -> None:
    recording = opened(tmp_path, c3d_bytes(["A", "B"], POINTS, unit=unit))
    np.testing.assert_allclose(values(recording), POINTS * metre, rtol=1e-6)
    assert recording.log.warnings == []


@pytest.mark.parametrize("unit", ["furlong", "k", "mi", "xy"])
def test_unknown_units_are_refused(tmp_path: Path, unit: str) -> None:
    with pytest.raises(ReadError) as caught:
        opened(tmp_path, c3d_bytes(["A", "B"], POINTS, unit=unit))
    says(caught, "POINT:UNITS", repr(unit), "write mm, cm or m there")


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "m"), (100.0, "cm"), (1000.0, "mm")])
@pytest.mark.parametrize("blank", ["", "  ", "\0\0\0\0"])
def test_without_a_unit_the_size_of_the_body_decides(tmp_path: Path, factor: float, unit: str, blank: str) -> None:
    person = np.array([[[4.0, 2.0, 0.1], [4.1, 2.0, 1.7]]] * 3)
    person[1, 0] = np.nan
    recording = opened(tmp_path, c3d_bytes(["FOOT", "HEAD"], person * factor, unit=blank))
    np.testing.assert_allclose(values(recording), person, rtol=1e-6)
    says(recording.log.warnings[0], "not stated", f"read as {unit},")


def test_without_a_unit_and_a_body_millimetres_are_assumed(tmp_path: Path) -> None:
    recording = opened(tmp_path, c3d_bytes(["A", "B"], np.ones((2, 2, 3)), unit=""))
    np.testing.assert_allclose(values(recording), 0.001, rtol=1e-6)
    says(recording.log.warnings[0], "mm was assumed")


def test_gaps_are_nan(tmp_path: Path) -> None:
    points = POINTS.copy()
    points[1, 0] = np.nan
    recording = opened(tmp_path, c3d_bytes(["A", "B"], points))
    np.testing.assert_array_equal(np.isnan(values(recording)), np.isnan(points))


def test_subjects_outputs_and_unlabelled_points(tmp_path: Path) -> None:
    labels = ["box:a", "ann:HEAD", "ann:LKneeAngles", "*3", "ann:LKNE"]
    data = c3d_bytes(labels, np.ones((2, 5, 3)), texts={"ANGLES": ["LKneeAngles"], "Y_SCREEN": ["+Z"]})
    recording = opened(tmp_path, data)
    assert [(stream.name, stream.names, stream.up) for stream in recording.streams] == [
        ("box", ("a",), "z"),
        ("ann", ("HEAD", "LKNE"), "z"),
    ]
    assert [topic.name for topic in recording.topics if not topic.usable] == ["unlabelled", "angles"]


def test_labels_go_on_in_a_second_parameter(tmp_path: Path) -> None:
    data = c3d_bytes(["A"], POINTS, texts={"LABELS2": ["B"]})
    assert opened(tmp_path, data).streams[0].names == ("A", "B")


def test_more_frames_than_the_header_counts(tmp_path: Path) -> None:
    points = np.zeros((70_000, 1, 3))
    points[:, 0, 0] = np.arange(70_000) % 1000
    data = bytearray(c3d_bytes(["A"], points[:65535]))
    data += struct.pack("<4f", 1, 2, 3, 0) * 4465
    used = data.index(b"USED")
    long_count = struct.pack("bb", 6, 1) + b"FRAMES" + struct.pack("<HbBf", 9, 4, 0, 70_000.0) + b"\0"
    data[used - 2 : used - 2] = long_count
    del data[1024 - 40 : 1024 - 40 + len(long_count)]
    recording = opened(tmp_path, bytes(data))
    assert recording.streams[0].count == 70_000
    assert [len(block.time) for block in recording.streams[0].blocks()] == [20_000, 20_000, 20_000, 10_000]


def test_frames_that_no_count_has_room_for_are_read(tmp_path: Path) -> None:
    points = np.zeros((65535, 1, 3))
    data = c3d_bytes(["A"], points) + struct.pack("<4f", 1, 2, 3, 0) * 4465
    recording = opened(tmp_path, data)
    assert recording.streams[0].count == 70_000
    says(recording.log.warnings[0], 65535, "70000", "read")


def test_frames_behind_those_that_are_stated_are_told(tmp_path: Path) -> None:
    recording = opened(tmp_path, c3d_bytes(["A", "B"], POINTS) + bytes(20 * 32))
    assert recording.streams[0].count == len(POINTS)
    says(recording.log.warnings[0], f"{len(POINTS)} frames", "more")


def test_a_cut_file_gives_its_whole_frames(tmp_path: Path) -> None:
    data = c3d_bytes(["A", "B"], POINTS)
    recording = opened(tmp_path, data[:-40])
    assert recording.streams[0].count == 2
    says(recording.log.ended_abnormally or "", f"byte {len(data) - 40}", "2 of 4 frames")


def test_far_away_positions_are_gaps(tmp_path: Path) -> None:
    points = POINTS.copy()
    points[0, 0] = 1e30
    recording = opened(tmp_path, c3d_bytes(["A", "B"], points))
    assert np.isnan(values(recording)[0, 0]).all()
    says(recording.log.warnings[0], "1 positions", "1000 m", "gaps")


def patched(at: int, raw: bytes) -> bytes:
    data = bytearray(c3d_bytes(["A", "B"], POINTS))
    data[at : at + len(raw)] = raw
    return bytes(data)


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (b"", "the file is empty"),
        (b"garbage" * 300, "at byte 0 | C3D header | give a .c3d file"),
        (patched(0, b"\xff"), "parameters in block 255"),
        (patched(2, b"\xff\xff"), "at byte 2: the header states 65535 points and POINT:USED 2"),
        (patched(8, b"\x00\x00"), "the header states no frame"),
        (patched(12, b"\x00\x00\x00\x00"), "the scale of points is 0.0"),
        (patched(16, b"\xff\xff"), "frames at byte 33553408 of 1152"),
        (patched(515, b"\x07"), "at byte 515: processor type 7, expected 84, 85 or 86"),
        (patched(523, b"\xff\xff"), "parameters | end of the file"),
        (c3d_bytes(["A", "B"], POINTS)[:1030], "at byte 1024 | no complete frame"),
        (c3d_bytes(["A", "B"], POINTS, rate=-5.0), "the frame rate is -5 Hz"),
        (c3d_bytes(["A", "B"], POINTS, unit="ell"), "POINT:UNITS: unit 'ell' is unknown"),
        (c3d_bytes(["*1", "*2"], POINTS), "none of its 2 markers has a label"),
        (c3d_bytes([], np.zeros((3, 0, 3)), analogs=4), "no points"),
    ],
)
def test_damage_is_told(tmp_path: Path, data: bytes, what: str) -> None:
    with pytest.raises(ReadError) as caught:
        opened(tmp_path, data)
    says(caught, *what.split(" | "))


def test_sniff_looks_at_the_content() -> None:
    assert sniff(Path("a"), c3d_bytes(["A", "B"], POINTS)[:64])
    assert not sniff(Path("a.c3d"), b"time,x\n")
    assert not sniff(Path("a.c3d"), b"")


REAL = [
    ("irsst_box_lift/markers_analogs.c3d", {"boite": 8, "Daphnee": 43}, 0.001),
    ("walking_qualisys/Qualisys.c3d", {"Qualisys": 55}, 0.001),
    ("bench_static_c3d/sample_static.c3d", {"sample_static": 41}, 1.0),
]


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="the real recordings are not beside the checkout")
@pytest.mark.parametrize(("name", "streams", "metre"), REAL)
def test_real_files_agree_with_ezc3d(name: str, streams: dict[str, int], metre: float) -> None:
    ezc3d: Any = pytest.importorskip("ezc3d")
    recording = open_c3d(RECORDINGS / name)
    assert {stream.name: len(stream.names) for stream in recording.streams} == streams
    reference = ezc3d.c3d(str(RECORDINGS / name))
    points = reference["data"]["points"][:3].transpose(2, 1, 0) * metre
    labels = [label.rpartition(":")[2] for label in reference["parameters"]["POINT"]["LABELS"]["value"]]
    for stream in recording.streams:
        found = np.concatenate([block.values for block in stream.blocks()])
        expected = points[:, [labels.index(marker) for marker in stream.names]]
        np.testing.assert_allclose(found, expected, atol=1e-12)
