"""Scores and postures as MCAP channels that Foxglove, Lichtblick and Rerun plot.

One JSON message per frame on `/ergonomics/reba` (or `/ergonomics/posture`) with a JSON schema, at the time stamps of
the recording; the rules as a metadata record named `reba`, the version in the header. A file of scores also contains
the topics of the original recording if that was MCAP.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from reba.errors import ReadError
from reba.file_stamp import TRY_AGAIN, unchanged
from reba.files import as_json, sha256_of
from reba.method.scoring import SCORE_COLUMNS
from reba.open_file import open_regular
from reba.posture.columns import COLUMNS
from reba.posture.table import PostureTable
from reba.provenance import generator
from reba.readers.mcap.container import Container

if TYPE_CHECKING:
    from mcap.writer import Writer

TOPICS: Final = {"scores": "/ergonomics/reba", "postures": "/ergonomics/posture"}
SCHEMAS: Final = {"scores": "reba.Scores", "postures": "reba.Posture"}
BLOCK_ROWS: Final = 16_384
"""Frames converted to JSON text at a time; bounds the memory for text."""
MAX_CHUNK_BYTES: Final = 1 << 30
"""[bytes] Largest decompressed chunk of a source; protects against decompression bombs."""
_MESSAGE_HEADER: Final = struct.Struct("<IQQ")
"""Sequence, log time and publish time: the fields directly before the payload of a message (MCAP specification)."""


def write_mcap(
    data: pd.DataFrame,
    metadata: dict[str, Any],
    path: Path,
    postures: PostureTable,
    kind: str,
    records: Mapping[str, Mapping[str, str]] | None = None,
) -> None:
    """Write a table as one JSON channel, together with the original topics and further metadata `records`."""
    from mcap.writer import CompressionType, Writer

    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        writer.start(profile="", library=generator())
        texts = {key: value if isinstance(value, str) else as_json(value) for key, value in metadata.items()}
        writer.add_metadata("reba", texts)
        for name, record in (records or {}).items():
            writer.add_metadata(name, dict(record))
        schema = writer.register_schema(SCHEMAS[kind], "jsonschema", json.dumps(_schema(data, kind)).encode())
        channel = writer.register_channel(TOPICS[kind], "json", schema)
        messages = _json_messages(data, postures.epoch)
        source = Path(postures.source)
        if kind == "scores" and source.is_file() and _is_mcap(source):
            with unchanged(source):
                if postures.quality.sha256 not in ("", sha256_of(source)):
                    raise ReadError(source, "changed after it was read", hint=TRY_AGAIN)
                _merge_with_source(writer, source, channel, messages)
        else:
            for stamp, text in messages:
                writer.add_message(channel, stamp, text, stamp)
        writer.finish()


def _schema(data: pd.DataFrame, kind: str) -> dict[str, Any]:
    def schema_of(name: str) -> dict[str, Any]:
        if name == "time":
            return {"type": "number", "description": "seconds since the start of the recording"}
        if name in COLUMNS:
            return {"type": ["number", "null"], "description": "degrees; null = not measured"}
        if kind == "scores" and name in SCORE_COLUMNS:
            return {"type": ["integer", "null"], "description": "null = not determined by what was measured"}
        plain = "boolean" if data[name].dtype == bool else "number" if data[name].dtype.kind in "iuf" else "string"
        return {"type": plain, "description": "factor"}

    names = [str(name) for name in data.columns]
    return {"title": SCHEMAS[kind], "type": "object", "properties": {name: schema_of(name) for name in names}}


def _json_messages(data: pd.DataFrame, epoch: float) -> Iterator[tuple[int, bytes]]:
    """Yield (time stamp [ns], JSON text) of every frame."""
    start = round(epoch * 1e9)
    for first in range(0, len(data), BLOCK_ROWS):
        rows = data.iloc[first : first + BLOCK_ROWS]
        stamps = start + np.rint(rows["time"].to_numpy(np.float64) * 1e9).astype(np.int64)
        lines = rows.to_json(orient="records", lines=True, double_precision=9).splitlines()
        for stamp, line in zip(stamps.tolist(), lines, strict=True):
            yield max(stamp, 0), line.encode()


def _is_mcap(path: Path) -> bool:
    with open_regular(path) as stream:
        return stream.read(5) == b"\x89MCAP"


def _merge_with_source(writer: Writer, source: Path, channel: int, scores: Iterator[tuple[int, bytes]]) -> None:
    """Copy every message of the source chunk by chunk and insert the score messages by time stamp.

    Of a truncated recording every complete message is copied, which is also the part that was scored.
    """
    container = Container(source, check_crc=True, limit_bytes=MAX_CHUNK_BYTES)
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}

    def channel_of(number: int) -> int:
        if number not in channels:
            original = container.channels[number]
            if original.schema_id not in schemas and original.schema_id in container.schemas:
                schema = container.schemas[original.schema_id]
                schemas[original.schema_id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            schema_id = schemas.get(original.schema_id, 0)
            channels[number] = writer.register_channel(original.topic, original.encoding, schema_id, original.metadata)
        return channels[number]

    pending = next(scores, None)
    for segment in container.segments:
        loaded = container.load(segment)
        for payload, length, number in zip(
            loaded.scan.payloads.tolist(), loaded.scan.lengths.tolist(), loaded.scan.channels.tolist(), strict=True
        ):
            sequence, log_time, publish_time = _MESSAGE_HEADER.unpack_from(loaded.data, payload - _MESSAGE_HEADER.size)
            while pending is not None and pending[0] <= log_time:
                writer.add_message(channel, pending[0], pending[1], pending[0])
                pending = next(scores, None)
            if number in container.channels:
                data = loaded.data[payload : payload + length]
                writer.add_message(channel_of(number), log_time, data, publish_time, sequence)
    while pending is not None:
        writer.add_message(channel, pending[0], pending[1], pending[0])
        pending = next(scores, None)
