"""Reader of the log of a run, also of one that a crash cut short; checkpoints to resume from."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Final

from lgp.errors import LgpError
from lgp.execution.checkpoint import Checkpoint
from lgp.execution.events import LONGEST_RUN, Event
from lgp.execution.log import RunLog
from lgp.kinematics.world import World
from lgp.plan_record import Plan
from reba.files import from_json, lock_exclusively
from reba.open_file import open_regular
from reba.provenance import generator
from reba.readers.mcap.container import Container
from reba.toml_table import TomlTable

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
        digest: of the plan in force, see `Plan.digest`.
        state: the last checkpoint.
        last: time of the last message [s since the run began].
        writer: program and version that wrote the log.
    """

    epoch: float
    events: tuple[Event, ...]
    digest: str
    state: Checkpoint
    last: float
    file: Path
    writer: str

    def check(self, plan: Plan, world: World, simulated: bool) -> None:
        """Check that the run is one of a plan, which is in the folder of its log, in a simulated or a recorded world.

        Raises:
            LgpError: the plan in force was another one, or the last checkpoint is none of it or of the other world.
        """
        if self.digest != plan.digest:
            raise LgpError(f"{self.file}: the run of another plan; run without --resume to start with the one there")
        if plan.scene.objects and bool(self.state.objects) != simulated:
            how = "with --replay FILE" if simulated else "without --replay"
            raise LgpError(f"{self.file}: the run was {how}; resume it the same way")
        try:
            if not 0.0 <= self.last <= LONGEST_RUN:
                raise LgpError(f"its last message is {self.last:g} s after the run began")
            self.state.check(world, len(plan.actions))
        except LgpError as error:
            raise damaged(self.file, error) from error

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
    yield from _messages(_container(file))


def _container(file: Path) -> Container:
    return Container(file, check_crc=True, limit_bytes=LIMIT)


def _messages(container: Container) -> Iterator[LoggedMessage]:
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
        LgpError: an event or a checkpoint is not what a run writes.
        ReadError: the file is no MCAP log.
    """
    events: list[Event] = []
    digests: dict[str, str] = {}  # folder -> digest of its plan
    state: Checkpoint | None = None
    last = 0
    container = _container(file)
    for message in _messages(container):
        last = max(last, message.stamp)
        try:
            if message.topic == "/events":
                events.append(Event.read(from_json(message.data)))
            elif message.topic == "/state":
                state = Checkpoint.read(from_json(message.data))
            elif message.topic == "/plan":
                table = TomlTable("the plan", from_json(message.data))
                digests[table.text("folder")] = table.text("digest")
        except (ValueError, RecursionError) as error:
            raise damaged(file, error) from error
    if state is None:
        return None
    digest, (_, writer) = digests.get(state.folder, ""), container.header()
    return LoggedRun(state.epoch, tuple(events), digest, state, last / 1e9 - state.epoch, file, writer)


def damaged(file: Path, why: Exception) -> LgpError:
    """Return the error of a log that holds something else than a run writes."""
    return LgpError(f"{file}: is damaged ({why}); run without --resume to start again")


INTERRUPTED = ".interrupted"
"""Suffix of the name of an interrupted log while its messages are copied into the new one."""


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
        writer = run.writer or "an unknown program"
        raise LgpError(f"{file}: written by {writer}, this is {generator()}; run without --resume to start again")
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
    aside = file.with_name(file.name + INTERRUPTED)
    former = [aside, file]  # a restart that was killed leaves both
    if past is not None:
        os.replace(past.file, aside)
        past, former = replace(past, file=aside), [file]
    for log in filter(os.path.exists, former):
        numbered = (file.with_stem(f"{file.stem}-{number}") for number in itertools.count(1))
        os.replace(log, next(path for path in numbered if not path.exists()))
    return lock, past


def _logged(file: Path) -> LoggedRun | None:
    """Return the run that a log holds, None without a log or without a checkpoint in it."""
    if not file.is_file() or not file.stat().st_size:
        return None
    return read_logged_run(file)
