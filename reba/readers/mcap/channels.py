"""Channels of a recording: what their messages contain, and the decoder that reads them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from reba.errors import ReadError
from reba.open_file import read_settings
from reba.readers.mcap import idl, protobuf, ros
from reba.readers.mcap.decode import Batch, ColumnDecoder, Decoder, JsonDecoder, load_json
from reba.readers.mcap.definitions import standard_definitions
from reba.readers.mcap.extract import extract_transforms
from reba.readers.mcap.extract_points import FewPoints
from reba.readers.mcap.layout import Undecodable, Walked
from reba.readers.mcap.meanings import Meaning, meaning_of, meaning_of_json, type_key
from reba.readers.mcap.records import Channel, Schema
from reba.readers.mcap.store import ChunkRef, Store
from reba.readers.recording.stream import Kind
from reba.recording_folder import is_split

Make = Callable[[frozenset[str] | None], Decoder]
_ROS: Final = {"cdr": "ROS 2", "ros1": "ROS 1"}
"""Message encodings that `ros` decodes -> their name."""
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
        note: a warning on how it is read, "" without one.
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
    note: str = ""


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
    shown = (schema.name if schema else "") or channel.encoding
    unused = partial(Unused, container, channel.id, channel.topic, shown)
    if schema is None and channel.schema_id != 0:
        return unused(f"its schema {channel.schema_id} is missing from the file")
    meaning = meaning_of(schema.name) if schema else None
    if channel.encoding == "json":
        return _classify_json(container, channel, meaning, shown)
    if schema is None:
        return unused(f"{channel.encoding or 'an unknown encoding'} without a schema cannot be decoded")
    if meaning is None:
        return unused("no joint states, transforms, points or posture angles")
    if not container.counts[channel.id]:
        return unused("no messages")
    try:
        walk, form, note = walker(container, channel, schema, meaning.fixed)
    except ros.BadSchema as error:
        return unused(f"its schema cannot be used: {error}")
    make = partial(_column_decoder, walk, meaning)
    return _part(container, channel, shown, meaning, f"{form} {shown}", make, note)


def walker(
    container: Store, channel: Channel, schema: Schema, fixed: frozenset[str]
) -> tuple[Callable[[bytes], Walked], str, str]:
    """Return the function that walks a message, the name of the encoding, and a note on the definition.

    Args:
        fixed: fields whose value belongs to the layout of a message.

    Raises:
        BadSchema: the encoding is unknown or the schema is damaged.
    """
    encodings = (channel.encoding, schema.encoding)
    text = schema.data.decode(errors="replace")
    if channel.encoding in _ROS and not text.strip():
        walk = _standard(container, channel, schema, fixed)
        note = f"{channel.topic}: the recording does not define {schema.name}; its standard definition is used"
        return walk, f"{_ROS[channel.encoding]} ({channel.encoding.upper()}, standard definition)", note
    if encodings in (("cdr", "ros2msg"), ("ros1", "ros1msg")):
        root = ros.parse(text, schema.name, ros1=channel.encoding == "ros1")
    elif encodings in (("cdr", "ros2idl"), ("cdr", "omgidl")):
        root = idl.parse(text, schema.name)
    elif encodings == ("protobuf", "protobuf"):
        return partial(_walk_protobuf, protobuf.parse(schema.data), schema.name, fixed), "protobuf", ""
    else:
        raise ros.BadSchema(
            f"messages in {channel.encoding!r} by a schema in {schema.encoding!r} are not read; record CDR with "
            "ros2msg or ros2idl, ROS 1, protobuf or JSON"
        )
    return partial(_walk_ros, root, channel.encoding == "ros1", fixed), _form(channel, schema), ""


def _column_decoder(walk: Callable[[bytes], Walked], meaning: Meaning, wanted: frozenset[str] | None) -> ColumnDecoder:
    extract = meaning.extract
    if meaning.kind == "points":
        few = FewPoints(walk, extract)
        walk, extract = few.walk, few.extract
    return ColumnDecoder(walk, extract, wanted)


def _form(channel: Channel, schema: Schema) -> str:
    by = {"ros2idl": ", IDL", "omgidl": ", IDL"}.get(schema.encoding, "")
    return f"{_ROS[channel.encoding]} ({channel.encoding.upper()}{by})"


def _standard(container: Store, channel: Channel, schema: Schema, fixed: frozenset[str]) -> Callable[[bytes], Walked]:
    """Return the function that walks messages by the standard definition of their type that fits the first of them.

    Raises:
        BadSchema: the type has none.
    """
    ros1 = channel.encoding == "ros1"
    walkers = [
        partial(_walk_ros, ros.parse(text, schema.name, ros1=ros1), ros1, fixed)
        for text in standard_definitions(type_key(schema.name), ros1=ros1)
    ]
    if not walkers:
        raise ros.BadSchema("it is empty; record again with the package of the type in the environment of the recorder")
    message = first_message(container, channel.id) or b""
    for walk in walkers:
        try:
            walk(message)
        except Undecodable:
            continue
        return walk
    return walkers[0]


def _walk_ros(root: ros.Struct, ros1: bool, fixed: frozenset[str], message: bytes) -> Walked:
    return ros.walk(root, message, fixed, ros1=ros1)


def _walk_protobuf(types: protobuf.Types, name: str, fixed: frozenset[str], message: bytes) -> Walked:
    return protobuf.walk(types, name, message, fixed)


def _classify_json(
    container: Store, channel: Channel, meaning: Meaning | None, shown: str
) -> DecodableChannel | Unused:
    """Return the content of a JSON channel by its type, else by the fields of its first message."""
    unused = partial(Unused, container, channel.id, channel.topic, shown)
    message = first_message(container, channel.id)
    if message is None:
        return unused("no messages")
    if meaning is None:
        try:
            meaning = meaning_of_json(load_json(message))
        except Undecodable as error:
            return unused(str(error))
    if meaning is None:
        return unused("no joint states, transforms, points or posture angles")
    return _part(container, channel, shown, meaning, f"JSON {shown}", partial(JsonDecoder, meaning.extract))


def _part(
    container: Store, channel: Channel, shown: str, meaning: Meaning, form: str, make: Make, note: str = ""
) -> DecodableChannel:
    transforms = meaning.extract is extract_transforms
    static = transforms and channel.topic.rstrip("/").endswith(STATIC)
    group = "" if transforms else channel.topic
    kind = meaning.kind
    return DecodableChannel(container, channel.id, channel.topic, shown, kind, form, make, group, static, note)


def recording_files(path: Path) -> list[Path]:
    """Return the recordings of a folder of splits in the order of their names, or the file itself.

    Raises:
        ReadError: the folder has none, or recordings of several formats.
    """
    if not path.is_dir():
        return [path]
    files = [file for file in path.iterdir() if is_split(file.name)]
    if not files:
        raise ReadError(path, "the folder has no .mcap, .db3 or .bag file", hint="give a recording or a rosbag2 folder")
    if len(_formats(files)) > 1:
        listed = _listed(path / "metadata.yaml")
        files = [file for file in files if file.name in listed] or files
    if len(kinds := sorted(_formats(files))) > 1:
        what = f"the folder has .{' and .'.join(kinds)} files, which may be copies of each other"
        raise ReadError(path, what, hint="give one of them, or put them into folders of their own")
    return sorted(files, key=_in_order)


def _formats(files: Iterable[Path]) -> set[str]:
    return {file.name.removesuffix(".zstd").rpartition(".")[2] for file in files}


def _listed(metadata: Path) -> set[str]:
    """Return the names of the files that the metadata of a rosbag2 folder lists, none without metadata."""
    try:
        text = read_settings(metadata)
    except (OSError, UnicodeDecodeError):
        return set()
    # All that is needed of YAML: a list of paths, of which early versions wrote whole ones.
    lines = re.findall(r"^[ \t]*-[ \t]+[\"']?([^\n\"']+)", text, flags=re.MULTILINE)
    return {line.strip().rpartition("/")[2] for line in lines}


def _in_order(file: Path) -> list[int | str]:
    """Return a key by which `x_10` comes after `x_2`."""
    return [int(part) if at % 2 else part for at, part in enumerate(re.split(r"([0-9]+)", file.name))]
