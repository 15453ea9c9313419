"""Every motion-capture reader, given anything: the right data or one `ReadError`, never another failure."""

from __future__ import annotations

import functools
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reba.errors import ReadError
from reba.readers.formats.bvh import open_bvh
from reba.readers.formats.c3d import open_c3d
from reba.readers.formats.mvnx import open_mvnx
from reba.readers.formats.opensim import open_opensim
from reba.readers.formats.table import open_table
from reba.readers.formats.trc import open_trc
from reba.readers.recording.stream import Recording
from tests.reba.readers.formats.test_bvh import SMALL as BVH
from tests.reba.readers.formats.test_opensim import SMALL as MOT
from tests.reba.readers.formats.test_table import SMALL as CSV
from tests.reba.readers.formats.test_trc import SMALL as TRC
from tests.reba.readers.formats.test_vicon import VICON
from tests.support.c3d_bytes import c3d_bytes
from tests.support.mvnx_text import mvnx_text
from tests.support.says import says

Opener = Callable[[Path], Recording]


@functools.cache
def parquet() -> bytes:
    buffer = io.BytesIO()
    pd.read_csv(io.StringIO(CSV)).to_parquet(buffer)
    return buffer.getvalue()


def mvnx() -> bytes:
    turns = np.tile([1.0, 0, 0, 0], (2, 23, 1))
    return mvnx_text(turns, np.ones((2, 23, 3)), np.zeros((2, 22, 3)), np.zeros((2, 6, 3))).encode()


MARKERS = np.arange(36.0).reshape(3, 4, 3) * 20

SEEDS: dict[str, tuple[Opener, bytes]] = {
    "bvh": (open_bvh, BVH.encode()),
    "mot": (open_opensim, MOT.encode()),
    "trc": (open_trc, TRC.encode()),
    "c3d": (open_c3d, c3d_bytes(["A", "B", "s:C", "*1"], MARKERS, texts={"ANGLES": ["B"]}, analogs=2)),
    "c3d integers": (open_c3d, c3d_bytes(["A", "B", "C", "D"], MARKERS, scale=0.1, processor=86)),
    "mvnx": (open_mvnx, mvnx()),
    "csv": (open_table, CSV.encode()),
    "vicon": (open_table, VICON.encode()),
    "parquet": (open_table, parquet()),
}


def read_all(folder: Path, name: str, data: bytes) -> list[int] | None:
    """Return the samples of each stream, None for a `ReadError`; every other failure passes through."""
    path = folder / f"hostile.{name.split()[0]}"
    path.write_bytes(data)
    try:
        recording = SEEDS[name][0](path)
        counts = []
        for stream in recording.streams:
            counts.append(0)
            for block in stream.blocks():
                assert np.isfinite(block.time).all()
                assert not np.isinf(block.values).any()
                assert block.values.shape[:2] == (len(block.time), len(block.names))
                counts[-1] += len(block.time)
            if stream.table is not None:
                assert len(stream.table()) == counts[-1]
            assert counts[-1] == stream.count
        assert recording.streams
        return counts
    except ReadError as error:
        text = str(error)
        assert text.startswith(str(path))
        assert "\n" not in text
        assert "; " in text
        assert len(text) < 1000
        return None


@pytest.mark.parametrize("name", SEEDS)
def test_the_seeds_are_read(tmp_path: Path, name: str) -> None:
    counts = read_all(tmp_path, name, SEEDS[name][1])
    assert counts is not None
    assert min(counts) >= 2


@pytest.mark.parametrize("name", SEEDS)
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_cut_anywhere(tmp_path: Path, name: str, data: st.DataObject) -> None:
    seed = SEEDS[name][1]
    cut = data.draw(st.integers(0, len(seed) - 1))
    counts = read_all(tmp_path, name, seed[:cut])
    whole = read_all(tmp_path, name, seed)
    assert whole is not None
    if counts is not None and name != "vicon":
        assert all(count <= most for count, most in zip(counts, whole, strict=False))


@pytest.mark.parametrize("name", SEEDS)
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_changed_anywhere(tmp_path: Path, name: str, data: st.DataObject) -> None:
    seed = bytearray(SEEDS[name][1])
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(seed) - 1))
        kind = data.draw(st.sampled_from(["put", "insert", "delete", "double"]))
        piece = data.draw(st.binary(min_size=1, max_size=4) | st.sampled_from(PIECES))
        if kind == "put":
            seed[at : at + len(piece)] = piece
        elif kind == "insert":
            seed[at:at] = piece
        elif kind == "delete":
            del seed[at : at + data.draw(st.integers(1, 40))]
        else:
            seed[at:at] = seed[at : at + data.draw(st.integers(1, 200))]
        if not seed:
            break
    read_all(tmp_path, name, bytes(seed))


PIECES = [b"nan", b"-inf", b"1e308", b"1e999", b"99999999999999999999", b"-1", b"\n", b"\r", b"\t", b",", b";", b'"']
PIECES += [b"\x00", b"\xff\xff", b"\x7f\xff", b"{", b"}", b"<", b"&a;", b"\xef\xbb\xbf", b"#", b"_", b"\xc3", b" " * 50]


@pytest.mark.parametrize("name", SEEDS)
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(max_size=3000))
def test_garbage_under_the_right_name(tmp_path: Path, name: str, data: bytes) -> None:
    read_all(tmp_path, name, data)
    seed = SEEDS[name][1]
    read_all(tmp_path, name, seed[: len(seed) // 3] + data)


@pytest.mark.parametrize("name", SEEDS)
@pytest.mark.parametrize(
    "data",
    [b"", b"\n", b"\x00" * 2000, b"\xff" * 2000, b"\xef\xbb\xbf", b"\xff\xfe", b"PAR1PAR1", b"a" * 1_000_000, b"1,2\n"],
)
def test_nothing_useful(tmp_path: Path, name: str, data: bytes) -> None:
    assert read_all(tmp_path, name, data) is None


@pytest.mark.parametrize("name", ["bvh", "mot", "trc", "csv", "vicon"])
@pytest.mark.parametrize("piece", ["1" * 1_000_000, "1 " * 500_000, "1,\t" * 300_000, "x" * 1_000_000])
def test_a_line_of_a_million_characters(tmp_path: Path, name: str, piece: str) -> None:
    lines = SEEDS[name][1].decode().split("\n")
    for at in {1, len(lines) // 2, len(lines) - 2}:
        read_all(tmp_path, name, "\n".join([*lines[:at], piece, *lines[at + 1 :]]).encode())


@pytest.mark.parametrize("name", SEEDS)
def test_what_is_no_file(tmp_path: Path, name: str) -> None:
    for path in (tmp_path, tmp_path / "missing"):
        with pytest.raises(ReadError) as caught:
            SEEDS[name][0](path)
        says(caught, path.name, "existing, readable file")


def test_counts_are_never_believed(tmp_path: Path) -> None:
    huge = "9" * 18
    for name, old in (("bvh", "Frames: 3"), ("mot", "nRows=3"), ("trc", "100\t100\t3\t")):
        text = SEEDS[name][1].decode()
        assert old in text
        counts = read_all(
            tmp_path, name, text.replace(old, old.rstrip("\t")[:-1] + huge + "\t" * old.endswith("\t")).encode()
        )
        assert counts == [3]
    data = bytearray(SEEDS["c3d"][1])
    data[8:10] = b"\xff\xfe"
    assert read_all(tmp_path, "c3d", bytes(data)) == [3, 3]
