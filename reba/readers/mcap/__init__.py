"""MCAP recordings: ROS 2, ROS 1, Foxglove and our own, decoded column by column.

    bytes -> container (chunks, checked) -> channels -> decode (message layouts) -> extract -> merge -> blocks

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
from reba.readers.mcap.clock import JITTER
from reba.readers.mcap.container import OWN, Container, Store
from reba.readers.mcap.contents import Contents
from reba.readers.mcap.streams import StreamReader, stream_header
from reba.readers.recording.stream import LOST_HINT, ReadLog, Recording, Stream, Topic

__all__ = ["MAX_CHUNK", "classified", "gathered", "open_mcap", "sniff"]
MAX_CHUNK = 1 << 30
"""[bytes] Largest chunk, record or unpacked file that is accepted: protects memory from declared lengths."""


def sniff(path: Path) -> bool:
    """Return whether a path is an MCAP recording: by its first bytes, a folder by the names of its files."""
    if path.is_dir():
        return any(file.name.endswith((".mcap", ".mcap.zstd")) for file in path.iterdir())
    try:
        with open_regular(path) as file:
            head = file.read(len(MAGIC))
    except OSError:
        return False
    return head == MAGIC or (head.startswith(ZSTD_MAGIC) and ".mcap" in path.name)


def open_mcap(
    path: Path | Sequence[Path], *, strict: bool = False, check_crc: bool = True, limit_bytes: int = MAX_CHUNK
) -> Recording:
    """Open a recording, or a folder with the splits of one; its log notes a truncated end.

    Without joint states, transforms or posture angles it has no streams; `topics` has the reason for each topic.

    Args:
        path: an .mcap file, plain or zstd-compressed as a whole, a folder of them (rosbag2), or a list of files, which
            must follow each other in time.
        strict: refuse a truncated recording, and a folder with a damaged split.
        check_crc: compare the CRC of every chunk that has one.
        limit_bytes: the largest chunk, record or unpacked file that is accepted.

    Raises:
        ReadError: not an MCAP recording, or damaged so that samples would be wrong or missing.
    """
    log = ReadLog()
    channels: list[DecodableChannel | Unused] = []
    given = [] if isinstance(path, Path) else list(path)
    files = given if not isinstance(path, Path) else recording_files(path)
    if not isinstance(path, Path):
        path = Path(" + ".join(map(str, given)))
    record: dict[str, str] = {}
    for container, channels_of_file in _open_files(path, files, strict, check_crc, limit_bytes, log, bool(given)):
        _note(container, log, len(files) > 1 or path.is_dir())
        channels += channels_of_file
        record |= container.records.get(OWN, {})
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
        else:
            unused.append(channel)
    streams, topics = _streams(parts, log, strict)
    topics += [Topic(item.topic, item.type, item.container.counts[item.channel], False, item.why) for item in unused]
    return Recording(str(path), "mcap", tuple(streams), tuple(_by_topic(topics)), log)


def _open_files(
    path: Path,
    files: Sequence[Path],
    strict: bool,
    check_crc: bool,
    limit_bytes: int,
    log: ReadLog,
    in_turn: bool,
) -> list[tuple[Container, list[DecodableChannel | Unused]]]:
    """Open all files by start time; a damaged one of several is noted and left out.

    Args:
        in_turn: refuse files that do not follow each other in time.
    """
    opened = []
    for file in files:
        try:
            container = Container(file, check_crc=check_crc, limit_bytes=limit_bytes)
            opened.append((container, classified(container)))
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
    if in_turn and any(repeats):
        at = repeats.index(True)
        one, other = (by_time[number][0].path for number in (at, at + 1))
        hint = "a list holds the files of one recording; read several recordings one by one"
        raise ReadError(path, f"{one.name} and {other.name} were recorded at one time", hint=hint)
    return opened if any(repeats) else by_time


def classified(container: Store) -> list[DecodableChannel | Unused]:
    """Return the content of each channel of a file.

    Raises:
        ReadError: a chunk is damaged, or messages are compressed one by one.
    """
    return [classify(container, container.channels[number]) for number in sorted(container.channels)]


def _note(container: Container, log: ReadLog, named: bool) -> None:
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


def _streams(parts: Sequence[DecodableChannel], log: ReadLog, strict: bool) -> tuple[list[Stream], list[Topic]]:
    """Return a stream for each group of channels with usable messages, and the use of each topic."""
    contents = Contents(parts, strict=strict)
    for text in contents.lost:
        log.lose(text)
    streams, topics = [], []
    for kind, group in dict.fromkeys((part.kind, part.group) for part in parts):
        mine = [part for part in parts if (part.kind, part.group) == (kind, group)]
        header = stream_header(mine, kind, contents)
        why = {"joints": "joint positions", "frames": "poses of frames", "angles": "a posture table"}.get(kind, "")
        if header is None:
            why = "only static transforms" if all(part.static for part in mine) else "none of its messages is usable"
            skipped = [track.log.first_skipped for part in mine if (track := contents.tracks.get(id(part)))]
            why += "".join(f" ({place})" for place in skipped[:1] if place)
        else:
            streams.append(StreamReader(mine, kind, header, contents, log).stream(_main_topic(mine)))
        topics += [
            Topic(part.topic, part.type, part.container.counts[part.channel], header is not None, why) for part in mine
        ]
    return streams, topics


def _main_topic(parts: Sequence[DecodableChannel]) -> str:
    moving = [part for part in parts if not part.static]
    return max(moving, key=lambda part: part.container.counts[part.channel]).topic


def _by_topic(topics: Sequence[Topic]) -> list[Topic]:
    """Return one entry for each topic and type; counts of several publishers and files are added."""
    joined: dict[tuple[str, str], Topic] = {}
    for topic in topics:
        known = joined.get((topic.name, topic.type))
        if known is not None:
            topic = Topic(
                topic.name,
                topic.type,
                (known.count or 0) + (topic.count or 0),
                known.usable or topic.usable,
                known.why if known.usable else topic.why,
            )
        joined[topic.name, topic.type] = topic
    return list(joined.values())
