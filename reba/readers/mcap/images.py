"""Compressed camera images of a recording: the one that was recorded nearest to a time.

Types: https://docs.ros.org/en/rolling/p/sensor_msgs/msg/CompressedImage.html and
https://docs.foxglove.dev/docs/visualization/message-schemas/compressed-image.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.errors import ReadError
from reba.readers.mcap import ros
from reba.readers.mcap.channels import batch_of, segments_of, walker
from reba.readers.mcap.decode import load_json
from reba.readers.mcap.layout import FieldSpan, Undecodable
from reba.readers.mcap.meanings import type_key
from reba.readers.mcap.records import Channel
from reba.readers.mcap.store import ChunkRef, Store, StoredFile

TYPES: Final = ("sensor_msgs/CompressedImage", "foxglove/CompressedImage", "foxglove_msgs/CompressedImage")
"""Types of messages that hold one compressed image, by `type_key`."""
DEPTH: Final = "compressedDepth"
"""In the format of images whose numbers are distances behind a head of their own: no pictures."""
_FIELDS: Final = frozenset({"format"})


@dataclass(frozen=True)
class ImageMessage:
    """One image: log time [ns], its bytes as the camera sent them, and what tells it from others."""

    time: int
    data: bytes
    key: tuple[int, int, int]


class Camera:
    """The images of one topic, of all files of a recording."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.count = 0
        self._parts: list[tuple[Store, Channel, Callable[[bytes], bytes]]] = []
        self._times: dict[tuple[int, int], NDArray[np.int64]] = {}

    def add(self, store: Store, channel: Channel, data_of: Callable[[bytes], bytes]) -> None:
        """Add the channel of a file; `data_of` returns the image in a message."""
        self._parts.append((store, channel, data_of))
        self.count += store.counts[channel.id]

    def nearest(self, time: int, within: int) -> ImageMessage | None:
        """Return the image whose log time [ns] is nearest to a time, None if none is `within` [ns] of it.

        Segments are searched from the nearest on, until all others are farther away than the best.

        Raises:
            ReadError: a segment is damaged.
            Undecodable: the message is no image.
        """
        best, position = within + 1, None
        places = [
            (_away(segment, time), number, at)
            for number, (store, channel, _) in enumerate(self._parts)
            for at, segment in enumerate(segments_of(store, channel.id))
        ]
        for away, number, at in sorted(places):
            if away >= best:
                break
            times = self._times_of(number, at)
            if len(times):
                row = int(np.argmin(np.abs(times - time)))
                if (distance := abs(int(times[row]) - time)) < best:
                    best, position = distance, (number, at, row)
        if position is None:
            return None
        store, channel, data_of = self._parts[position[0]]
        batch = batch_of(store, segments_of(store, channel.id)[position[1]], channel.id)
        return ImageMessage(int(batch.times[position[2]]), data_of(batch.payload(position[2])), position)

    def _times_of(self, number: int, at: int) -> NDArray[np.int64]:
        """Return the log times [ns] of the images in a segment."""
        if (number, at) not in self._times:
            store, channel, _ = self._parts[number]
            self._times[number, at] = batch_of(store, segments_of(store, channel.id)[at], channel.id).times.copy()
        return self._times[number, at]

    def release(self) -> None:
        """Free the memory of loaded segments."""
        for store, _, _ in self._parts:
            store.release()


def cameras_of(files: Sequence[StoredFile]) -> list[Camera]:
    """Return the topics with compressed images that can be read, that with the most images first."""
    cameras: dict[str, Camera] = {}
    for store in files:
        for channel in store.channels.values():
            schema = store.schemas.get(channel.schema_id)
            if schema is None or type_key(schema.name) not in TYPES or not store.counts[channel.id]:
                continue
            try:
                data_of = _data_of(store, channel)
                images = store.store_of(channel.id)
            except (ros.BadSchema, ReadError):
                continue
            cameras.setdefault(channel.topic, Camera(channel.topic)).add(images, channel, data_of)
    return sorted(cameras.values(), key=lambda camera: (-camera.count, camera.topic))


def _away(segment: ChunkRef, time: int) -> int:
    """Return how far a time [ns] is from a segment at least."""
    end = segment.chunk.end if segment.chunk is not None else max(segment.start, time)
    return max(segment.start - time, time - end, 0)


def _data_of(store: Store, channel: Channel) -> Callable[[bytes], bytes]:
    """Return the function that returns the image in a message of a channel.

    Raises:
        BadSchema: the schema cannot be used.
    """
    if channel.encoding == "json":
        return _from_json
    walk, _, _ = walker(store, channel, store.schemas[channel.schema_id], _FIELDS)

    def data_of(message: bytes) -> bytes:
        tree = walk(message).tree
        data = tree.get("data") if isinstance(tree, dict) else None
        if not isinstance(tree, dict) or not isinstance(data, FieldSpan) or DEPTH in str(tree.get("format", "")):
            raise Undecodable("it holds no picture")
        return message[data.start : data.start + data.count]

    return data_of


def _from_json(message: bytes) -> bytes:
    tree = load_json(message)
    text = tree.get("data") if isinstance(tree, dict) else None
    try:
        return base64.b64decode(text, validate=True) if isinstance(text, str) else bytes(text or ())
    except (ValueError, TypeError) as error:
        raise Undecodable("its data are neither base64 text nor bytes") from error
