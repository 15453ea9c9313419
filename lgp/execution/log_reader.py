"""Reading the log of a run back, also one that a crash cut off."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lgp.errors import LgpError
from lgp.execution.events import Event
from lgp.execution.log import RunLog
from lgp.execution.simulation import Attachment
from reba.arrays import Array
from reba.readers.mcap.container import Container

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


ASIDE = ".interrupted"
"""Added to the name of a log while its messages are copied."""


def checkpoint(
    epoch: float, time: float, q: Array, closed: Iterable[str], things: Mapping[str, Attachment]
) -> dict[str, Any]:
    """Return what a restart needs of the world as plain data.

    Args:
        epoch: wall-clock time at which the run began [s].
        time: since then [s].
        q: (nq,) configuration of everybody.
        closed: hands whose grippers are closed.
        things: where objects truly are, for a simulated world.
    """
    return {
        "epoch": epoch,
        "time": time,
        "q": q.tolist(),
        "closed": sorted(closed),
        "things": {
            name: {"hand": at.hand, "rotation": at.rotation.tolist(), "position": at.position.tolist()}
            for name, at in things.items()
        },
    }


def attachments(state: Mapping[str, Any]) -> dict[str, Attachment]:
    """Return where objects are by a checkpoint."""
    return {
        name: Attachment(at["hand"], np.array(at["rotation"]), np.array(at["position"]))
        for name, at in state["things"].items()
    }


def continue_log(file: Path) -> Past:
    """Set the log of an interrupted run aside and return what it says.

    Raises:
        LgpError: there is no log, or its run is over.
        ReadError: it is no MCAP log.
    """
    aside = file.with_name(file.name + ASIDE)
    pasts = [past for past in map(_past, (file, aside)) if past is not None]
    if not pasts:
        raise LgpError(f"{file}: there is no log to go on from; run without --resume")
    past = max(pasts, key=lambda one: one.last)
    if past.over:
        raise LgpError(f"{file}: the run is over; run without --resume to begin again")
    os.replace(past.file, aside)
    return replace(past, file=aside)


def _past(file: Path) -> Past | None:
    """Return what a log says, None if there is none or it breaks off before it says where the run stood."""
    if not file.is_file() or not file.stat().st_size:
        return None
    return read_past(file)
