"""Reader of the log of a run, also of one that a crash cut short; checkpoints to resume from."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from lgp.errors import LgpError
from lgp.execution.events import Event
from lgp.execution.log import RunLog
from lgp.execution.simulation import Placement
from reba.arrays import Array
from reba.files import lock_exclusively
from reba.open_file import open_regular
from reba.provenance import generator
from reba.readers.mcap.container import Container

LOCK: Final = "_lock"
"""File of the folder of a plan that is locked while a run writes there."""
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
        writer: program and version that wrote the log.
    """

    epoch: float
    events: tuple[Event, ...]
    state: dict[str, Any]
    last: float
    file: Path
    writer: str

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
            events.append(Event(**{"action": None, **json.loads(message.data)}))
        elif message.topic == "/state":
            state = json.loads(message.data)
    if state is None:
        return None
    return LoggedRun(state["epoch"], tuple(events), state, last / 1e9 - state["epoch"], file, _writer(file))


def _writer(file: Path) -> str:
    """Return the program that wrote a log, from its header."""
    from mcap.records import Header
    from mcap.stream_reader import StreamReader

    with open_regular(file) as stream:
        header = next(StreamReader(stream).records)
    return header.library if isinstance(header, Header) else ""


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


def interrupted_run(file: Path) -> LoggedRun:
    """Return the run that was interrupted while it wrote a log; no file changes.

    Raises:
        LgpError: there is no log, its run has ended, or another version wrote it.
        ReadError: it is no MCAP log.
    """
    aside = file.with_name(file.name + INTERRUPTED)
    candidates = [run for run in map(_logged, (file, aside)) if run is not None]
    if not candidates:
        raise LgpError(f"{file}: there is no log of an interrupted run; run without --resume")
    run = max(candidates, key=lambda one: one.last)
    if run.over:
        raise LgpError(f"{file}: the run has ended; run without --resume to start again")
    if run.writer != generator():
        raise LgpError(f"{file}: written by {run.writer}, this is {generator()}; run without --resume to start again")
    return run


def claim(file: Path, past: LoggedRun | None) -> tuple[IO[bytes], LoggedRun | None]:
    """Lock the folder of a log for one run and rename its former log; none is overwritten.

    The log of the interrupted run `past` is put beside until its copy is complete; any other becomes run-1.mcap, or the
    next free number. The lock ends with the returned file, or with the process.

    Raises:
        LgpError: another run writes there, or the folder cannot be written.
    """
    try:
        lock = open_regular(file.parent / LOCK, append=True)
    except OSError as error:
        raise LgpError(f"{file.parent}: cannot be written ({error.strerror or error}); give another folder") from error
    if not lock_exclusively(lock.fileno()):
        lock.close()
        raise LgpError(f"{file.parent}: a run of this plan is in progress; wait until it ends, or copy the folder")
    if past is not None:
        aside = file.with_name(file.name + INTERRUPTED)
        os.replace(past.file, aside)
        past = replace(past, file=aside)
    if file.exists():
        numbered = (file.with_stem(f"{file.stem}-{number}") for number in itertools.count(1))
        os.replace(file, next(path for path in numbered if not path.exists()))
    return lock, past


def _logged(file: Path) -> LoggedRun | None:
    """Return the run that a log holds, None without a log or without a checkpoint in it."""
    if not file.is_file() or not file.stat().st_size:
        return None
    return read_logged_run(file)
