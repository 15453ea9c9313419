"""Broken and hostile MCAP recordings: right data, or one clear error."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

from reba.errors import ReadError
from reba.readers.mcap import open_mcap, sniff
from reba.readers.recording.stream import ReadLog
from tests.support import hostile_mcap as hostile
from tests.support import mcap_builder as make
from tests.support.hostile_mcap import CASES
from tests.support.says import says

SLOW_BOMB = "bomb_that_declares_half"


def read(path: Path, **options: object) -> tuple[np.ndarray, np.ndarray, ReadLog, ReadLog]:
    """Return time, values, and the logs of reading and of opening."""
    recording = open_mcap(path, **options)
    log = ReadLog()
    blocks = [block for stream in recording.streams for block in stream.blocks(log)]
    if not blocks:
        return np.zeros(0), np.zeros((0, len(make.NAMES))), log, recording.log
    assert all(block.names == make.NAMES for block in blocks)
    time = np.concatenate([block.time for block in blocks])
    values = np.concatenate([block.values for block in blocks])
    order = np.argsort(time, kind="stable")
    return time[order], values[order], log, recording.log


@pytest.mark.parametrize("name", [name for name in CASES if name != SLOW_BOMB])
def test_case(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    path = hostile.write(name, tmp_path)
    if case.error:
        with pytest.raises(ReadError) as caught:
            read(path, limit_bytes=case.limit)
        says(caught, path, case.error)
        return
    time, values, log, opened = read(path, limit_bytes=case.limit)
    rows = np.setdiff1d(np.arange(case.rows), case.without)
    np.testing.assert_array_equal(values, case.values()[rows])
    np.testing.assert_allclose(time, rows * 0.01, atol=1e-9)
    assert log.skipped == case.skipped
    assert case.reason in (log.first_skipped or "")
    assert case.ended in (opened.ended_abnormally or "")
    assert log.ended_abnormally == opened.ended_abnormally or not case.rows
    assert bool(opened.ended_abnormally) == bool(case.ended)
    assert case.warning in "; ".join(log.warnings)


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.ended])
def test_strict_refuses_an_abnormal_end(name: str, tmp_path: Path) -> None:
    with pytest.raises(ReadError) as caught:
        open_mcap(hostile.write(name, tmp_path), strict=True)
    says(caught, CASES[name].ended, "messages read", "without strict")


@pytest.mark.parametrize("name", ["no_schema", "missing_schema"])
def test_channel_without_schema_is_listed_with_the_reason(name: str, tmp_path: Path) -> None:
    (topic,) = open_mcap(hostile.write(name, tmp_path)).topics
    assert (topic.name, topic.count, topic.usable) == ("/joint_states", 2000, False)
    assert "schema" in topic.why


def test_first_skipped_message_is_located(tmp_path: Path) -> None:
    *_, log, _ = read(hostile.write("half_a_message", tmp_path))
    assert log.first_skipped is not None
    assert log.first_skipped.startswith("message at byte 6293 of the chunk at byte ")
    assert log.messages == 2000


def test_wrong_crc_is_read_on_demand(tmp_path: Path) -> None:
    _, values, *_ = read(hostile.write("wrong_crc", tmp_path), check_crc=False)
    np.testing.assert_array_equal(values, make.positions())


@pytest.mark.parametrize("name", ["bomb", "bomb_that_declares_little", SLOW_BOMB])
@pytest.mark.skipif(sys.platform != "linux", reason="address space is limited by setrlimit")
def test_bomb_stays_within_memory(name: str, tmp_path: Path) -> None:
    path = hostile.write(name, tmp_path)
    code = f"""
        import resource
        from pathlib import Path
        from reba.errors import ReadError
        from reba.readers.mcap import open_mcap
        import numpy, zstandard
        resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))
        try:
            for stream in open_mcap(Path({str(path)!r})).streams:
                list(stream.blocks())
        except ReadError as error:
            print("refused:", error)
        """
    run = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    assert run.stdout.startswith("refused:"), run.stderr


def test_every_truncated_file_is_read_up_to_its_end(tmp_path: Path) -> None:
    data = make.build(make.whole(make.payloads()[:40]))
    path = tmp_path / "cut.mcap"
    for size in range(9, len(data), 97):
        path.write_bytes(data[:size])
        recording = open_mcap(path)
        assert recording.log.ended_abnormally
        rows = [block.values for stream in recording.streams for block in stream.blocks()]
        for block in rows:
            np.testing.assert_array_equal(block, make.positions()[:40])


def test_any_damaged_byte_gives_right_data_or_a_read_error(tmp_path: Path) -> None:
    data = make.build(make.whole(make.payloads()[:20]))
    path = tmp_path / "flip.mcap"
    rng = np.random.default_rng(5)
    for _ in range(400):
        changed = bytearray(data)
        for at in rng.integers(0, len(data), rng.integers(1, 4)):
            changed[at] = rng.integers(256)
        path.write_bytes(changed)
        try:
            streams = open_mcap(path).streams
            blocks = [block for stream in streams for block in stream.blocks()]
        except ReadError:
            continue
        for block in blocks:
            np.testing.assert_array_equal(block.values, make.positions()[:20])


def test_any_damaged_message_is_decoded_or_counted(tmp_path: Path) -> None:
    """Without a CRC the damage reaches the decoder; it must neither fail nor lose count."""
    rng = np.random.default_rng(6)
    messages = []
    for payload in make.payloads()[:400]:
        changed = bytearray(payload)
        changed[rng.integers(len(changed))] = rng.integers(256)
        messages.append(bytes(changed))
    path = tmp_path / "damaged.mcap"
    path.write_bytes(make.build(make.whole(messages)))
    recording = open_mcap(path)
    log = ReadLog()
    for stream in recording.streams:
        for block in stream.blocks(log):
            assert len(block.time) == len(block.values)
    assert log.messages == 400
    assert log.skipped < 400


def test_sniff(tmp_path: Path) -> None:
    assert sniff(hostile.write("sound", tmp_path))
    assert sniff(hostile.write("packed_file", tmp_path))
    assert sniff(tmp_path)
    assert not sniff(hostile.write("not_mcap", tmp_path))
    assert not sniff(tmp_path / "absent.mcap")


def test_absent_file(tmp_path: Path) -> None:
    with pytest.raises(ReadError) as caught:
        open_mcap(tmp_path / "absent.mcap")
    says(caught, "absent.mcap", "cannot be opened", "check the path")
