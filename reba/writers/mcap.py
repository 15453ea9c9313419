"""Scores and postures as an MCAP channel that Foxglove, Lichtblick, PlotJuggler and Rerun plot.

One message per frame on `/ergonomics/reba` (or `/ergonomics/posture`): JSON with a schema, or a ROS message; the rules
as a metadata record named `reba`, the version in the header. Scores of an MCAP recording come in a copy of it, each at
the log time of the message that its frame comes from, so that the file has one clock.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from itertools import count
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from mcap.records import Channel, Schema

from reba.arrays import Array, Indices
from reba.errors import ReadError, join_names, warn_user
from reba.file_stamp import TRY_AGAIN, unchanged
from reba.files import as_json, sha256_of
from reba.posture.table import PostureTable
from reba.provenance import generator
from reba.readers.mcap import is_mcap, open_files
from reba.readers.mcap.container import Container
from reba.readers.mcap.frame_times import Times, frame_times, own_times
from reba.readers.mcap.records import LATEST
from reba.readers.recording.stream import ReadLog
from reba.writers.json_messages import json_rows, schema_of
from reba.writers.mcap_copy import McapCopy, free_id
from reba.writers.mcap_file import McapFile, message
from reba.writers.ros_messages import ENCODINGS, NAMES, ROS1, ROS2, definition, ros_rows

JSON: Final = ("json", "jsonschema")
"""Encoding of messages and of their schema."""
TOPICS: Final = {"scores": "/ergonomics/reba", "postures": "/ergonomics/posture"}
SCHEMAS: Final = {"scores": "reba.Scores", "postures": "reba.Posture"}
CHUNK_BYTES: Final = 1 << 20
"""[bytes] Of messages in a chunk, before compression."""
MOST_TOPICS: Final = 3
"""Topics that a message names."""
_SEQUENCE: Final = 0xFFFFFFFF
"""Largest sequence number."""


def write_mcap(
    data: pd.DataFrame,
    metadata: Mapping[str, Any],
    path: Path,
    postures: PostureTable,
    kind: str,
    records: Mapping[str, Mapping[str, str]] | None = None,
    *,
    as_ros: bool = False,
) -> None:
    """Write a table as one channel, scores of an MCAP recording into a copy of it.

    Args:
        data: `time` [s] and further columns.
        metadata: of the record `reba`.
        path: file to write.
        postures: what the table was made of.
        kind: "scores" or "postures".
        records: further metadata records.
        as_ros: ROS messages instead of JSON, ROS 1 in a recording of ROS 1.

    Raises:
        ReadError: the recording changed after it was read.
    """
    source = Path(postures.source)
    copied = kind == "scores" and postures.topic != "" and source.exists() and is_mcap(source)
    guard: AbstractContextManager[None] = unchanged(source) if copied else nullcontext()
    with guard, path.open("wb") as stream:
        time = data["time"].to_numpy(np.float64)
        own = own_times(time, postures.epoch)
        copy, times = None, own
        if copied:
            if postures.quality.sha256 and postures.quality.sha256 != sha256_of(source):
                raise ReadError(source, "changed after it was read", hint=TRY_AGAIN)
            copy, times = _open_copy(source, postures, time)
        profile = copy.profile if copy is not None else ""
        if as_ros and not profile and (copy is None or copy.is_cdr):
            profile = ROS2
        file = McapFile(stream, profile, copy.library if copy is not None else generator())
        encoding = "" if not as_ros else ROS1 if profile == ROS1 else ROS2
        if encoding and copy is not None:
            _warn_of_others(copy, encoding, postures.source)
        number = _define(file, data, kind, copy, encoding)
        order = np.argsort(times[0], kind="stable")
        texts = ros_rows(data, order, own[0], encoding) if as_ros else json_rows(data, order)
        rows = Rows(file, number, order, times, texts)
        if copy is not None:
            copy.write(file, rows.until)
        rows.until(None)
        for name, record in {"reba": metadata, **(records or {})}.items():
            file.metadata(name, {key: _text(value) for key, value in record.items()})
        file.finish()


def _warn_of_others(copy: McapCopy, encoding: str, source: str) -> None:
    others = list(dict.fromkeys(copy.topics_beside(ENCODINGS[encoding][0])))
    if others:
        text = f"some topics of {source} are no ROS messages ({join_names(others, MOST_TOPICS)})"
        warn_user(f"{text}; copied as they are, so that rosbags does not open the file")


class Rows:
    """Messages of a table that are still to be written, by log time.

    Args:
        number: id of their channel.
        order: (n,) frames by log time.
        times: (n,) log and (n,) publish times [ns] of the frames.
        texts: the message of each frame in that order.
    """

    def __init__(self, file: McapFile, number: int, order: Indices, times: Times, texts: Iterator[bytes]) -> None:
        self._file = file
        self._number = number
        self._order = order
        self._log, self._publish = (np.maximum(time, 0)[order] for time in times)
        self._texts = texts
        self._next = 0
        self._chunk = bytearray()

    def until(self, time: int | None) -> None:
        """Write the messages up to a log time [ns], all of them without one, so that chunks stay in order of time."""
        stop = len(self._log) if time is None else int(np.searchsorted(self._log, min(time, LATEST), side="right"))
        for at in range(self._next, stop):
            sequence, log, publish = int(self._order[at]), int(self._log[at]), int(self._publish[at])
            self._chunk += message(self._number, sequence & _SEQUENCE, log, publish, next(self._texts))
            if len(self._chunk) >= CHUNK_BYTES:
                self._write()
        self._next = max(stop, self._next)
        self._write()

    def _write(self) -> None:
        self._file.chunk(bytes(self._chunk))
        self._chunk.clear()


def _text(value: Any) -> str:
    text = value if isinstance(value, str) else as_json(value)
    return text.encode(errors="backslashreplace").decode()


def _open_copy(source: Path, postures: PostureTable, time: Array) -> tuple[McapCopy, Times]:
    """Return what is copied of a recording, and (n,) log and publish times [ns] of the frames in it."""
    files = open_files(source, ReadLog())
    times = frame_times(files, postures, time)
    return McapCopy([file for file, _ in files if isinstance(file, Container)]), times


def _define(file: McapFile, data: pd.DataFrame, kind: str, copy: McapCopy | None, ros: str) -> int:
    """Define the channel of a table, and return its id; a topic that the recording has already gets a number."""
    schemas, channels = (copy.schemas, copy.channels) if copy is not None else ({}, {})
    topics = {channel.topic for channel in channels.values()}
    topic = next(name for name in _numbered(TOPICS[kind]) if name not in topics)
    if ros:
        name, text, (encoding, language) = NAMES[ros], definition(data, ros), ENCODINGS[ros]
    else:
        name, text, (encoding, language) = SCHEMAS[kind], json.dumps(schema_of(data, SCHEMAS[kind])), JSON
    schema = Schema(id=free_id(schemas), name=name, encoding=language, data=text.encode())
    file.define(schema)
    number = free_id(channels)
    file.define(Channel(id=number, topic=topic, message_encoding=encoding, metadata={}, schema_id=schema.id))
    return number


def _numbered(name: str) -> Iterator[str]:
    """Yield a name, then the name with 2, 3 ... behind it."""
    yield name
    yield from (f"{name}_{number}" for number in count(2))
