"""Reader of the log of a run, also of one that a crash cut short; checkpoints to resume from."""

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
from lgp.execution.simulation import Placement
from reba.arrays import Array
from reba.readers.mcap.container import Container

LIMIT = 1 << 28
"""[bytes] Largest chunk that is decompressed: a guard against damaged lengths."""


@dataclass(frozen=True)
class LoggedMessage:
    """One message of a log; `stamp` in nanoseconds since 1970."""

    topic: str
    encoding: str
    schema: tuple[str, str, bytes]
    stamp: int
    data: bytes


@dataclass(frozen=True)
class LoggedRun:
    """The part of a run that a log holds.

    Attributes:
        epoch: wall-clock time at which the run began [s].
        state: the last checkpoint.
        last: time of the last message [s since the run began].
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
        """Whether the run has ended."""
        return bool(self.events) and self.events[-1].state in ("finished", "failed")


def messages(file: Path) -> Iterator[LoggedMessage]:
    """Yield the messages of a log up to its end, or to where a crash cut it short.

    Raises:
        ReadError: the file is no MCAP log.
    """
    container = Container(file, check_crc=True, limit_bytes=LIMIT)
    for chunk in container.segments:
        loaded = container.load(chunk)
        scan = loaded.scan
        rows = zip(
            scan.payloads.tolist(), scan.lengths.tolist(), scan.channels.tolist(), scan.times.tolist(), strict=True
        )
        for payload, length, number, stamp in rows:
            channel = container.channels.get(number)
            schema = None if channel is None else container.schemas.get(channel.schema_id)
            if channel is not None and schema is not None:
                about = (schema.name, schema.encoding, bytes(schema.data))
                data = bytes(loaded.data[payload : payload + length])
                yield LoggedMessage(channel.topic, channel.encoding, about, int(stamp), data)


def read_logged_run(file: Path) -> LoggedRun | None:
    """Return the logged part of a run, None if the log ends before its first checkpoint.

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
    return LoggedRun(state["epoch"], tuple(events), state, last / 1e9 - state["epoch"], file)


INTERRUPTED = ".interrupted"
"""Suffix of the name of an interrupted log while its messages are copied into the new one."""


def checkpoint(
    epoch: float, time: float, q: Array, closed: Iterable[str], objects: Mapping[str, Placement]
) -> dict[str, Any]:
    """Return what a restart needs of the world as plain data.

    Args:
        epoch: wall-clock time at which the run began [s].
        time: since then [s].
        q: (nq,) configuration of human and robots [rad, m].
        closed: hands whose grippers are closed.
        objects: true placements in a simulated world.
    """
    return {
        "epoch": epoch,
        "time": time,
        "q": q.tolist(),
        "closed": sorted(closed),
        "things": {
            name: {"hand": at.hand, "rotation": at.rotation.tolist(), "position": at.position.tolist()}
            for name, at in objects.items()
        },
    }


def placements(state: Mapping[str, Any]) -> dict[str, Placement]:
    """Return the placements of objects in a checkpoint."""
    return {
        name: Placement(at["hand"], np.array(at["rotation"]), np.array(at["position"]))
        for name, at in state["things"].items()
    }


def continue_log(file: Path) -> LoggedRun:
    """Rename the log of an interrupted run and return the run that it holds.

    Raises:
        LgpError: there is no log, or its run has ended.
        ReadError: it is no MCAP log.
    """
    aside = file.with_name(file.name + INTERRUPTED)
    candidates = [run for run in map(_logged, (file, aside)) if run is not None]
    if not candidates:
        raise LgpError(f"{file}: there is no log of an interrupted run; run without --resume")
    run = max(candidates, key=lambda one: one.last)
    if run.over:
        raise LgpError(f"{file}: the run has ended; run without --resume to start again")
    os.replace(run.file, aside)
    return replace(run, file=aside)


def _logged(file: Path) -> LoggedRun | None:
    """Return the run that a log holds, None without a log or without a checkpoint in it."""
    if not file.is_file() or not file.stat().st_size:
        return None
    return read_logged_run(file)
