"""Recordings of messages: MCAP, ROS 1 bags and rosbag2 databases; ROS, Foxglove and our own, decoded by columns.

    bytes -> container, rosbag or database (chunks, checked) -> channels -> decode (message layouts)
    -> extract -> merge -> blocks

Summary, indexes and declared lengths are checked before use: see `container`. Format: https://mcap.dev/spec.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from reba.errors import ReadError
from reba.open_file import open_regular
from reba.readers.mcap.bytes import MAGIC, ZSTD_MAGIC
from reba.readers.mcap.channels import DecodableChannel, Unused, classify, recording_files
from reba.readers.mcap.container import OWN, Container
from reba.readers.mcap.contents import Contents
from reba.readers.mcap.database import SQLITE_MAGIC, Database
from reba.readers.mcap.gather import recording_of
from reba.readers.mcap.rosbag import BAG_MAGIC, Bag
from reba.readers.mcap.store import Store, StoredFile
from reba.readers.mcap.trace import JITTER
from reba.readers.recording.stream import LOST_HINT, ReadLog, Recording
from reba.recording_folder import is_recording_folder, is_split

__all__ = ["MAX_CHUNK", "gathered", "is_mcap", "open_files", "open_mcap", "sniff"]
MAX_CHUNK = 1 << 30
"""[bytes] Largest chunk, record or unpacked file that is accepted: protects memory from declared lengths."""


def sniff(path: Path) -> bool:
    """Return whether a path is a recording of messages: by its first bytes, a folder by the names of its files."""
    if path.is_dir():
        return any(is_split(file.name) for file in path.iterdir())
    return is_mcap(path) or _is_database(path) or _head(path).startswith(BAG_MAGIC)


def is_mcap(path: Path) -> bool:
    """Return whether a file, or a folder by the names in it, is MCAP, packed or not."""
    if path.is_dir():
        return any(file.name.endswith((".mcap", ".mcap.zstd")) for file in path.iterdir())
    head = _head(path)
    return head.startswith(MAGIC) or (head.startswith(ZSTD_MAGIC) and ".mcap" in path.name)


def _head(path: Path) -> bytes:
    try:
        with open_regular(path) as file:
            return file.read(len(SQLITE_MAGIC))
    except OSError:
        return b""


def _is_database(path: Path) -> bool:
    head = _head(path)
    return head.startswith(SQLITE_MAGIC) or (head.startswith(ZSTD_MAGIC) and ".db3" in path.name)


def open_file(path: Path, *, check_crc: bool = True, limit_bytes: int = MAX_CHUNK) -> StoredFile:
    """Open one file of a recording, of the format that its first bytes show.

    Raises:
        ReadError: it is none of them, or damaged.
    """
    if _is_database(path):
        return Database(path, limit_bytes=limit_bytes)
    kind = Bag if _head(path).startswith(BAG_MAGIC) else Container
    return kind(path, check_crc=check_crc, limit_bytes=limit_bytes)


def open_mcap(
    path: Path | Sequence[Path], *, strict: bool = False, check_crc: bool = True, limit_bytes: int = MAX_CHUNK
) -> Recording:
    """Open a recording, or a folder with the splits of one; its log notes a truncated end.

    Without joint states, transforms or posture angles it has no streams; `topics` has the reason for each topic.

    Args:
        path: an .mcap or .db3 file, plain or zstd-compressed as a whole, a .bag, a folder with splits of one format, or
            a list of files, which must follow each other in time.
        strict: refuse a truncated recording, and a folder with a damaged split.
        check_crc: compare the CRC of every chunk that has one.
        limit_bytes: the largest chunk, record or unpacked file that is accepted.

    Raises:
        ReadError: not such a recording, or damaged so that samples would be wrong or missing.
    """
    log = ReadLog()
    channels: list[DecodableChannel | Unused] = []
    given = [] if isinstance(path, Path) else list(path)
    if not isinstance(path, Path):
        path = Path(" + ".join(map(str, given)))
    record: dict[str, str] = {}
    opened = open_files(path, log, given, strict=strict, check_crc=check_crc, limit_bytes=limit_bytes)
    for container, channels_of_file in opened:
        _note(container, log, len(given) > 1 or path.is_dir())
        channels += channels_of_file
        record |= container.records.get(OWN, {}) if isinstance(container, Container) else {}
    if strict and log.ended_abnormally:
        raise ReadError(path, log.ended_abnormally, hint="read it without strict to use the messages before")
    recording = replace(
        gathered(path, channels, log, strict=strict), files=tuple(map(str, given)), scored=record or None
    )
    if strict and log.lost:
        raise ReadError(path, log.lost, hint=LOST_HINT)
    return recording


def gathered(
    path: Path, channels: Iterable[DecodableChannel | Unused], log: ReadLog, *, strict: bool = False
) -> Recording:
    """Return the recording of the channels of one or more files."""
    parts: list[DecodableChannel] = []
    unused: list[Unused] = []
    for channel in channels:
        if isinstance(channel, DecodableChannel):
            parts.append(channel)
            if channel.note:
                log.warn(channel.note)
        else:
            unused.append(channel)
    contents = Contents(parts, strict=strict)
    for text in contents.lost:
        log.lose(text)
    return recording_of(path, parts, unused, contents, log)


def open_files(
    path: Path,
    log: ReadLog,
    given: Sequence[Path] = (),
    *,
    strict: bool = False,
    check_crc: bool = True,
    limit_bytes: int = MAX_CHUNK,
) -> list[tuple[StoredFile, list[DecodableChannel | Unused]]]:
    """Return the files of a recording and their channels by start time; a damaged one of several is noted and left out.

    Args:
        given: files of a recording that was given as a list, which must follow each other in time.

    Raises:
        ReadError: no file can be read, or the recording is one file or `strict` and that is damaged.
    """
    files = list(given) or recording_files(path)
    opened = []
    for file in files:
        try:
            container = open_file(file, check_crc=check_crc, limit_bytes=limit_bytes)
            opened.append((container, _classified(container)))
            container.release()
        except ReadError as error:
            if strict or len(files) == 1:
                raise
            log.warn(f"{error}; this file is left out")
    if not opened:
        raise ReadError(path, f"none of its {len(files)} files can be read; {log.warnings[0]}")
    by_time = sorted(opened, key=lambda pair: pair[0].segments[0].start if pair[0].segments else 0)
    ends = [
        max((one.chunk.end if one.chunk else one.start for one in store.segments), default=0) for store, _ in by_time
    ]
    starts = [store.segments[0].start if store.segments else 0 for store, _ in by_time[1:]]
    # Where log times repeat, a clock restarted, and the names have the order of recording.
    repeats = [start < end - JITTER for start, end in zip(starts, ends, strict=False)]
    if any(repeats) and (given or not is_recording_folder(path)):
        at = repeats.index(True)
        one, other = (by_time[number][0].path for number in (at, at + 1))
        what = "a list holds" if given else "a folder without metadata.yaml or splits x_0, x_1 ... has to hold"
        hint = f"{what} the files of one recording; read several recordings one by one"
        raise ReadError(path, f"{one.name} and {other.name} were recorded at one time", hint=hint)
    return opened if any(repeats) else by_time


def _classified(container: Store) -> list[DecodableChannel | Unused]:
    """Return the content of each channel of a file.

    Raises:
        ReadError: a chunk is damaged.
    """
    return [classify(container, container.channels[number]) for number in sorted(container.channels)]


def _note(container: StoredFile, log: ReadLog, named: bool) -> None:
    """Add the notes of a file to the log of the recording."""
    prefix = f"{container.path.name}: " if named else ""
    if container.ended_abnormally:
        before = f"{log.ended_abnormally}; " if log.ended_abnormally else ""
        log.ended_abnormally = f"{before}{prefix}{container.ended_abnormally}"
    if container.lost:
        log.lose(prefix + container.lost)
    for warning in container.warnings:
        log.warn(prefix + warning)
    for number in container.counts.keys() - container.channels.keys():
        log.warn(f"{prefix}{container.counts[number]} messages name channel {number}, which the file does not define")
