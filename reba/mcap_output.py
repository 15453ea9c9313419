"""Scores and postures as MCAP channels that Foxglove, Lichtblick and Rerun plot.

One JSON message a frame on `/ergonomics/reba` (or `/ergonomics/posture`) with a JSON schema, at the time stamps of the
recording, the rules as a metadata record named `reba`, and the topics of the original recording beside them if that
was MCAP.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from reba.errors import RebaError
from reba.posture import COLUMNS, PostureTable

if TYPE_CHECKING:
    from mcap.writer import Writer

TOPICS: Final = {"scores": "/ergonomics/reba", "postures": "/ergonomics/posture"}
SCHEMAS: Final = {"scores": "reba.Scores", "postures": "reba.Posture"}
ROWS: Final = 16_384
"""Frames turned into text at a time."""


def write_mcap(data: pd.DataFrame, about: dict[str, Any], path: Path, postures: PostureTable, kind: str) -> None:
    """Write a table as one JSON channel, with the original topics beside it."""
    from mcap.writer import CompressionType, Writer

    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        writer.start(profile="", library="dreba")
        notes = {key: value if isinstance(value, str) else json.dumps(value) for key, value in about.items()}
        writer.add_metadata("reba", notes)
        schema = writer.register_schema(SCHEMAS[kind], "jsonschema", json.dumps(_schema(data, kind)).encode())
        channel = writer.register_channel(TOPICS[kind], "json", schema)
        messages = _messages(data, postures.epoch)
        source = Path(postures.source)
        if source.is_file() and _is_mcap(source):
            _copy_beside(writer, source, channel, messages)
        else:
            for stamp, text in messages:
                writer.add_message(channel, stamp, text, stamp)
        writer.finish()


def _schema(data: pd.DataFrame, kind: str) -> dict[str, Any]:
    def kind_of(name: str) -> dict[str, Any]:
        if name == "time":
            return {"type": "number", "description": "seconds since the start of the recording"}
        if name in COLUMNS:
            return {"type": ["number", "null"], "description": "degrees; null = not measured"}
        if kind == "scores":
            return {"type": ["integer", "null"], "description": "null = not determined by what was measured"}
        return {"description": "factor"}

    names = [str(name) for name in data.columns]
    return {"title": SCHEMAS[kind], "type": "object", "properties": {name: kind_of(name) for name in names}}


def _messages(data: pd.DataFrame, epoch: float) -> Iterator[tuple[int, bytes]]:
    """Yield (time stamp [ns], JSON text) of every frame."""
    start = round(epoch * 1e9)
    for first in range(0, len(data), ROWS):
        rows = data.iloc[first : first + ROWS]
        stamps = start + np.rint(rows["time"].to_numpy(np.float64) * 1e9).astype(np.int64)
        lines = rows.to_json(orient="records", lines=True, double_precision=9).splitlines()
        for stamp, line in zip(stamps.tolist(), lines, strict=True):
            yield max(stamp, 0), line.encode()


def _is_mcap(path: Path) -> bool:
    with path.open("rb") as stream:
        return stream.read(5) == b"\x89MCAP"


def _copy_beside(writer: Writer, source: Path, channel: int, ours: Iterator[tuple[int, bytes]]) -> None:
    """Copy every message of the source and put ours between them by time.

    A recording that breaks off is copied up to the break, as it was scored up to the break.
    """
    from mcap.exceptions import McapError
    from mcap.stream_reader import StreamReader

    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    known: dict[int, Any] = {}
    next_ours = next(ours, None)
    try:
        with source.open("rb") as stream:
            for record in StreamReader(stream, validate_crcs=True, record_size_limit=1 << 30).records:
                kind = type(record).__name__
                if kind == "Schema":
                    schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                elif kind == "Channel":
                    known[record.id] = record
                elif kind == "Message":
                    while next_ours is not None and next_ours[0] <= record.log_time:
                        writer.add_message(channel, next_ours[0], next_ours[1], next_ours[0])
                        next_ours = next(ours, None)
                    if record.channel_id not in channels:
                        original = known[record.channel_id]
                        channels[record.channel_id] = writer.register_channel(
                            original.topic, original.message_encoding, schemas[original.schema_id], original.metadata
                        )
                    target = channels[record.channel_id]
                    writer.add_message(target, record.log_time, record.data, record.publish_time, record.sequence)
    except (McapError, KeyError, EOFError) as error:
        if not channels:
            raise RebaError(f"{source}: its topics cannot be copied ({error}); write .parquet instead") from error
    while next_ours is not None:
        writer.add_message(channel, next_ours[0], next_ours[1], next_ours[0])
        next_ours = next(ours, None)
