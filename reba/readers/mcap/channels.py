"""Channels of a recording: what their messages contain, and the decoder that reads them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from reba.errors import ReadError
from reba.readers.mcap import protobuf, ros
from reba.readers.mcap.bytes import ZSTD_MAGIC
from reba.readers.mcap.container import ChunkRef, Store
from reba.readers.mcap.decode import Batch, ColumnDecoder, Decoder, JsonDecoder, load_json
from reba.readers.mcap.extract import EXTRACTORS, TEXTS, Extractor, extract_transforms, kind_of_json
from reba.readers.mcap.layout import Undecodable, Walked
from reba.readers.mcap.records import Channel, Schema
from reba.readers.recording.stream import Kind

Make = Callable[[frozenset[str] | None], Decoder]
_ROS: Final = {("cdr", "ros2msg"): "ROS 2", ("ros1", "ros1msg"): "ROS 1"}
"""Message and schema encodings that `ros` decodes -> their name."""
STATIC: Final = "tf_static"
"""Last part of the name of a topic whose transforms are valid for the complete recording."""


@dataclass(frozen=True)
class DecodableChannel:
    """One usable channel of one file.

    Attributes:
        channel: id of the channel in the file.
        topic, type: for messages.
        kind, format: as in `Stream`.
        make: makes its decoder for a set of wanted names (None: all).
        group: channels of one kind and group form one stream: a topic, or "" for all transforms.
        static: whether its transforms are valid for the complete recording.
    """

    container: Store
    channel: int
    topic: str
    type: str
    kind: Kind
    format: str
    make: Make
    group: str
    static: bool


@dataclass(frozen=True)
class Unused:
    """A channel that is not read, and why."""

    container: Store
    channel: int
    topic: str
    type: str
    why: str


def segments_of(container: Store, channel: int) -> list[ChunkRef]:
    """Return the segments with messages of a channel by the indexes of the file, or all without index."""
    hinted = [seg for seg in container.segments if seg.channels is None or channel in seg.channels]
    return hinted or container.segments


def batch_of(container: Store, segment: ChunkRef, channel: int, first: int = 0) -> Batch:
    """Return the messages of a channel in a segment; `first` is the number of the first of them in the channel."""
    loaded = container.load(segment)
    scan = loaded.scan
    mine = scan.channels == channel
    if mine.all():
        numbers = np.arange(first, first + len(mine))
        return Batch(loaded, scan.payloads, scan.lengths, scan.times, numbers)
    at = np.flatnonzero(mine)
    numbers = np.arange(first, first + len(at))
    return Batch(loaded, scan.payloads[at], scan.lengths[at], scan.times[at], numbers)


def first_message(container: Store, channel: int) -> bytes | None:
    """Return the first message of a channel, None without messages."""
    if container.counts[channel] == 0:
        return None
    for segment in segments_of(container, channel):
        batch = batch_of(container, segment, channel)
        if len(batch.starts):
            return batch.payload(0)
    return None


def classify(container: Store, channel: Channel) -> DecodableChannel | Unused:
    """Return the content of a channel: decodable, or unused with the reason."""
    schema = container.schemas.get(channel.schema_id)
    type_name = schema.name.replace("/msg/", "/") if schema else ""
    shown = (schema.name if schema else "") or channel.encoding
    unused = partial(Unused, container, channel.id, channel.topic, shown)
    if schema is None and channel.schema_id != 0:
        return unused(f"its schema {channel.schema_id} is missing from the file")
    meaning = EXTRACTORS.get(type_name)
    if channel.encoding == "json":
        return _classify_json(container, channel, meaning, shown)
    if schema is None:
        return unused(f"{channel.encoding or 'an unknown encoding'} without a schema cannot be decoded")
    if meaning is None:
        return unused("no joint states, transforms or posture angles")
    if not container.counts[channel.id]:
        return unused("no messages")
    try:
        make, form = _decoder(container, channel, schema, meaning[1])
    except ros.BadSchema as error:
        return unused(f"its schema cannot be used: {error}")
    return _part(container, channel, shown, meaning, f"{form} {shown}", make)


def _decoder(container: Store, channel: Channel, schema: Schema, extract: Extractor) -> tuple[Make, str]:
    """Return the maker of a decoder and the name of the encoding.

    Raises:
        BadSchema: the encoding is unknown or the schema is damaged.
    """
    walker: Callable[[bytes], Walked]
    if (channel.encoding, schema.encoding) in _ROS:
        _refuse_packed(container, channel)
        ros1 = channel.encoding == "ros1"
        root = ros.parse(schema.data.decode(errors="replace"), schema.name, ros1=ros1)
        walker = partial(_walk_ros, root, ros1)
        form = f"{_ROS[channel.encoding, schema.encoding]} ({channel.encoding.upper()})"
    elif (channel.encoding, schema.encoding) == ("protobuf", "protobuf"):
        types = protobuf.parse(schema.data)
        walker = partial(_walk_protobuf, types, schema.name)
        form = "protobuf"
    else:
        raise ros.BadSchema(f"messages in {channel.encoding!r} by a schema in {schema.encoding!r} are not supported")
    return partial(ColumnDecoder, walker, extract), form


def _walk_ros(root: ros.Struct, ros1: bool, message: bytes) -> Walked:
    return ros.walk(root, message, TEXTS, ros1=ros1)


def _walk_protobuf(types: protobuf.Types, name: str, message: bytes) -> Walked:
    return protobuf.walk(types, name, message, TEXTS)


def _refuse_packed(container: Store, channel: Channel) -> None:
    message = first_message(container, channel.id)
    if message is not None and message.startswith(ZSTD_MAGIC):
        raise ReadError(
            container.path,
            f"the messages of {channel.topic} are compressed one by one (ros2 bag --compression-mode message)",
            hint="unpack them with `ros2 bag convert` and give the result",
        )


def _classify_json(
    container: Store, channel: Channel, meaning: tuple[Kind, Extractor] | None, shown: str
) -> DecodableChannel | Unused:
    """Return the content of a JSON channel by its type, else by the fields of its first message."""
    unused = partial(Unused, container, channel.id, channel.topic, shown)
    message = first_message(container, channel.id)
    if message is None:
        return unused("no messages")
    if meaning is None:
        try:
            meaning = kind_of_json(load_json(message))
        except Undecodable as error:
            return unused(str(error))
    if meaning is None:
        return unused("no joint states, transforms or posture angles")
    return _part(container, channel, shown, meaning, f"JSON {shown}", partial(JsonDecoder, meaning[1]))


def _part(
    container: Store, channel: Channel, shown: str, meaning: tuple[Kind, Extractor], form: str, make: Make
) -> DecodableChannel:
    kind, extract = meaning
    transforms = extract is extract_transforms
    static = transforms and channel.topic.rstrip("/").endswith(STATIC)
    group = "" if transforms else channel.topic
    return DecodableChannel(container, channel.id, channel.topic, shown, kind, form, make, group, static)


def recording_files(path: Path) -> list[Path]:
    """Return the recordings of a folder of splits in the order of their names, or the file itself."""
    if not path.is_dir():
        return [path]
    files = sorted(file for file in path.iterdir() if file.name.endswith((".mcap", ".mcap.zstd")))
    if not files:
        raise ReadError(path, "the folder has no .mcap file", hint="give a recording or a rosbag2 folder")
    return files
