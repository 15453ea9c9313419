"""Recordings packed with gzip, and texts in other encodings: read as if they were not."""

from __future__ import annotations

import gzip
import shutil
from pathlib import Path

import numpy as np
import pytest

import reba
from reba.readers.formats import is_recording, open_recording
from reba.readers.formats.file_content import ANY_BYTES
from tests.reba.readers.formats.test_formats import MARKERS, SEEDS
from tests.support.motive_csv import motive_csv
from tests.support.paths import DATASETS
from tests.support.says import says

TEXTS = ("bvh", "mot", "trc", "mvnx", "csv", "vicon", "c3d")


@pytest.mark.parametrize("name", TEXTS)
def test_a_packed_recording_is_the_unpacked_one(tmp_path: Path, name: str) -> None:
    ending = {"vicon": "csv"}.get(name, name)
    packed = tmp_path / f"one.{ending}.gz"
    packed.write_bytes(gzip.compress(SEEDS[name][1]))
    assert is_recording(packed)
    is_read_as(packed, tmp_path / f"one.{ending}", SEEDS[name][1])


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
@pytest.mark.parametrize("name", [*TEXTS[:-1], "motive"])
def test_a_text_in_the_encoding_of_a_spreadsheet_is_the_same(tmp_path: Path, name: str, encoding: str) -> None:
    text = SEEDS[name][1].decode() if name in SEEDS else motive_csv(points={"P": MARKERS[:, 0], "Q": MARKERS[:, 1]})
    other = tmp_path / "one.txt"  # of an ending that says nothing
    other.write_bytes(text.replace('encoding="UTF-8"', f'encoding="{encoding[:6]}"').encode(encoding))
    is_read_as(other, tmp_path / f"one.{'csv' if name in ('vicon', 'motive') else name}", text.encode())


def is_read_as(other: Path, plain: Path, data: bytes) -> None:
    """Assert that a file is read as a `plain` one of some data is."""
    plain.write_bytes(data)
    assert is_recording(plain)
    for ours, theirs in zip(open_recording(other).streams, open_recording(plain).streams, strict=True):
        assert (ours.name, ours.kind, ours.names) == (theirs.name, theirs.kind, theirs.names)
        for block, other_block in zip(ours.blocks(), theirs.blocks(), strict=True):
            np.testing.assert_array_equal(block.time, other_block.time)
            np.testing.assert_array_equal(block.values, other_block.values)


def test_members_one_after_the_other_and_padding(tmp_path: Path) -> None:
    data = (DATASETS / "simulated_assembly.csv").read_bytes()
    path = tmp_path / "shift.csv.gz"
    path.write_bytes(gzip.compress(data[:5000]) + gzip.compress(data[5000:]) + b"\0" * 512)
    table = reba.read(path)
    np.testing.assert_array_equal(
        table.data["trunk_flexion"], reba.read(DATASETS / "simulated_assembly.csv").data["trunk_flexion"]
    )
    assert not any("gzip" in text for text in table.quality.warnings)
    path.write_bytes(path.read_bytes() + b"more")
    assert any("after the end of the gzip data" in text for text in reba.read(path).quality.warnings)


def test_a_truncated_one_is_read_up_to_its_end_and_refused_by_strict(tmp_path: Path) -> None:
    data = gzip.compress((DATASETS / "simulated_assembly.csv").read_bytes())
    path = tmp_path / "shift.csv.gz"
    path.write_bytes(data[: len(data) // 2])
    table = reba.read(path)
    assert table.quality.ended_abnormally is not None
    assert 10 < len(table.data) < len(reba.read(DATASETS / "simulated_assembly.csv").data)
    with pytest.raises(reba.ReadError) as caught:
        reba.read(path, strict=True)
    says(caught, str(path), "without strict")


def test_damaged_data_is_refused(tmp_path: Path) -> None:
    data = bytearray(gzip.compress((DATASETS / "simulated_assembly.csv").read_bytes()))
    data[-6] ^= 1
    path = tmp_path / "shift.csv.gz"
    path.write_bytes(data)
    with pytest.raises(reba.ReadError) as caught:
        reba.read(path)
    says(caught, "damaged gzip data", "pack it again")


@pytest.mark.parametrize("ending", ["csv", "trc", "bvh", "mvnx", "sto", "c3d"])
def test_a_bomb_is_refused_before_it_fills_the_memory(tmp_path: Path, ending: str) -> None:
    head = {"bvh": b"HIERARCHY\n", "mvnx": b"<mvnx>", "sto": b"x\nendheader\n", "trc": b"PathFileType\t4\n"}
    path = tmp_path / f"bomb.{ending}.gz"
    path.write_bytes(
        gzip.compress(head.get(ending, b"time,a\n" if ending == "csv" else b"\x02P") + bytes(2 * ANY_BYTES))
    )
    assert path.stat().st_size < 100_000
    with pytest.raises(reba.ReadError) as caught:
        reba.read(path)
    says(caught, f"unpacks to more than {ANY_BYTES} bytes", "give it unpacked")


def test_what_is_packed_itself_is_not_packed_again(tmp_path: Path) -> None:
    for name in ("simulated_palletising.mcap",):
        path = tmp_path / f"{name}.gz"
        with (DATASETS / name).open("rb") as source, gzip.open(path, "wb") as packed:
            shutil.copyfileobj(source, packed)
        with pytest.raises(reba.ReadError) as caught:
            reba.read(path)
        says(caught, "packed itself or read in parts", "gunzip")
    for head in (b"#ROSBAG V2.0\n", b"SQLite format 3\0", b"\x28\xb5\x2f\xfd"):
        (tmp_path / "shift.bag.gz").write_bytes(gzip.compress(head + bytes(200)))
        with pytest.raises(reba.ReadError) as caught:
            reba.read(tmp_path / "shift.bag.gz")
        says(caught, "packed itself or read in parts", "gunzip")


@pytest.mark.parametrize(
    ("name", "head", "what", "hint"),
    [
        ("walk.fbx", b"Kaydara FBX Binary  \0\x1a\0", "FBX", "BVH"),
        ("walk.fbx", b"; FBX 7.7.0 project file\n", "FBX", "BVH"),
        ("shift.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "old Excel", ".xlsx"),
        ("walk.pkl", b"\x80\x04\x95", "pickle", "numpy.savez"),
        ("walk.npy", b"\x93NUMPY\x01\0", "one array", "numpy.savez"),
        ("walk.mat", b"MATLAB 5.0 MAT-file", "MATLAB", "CSV"),
    ],
)
def test_what_is_not_read_says_what_to_do(tmp_path: Path, name: str, head: bytes, what: str, hint: str) -> None:
    path = tmp_path / name
    path.write_bytes(head + bytes(100))
    with pytest.raises(reba.ReadError) as caught:
        reba.read(path)
    says(caught, what, hint)
