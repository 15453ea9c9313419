"""Reading the log of a run back, also one that a crash cut off."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lgp.execution.events import Event
from lgp.execution.log import RunLog

LIMIT = 1 << 28
"""[bytes] Largest chunk that is unpacked."""


@dataclass(frozen=True)
class Logged:
    """One message of a log; `stamp` in nanoseconds since 1970."""

    topic: str
    encoding: str
    schema: tuple[str, str, bytes]
    stamp: int
    data: bytes


@dataclass(frozen=True)
class Past:
    """What a log says about a run.

    Attributes:
        epoch: wall-clock time at which the run began [s].
        events: all of it so far.
        state: the last checkpoint.
        last: time of the last message [s since the run began].
        file: the log.
    """

    epoch: float
    events: tuple[Event, ...]
    state: dict[str, Any]
    last: float
    file: Path

    def copy_into(self, log: RunLog) -> None:
        """Write all messages into a new log."""
        for message in messages(self.file):
            log.copy(message.topic, message.encoding, message.schema, message.stamp, message.data)
        log.flush()

    @property
    def over(self) -> bool:
        """Whether the run came to an end."""
        return bool(self.events) and self.events[-1].state in ("finished", "failed")


def messages(file: Path) -> Iterator[Logged]:
    """Yield the messages of a log up to its end or to where it breaks off.

    Raises:
        ReadError: the file is no MCAP log.
    """
    from reba.readers.mcap.container import Container

    container = Container(file, check_crc=True, limit_bytes=LIMIT)
    for segment in container.segments:
        loaded = container.load(segment)
        found = loaded.scan
        rows = zip(
            found.payloads.tolist(), found.lengths.tolist(), found.channels.tolist(), found.times.tolist(), strict=True
        )
        for payload, length, number, stamp in rows:
            channel = container.channels.get(number)
            schema = None if channel is None else container.schemas.get(channel.schema_id)
            if channel is not None and schema is not None:
                about = (schema.name, schema.encoding, bytes(schema.data))
                data = bytes(loaded.data[payload : payload + length])
                yield Logged(channel.topic, channel.encoding, about, int(stamp), data)


def read_past(file: Path) -> Past | None:
    """Return what a run came to, None if the log breaks off before it says.

    Raises:
        ReadError: the file is no MCAP log.
    """
    events: list[Event] = []
    state: dict[str, Any] | None = None
    last = 0
    for message in messages(file):
        last = max(last, message.stamp)
        if message.topic == "/events":
            events.append(Event(**json.loads(message.data)))
        elif message.topic == "/state":
            state = json.loads(message.data)
    if state is None:
        return None
    return Past(state["epoch"], tuple(events), state, last / 1e9 - state["epoch"], file)
