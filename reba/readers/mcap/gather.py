"""Channels with their contents -> a recording: one stream for each group of channels, and the use of every topic."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from reba.readers.mcap.channels import DecodableChannel, Unused
from reba.readers.mcap.container import Container
from reba.readers.mcap.contents import Contents
from reba.readers.mcap.database import Database
from reba.readers.mcap.stream_header import stream_header
from reba.readers.mcap.streams import StreamReader
from reba.readers.recording.stream import ReadLog, Recording, Stream, Topic

WHAT: Final = {
    "joints": "joint positions",
    "frames": "poses of frames",
    "points": "positions of points",
    "angles": "a posture table",
}
"""Kind -> what a topic has, in `reba info`."""


def recording_of(
    path: Path,
    parts: Sequence[DecodableChannel],
    unused: Sequence[Unused],
    contents: Contents,
    log: ReadLog,
) -> Recording:
    """Return the recording of some channels with their contents."""
    streams, topics = _streams(parts, contents, log)
    topics += [Topic(item.topic, item.type, item.container.counts[item.channel], False, item.why) for item in unused]
    stores = [*(part.container for part in parts), *(item.container for item in unused)]
    formats = {store.format for store in stores if isinstance(store, Container | Database)}
    return Recording(str(path), min(formats, default="mcap"), tuple(streams), tuple(_by_topic(topics)), log)


def _streams(parts: Sequence[DecodableChannel], contents: Contents, log: ReadLog) -> tuple[list[Stream], list[Topic]]:
    """Return a stream for each group of channels with usable messages, and the use of each topic."""
    streams, topics = [], []
    for kind, group in dict.fromkeys((part.kind, part.group) for part in parts):
        mine = [part for part in parts if (part.kind, part.group) == (kind, group)]
        header = stream_header(mine, kind, contents)
        why = WHAT[kind]
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
