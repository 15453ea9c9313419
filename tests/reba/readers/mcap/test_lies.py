"""MCAP files that state more than they have, or unpack to more than they can hold: told or refused, in time."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard

import reba
from reba.errors import ReadError
from reba.readers.mcap import open_mcap
from reba.readers.mcap.layout import Undecodable
from reba.readers.mcap.ros import BadSchema, parse, walk
from tests.support import mcap_builder as make
from tests.support.says import says

ROWS = 40
SECONDS = 10.0
"""[s] Longest time of any of these files on a busy machine; without bounds they take minutes to years."""


def _rows() -> list[tuple[int, int, bytes]]:
    return [(1, make.EPOCH_NS + at * make.STEP_NS, make.payloads()[at]) for at in range(ROWS)]


def _plan(**changes: object) -> make.Plan:
    rows = _rows()
    return make.replace(make.Plan(tuple(tuple(rows[at : at + 10]) for at in range(0, ROWS, 10))), **changes)


def _opcodes(data: bytes) -> list[int]:
    """Return the places of the opcodes of all top-level records."""
    at, places = len(make.MAGIC), []
    while at < len(data) - len(make.MAGIC):
        places.append(at)
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    return places


def _read(path: Path, *, strict: bool) -> tuple[np.ndarray, list[str]]:
    """Return the positions, and what is told beside them."""
    recording = open_mcap(path, strict=strict)
    told = [topic.why for topic in recording.topics if not topic.usable]
    values = [block.values for stream in recording.streams for block in stream.blocks()]
    log = recording.log
    told += [text for text in (log.lost, log.ended_abnormally, *log.warnings) if text]
    return np.concatenate(values) if values else np.empty((0, len(make.NAMES))), told


@pytest.mark.slow
@pytest.mark.parametrize("chunked", [True, False])
def test_a_flipped_bit_of_an_opcode_never_loses_messages_silently(tmp_path: Path, chunked: bool) -> None:
    data = make.build(_plan(chunked=chunked))
    path = tmp_path / "flip.mcap"
    losses = 0
    for place in _opcodes(data):
        for bit in range(8):
            changed = bytearray(data)
            changed[place] ^= 1 << bit
            path.write_bytes(changed)
            try:
                values, told = _read(path, strict=False)
            except ReadError:
                continue
            if len(values) < ROWS:
                losses += 1
                assert told, (place, data[place], bit)
                with pytest.raises(ReadError):
                    reba.read(path, profile=_profile(tmp_path), strict=True)
            else:
                np.testing.assert_array_equal(values, make.positions()[:ROWS])
    assert losses


def _profile(folder: Path) -> Path:
    path = folder / "p.toml"
    path.write_text(
        'name = "p"\ntitle = "t"\nsource = "s"\nkind = "joints"\nunit = "rad"\n[columns]\ntrunk_flexion = "trunk"\n'
    )
    return path


def test_flipped_opcodes_inside_a_stored_chunk_are_told(tmp_path: Path) -> None:
    def alter(number: int, data: bytes) -> bytes:
        changed = bytearray(data)
        if number == 2:
            changed[_inner(data)[3]] ^= 1 << 6
        return bytes(changed)

    path = tmp_path / "inner.mcap"
    path.write_bytes(make.build(_plan(records=alter, crc_of_records=True)))
    values, told = _read(path, strict=False)
    assert len(values) == ROWS - 1
    says("; ".join(told), "1 of the 40 messages of /joint_states", "missing")


def _inner(data: bytes) -> list[int]:
    at, places = 0, []
    while at < len(data):
        places.append(at)
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    return places


def test_info_score_and_strict_tell_a_lost_chunk(tmp_path: Path) -> None:
    def change(number: int, data: bytes) -> bytes:
        return bytes([data[0] ^ 0x40]) + data[1:] if number == 1 else data

    path = tmp_path / "lost.mcap"
    path.write_bytes(make.build(_plan(change=change)))
    profile = _profile(tmp_path)
    for warnings in (reba.info(path, profile=profile).warnings, reba.read(path, profile=profile).quality.warnings):
        says("; ".join(warnings), "1 of the 4 chunks", "10 of the 40 messages of /joint_states", "type 0x46")
    with pytest.raises(ReadError) as caught:
        reba.read(path, profile=profile, strict=True)
    says(caught, path, "missing", "copy the recording again")


def _chunk(inside: bytes, compression: str = "zstd") -> bytes:
    pack = {"zstd": zstandard.ZstdCompressor(19).compress, "lz4": lz4.frame.compress, "": bytes}[compression]
    packed = pack(inside)
    head = struct.pack("<QQQI", 1, 1, len(inside), 0) + make.text(compression)
    return make.record(make.CHUNK, head + struct.pack("<Q", len(packed)) + packed)


def _file(*records: bytes) -> bytes:
    return make.MAGIC + make.record(1, make.text("") * 2) + b"".join(records) + make.record(2, bytes(20)) + make.MAGIC


EMPTY = make.record(0x50, b"")
PLAN = make.Plan(())
DEFINED = b"".join(PLAN.definitions)
UNEVEN = make.message(1, 1, b"") + make.message(1, 1, b"\0")
BOMBS: dict[str, Callable[[], bytes]] = {
    "empty_records": lambda: _file(_chunk(EMPTY * 10_000_000)),
    "empty_records_lz4": lambda: _file(_chunk(EMPTY * 4_000_000, "lz4")),
    "channels_again": lambda: _file(_chunk(DEFINED + PLAN.definitions[1] * 2_000_000)),
    "messages_of_two_lengths": lambda: _file(_chunk(DEFINED + UNEVEN * 2_000_000)),
    "messages_of_one_length": lambda: _file(_chunk(DEFINED + make.message(1, 1, b"") * 4_000_000)),
    "many_chunks": lambda: _file(*[_chunk(EMPTY * 3_000_000)] * 40),
    "much_in_all": lambda: _file(*[_chunk(bytes(9) * 100_000_000)] * 3),
    "packed_file": lambda: zstandard.ZstdCompressor().compress(_file(EMPTY * 20_000_000)),
    "packed_file_of_chunks": lambda: zstandard.ZstdCompressor().compress(_file(_chunk(EMPTY * 9_000, "") * 1000)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BOMBS)
def test_work_is_bounded_by_what_a_file_of_that_size_can_hold(tmp_path: Path, name: str) -> None:
    path = tmp_path / ("bomb.mcap.zstd" if name.startswith("packed") else "bomb.mcap")
    path.write_bytes(BOMBS[name]())
    began = time.perf_counter()
    with pytest.raises(ReadError) as caught:
        _read(path, strict=False)
    assert time.perf_counter() - began < SECONDS
    says(caught, path, "more than", "file of this size")


def test_many_small_chunks_and_definitions_are_read(tmp_path: Path) -> None:
    """Each chunk holds one message, and many topics and schemas are defined that have none."""
    rows = _rows()
    others = [make.schema(2 + at, "a/B", "ros2msg", b"int8 x") for at in range(2000)]
    others += [make.channel(2 + at, 2 + at, f"/t{at}", "cdr") for at in range(2000)]
    plan = make.Plan(tuple((row,) for row in rows), definitions=(*make.Plan(()).definitions, *others))
    path = tmp_path / "small.mcap"
    path.write_bytes(make.build(plan))
    values, told = _read(path, strict=True)
    np.testing.assert_array_equal(values, make.positions()[:ROWS])
    assert not [text for text in told if "missing" in text]


NESTED = "{0}[1000] a\n{0}[1000] b\n"


def test_types_without_bytes_cannot_repeat_without_end() -> None:
    levels = "".join(f"===\nMSG: a/T{at}\n{NESTED.format(f'T{at + 1}')}" for at in range(20))
    text = f"{NESTED.format('T0')}{levels}===\nMSG: a/T20\nuint8[0] none\n"
    for ros1 in (True, False):
        with pytest.raises(Undecodable, match="elements"):
            walk(parse(text, "a/R", ros1=ros1), bytes([0, 1, 0, 0, *[0] * 5000]), (), ros1=ros1)


def test_a_type_that_many_contain_is_parsed_once() -> None:
    levels = "".join(f"===\nMSG: a/T{at}\n" + f"T{at + 1} a\nT{at + 1} b\n" * 5 for at in range(30))
    root = parse(f"T0 a\nT0 b\n{levels}===\nMSG: a/T30\nint8 x\n", "a/R")
    with pytest.raises(Undecodable):
        walk(root, bytes([0, 1, 0, 0, *[0] * 64]), (), ros1=False)
    with pytest.raises(BadSchema, match="elements"):
        parse(f"int8[{'9' * 5000}] x", "a/R")


def test_false_counts_of_empty_types_are_undecodable() -> None:
    root = parse("Empty[] many\n===\nMSG: std_msgs/Empty\n", "a/R", ros1=True)
    with pytest.raises(Undecodable, match="4000000000 elements"):
        walk(root, struct.pack("<I", 4_000_000_000), (), ros1=True)
