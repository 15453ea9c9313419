"""Content of `reba info`: streams of a recording, what was recognised and why, and which angles it gives."""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from reba.checks import accepts
from reba.errors import ProfileError, RebaError
from reba.file_stamp import unchanged
from reba.posture.columns import COLUMNS
from reba.posture.table import PostureTable
from reba.readers import READING
from reba.readers.formats import Paths, files_given, open_recording, paths_text
from reba.readers.parts import table_of_match
from reba.readers.quality_control import parse_neutral
from reba.readers.recognise import Match, NotThere, choose, matches, presence
from reba.readers.recording.profile import Profile, find_profile, profiles
from reba.readers.recording.stream import JOINED, Recording, Stream

MOST_ALTERNATIVES = 5


@dataclass(frozen=True)
class StreamInfo:
    """One stream of a recording from which postures might be read.

    Attributes:
        name: topic, or the file's stem; `topic` of `reba.read` chooses it.
        kind: "joints", "frames", "points" or "angles".
        type: what was decoded.
        names: of joints, segments, points or columns.
        messages: of all names.
        seconds: from the first to the last message.
        rate: mean rate [Hz] of the name that has most messages while it is there, NaN for fewer than two.
        bodies: id -> intervals [s since the start of the recording] in which the body is there; `body` of `reba.read`
            chooses one.
        used: whether `reba.read` uses it, alone or beside the one that it reads.
    """

    name: str
    kind: str
    type: str
    names: tuple[str, ...] = ()
    messages: int = 0
    seconds: float = 0.0
    rate: float = float("nan")
    bodies: dict[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    used: bool = False


@dataclass(frozen=True)
class Info:
    """Summary of a recording.

    Attributes:
        input: path of the recording.
        format: name of the reader.
        topics: one dict per topic or signal group: name, type, count, usable, why.
        streams: what postures might be read from.
        profile: name of the profile, "table" for a posture table, "" if none was recognised; `title` describes it.
        recognised: why it was chosen, or why none was.
        usable: whether postures can be read.
        alternatives: other matches.
        topic: stream that is used.
        present: joints, segments or points of the profile that are recorded ("found" in JSON).
        missing: those that are not.
        frames, seconds: rows and duration [s] of the posture table.
        start: Unix time of time 0 [s], 0.0 if unknown.
        rate: median rate [Hz].
        gaps: (start, end) [s].
        messages, skipped, first_skipped, ended_abnormally, sha256: as in `Quality`.
        measured: angle columns with values.
        unmeasured: angle columns without values -> why.
        assumed: assumptions made while reading.
        accounts: as in `Quality`.
        ranges: measured column -> minimum, median, maximum [deg].
    """

    input: str
    format: str
    topics: tuple[dict[str, Any], ...] = ()
    streams: tuple[StreamInfo, ...] = ()
    profile: str = ""
    title: str = ""
    recognised: str = ""
    usable: bool = False
    alternatives: tuple[str, ...] = ()
    topic: str = ""
    present: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    frames: int = 0
    seconds: float = 0.0
    start: float = 0.0
    rate: float = float("nan")
    gaps: tuple[tuple[float, float], ...] = ()
    time_source: str = ""
    time_why: str = ""
    messages: int = 0
    skipped: int = 0
    first_skipped: str | None = None
    ended_abnormally: str | None = None
    sha256: str = ""
    measured: tuple[str, ...] = ()
    unmeasured: dict[str, str] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    accounts: tuple[dict[str, Any], ...] = ()
    ranges: dict[str, tuple[float, float, float]] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as JSON values; NaN becomes None."""
        result = {"found" if name == "present" else name: value for name, value in asdict(self).items()}
        for each in (result, *result["streams"]):
            each["rate"] = None if math.isnan(each["rate"]) else each["rate"]
        return result


@accepts(RebaError, **READING)
def info(
    path: Paths,
    *,
    profile: str | Path | Profile = "auto",
    start: float | None = None,
    end: float | None = None,
    topic: str | None = None,
    body: str | None = None,
    neutral: str = "none",
    strict: bool = False,
    rate: float | None = None,
) -> Info:
    """Return a summary of a recording; arguments as in `reba.read`.

    A recording in which no profile is recognised is not an error here: the summary has its topics and the reason.

    Raises:
        ReadError: the file is unknown, damaged or empty, or changed while it was read; no frame lies in the interval.
        ProfileError: the named profile does not exist or is wrong, or there is no such stream or body.
        RebaError: `neutral` is wrong.

    Example:
        >>> import tempfile
        >>> file = Path(tempfile.mkdtemp(), "shift.csv")
        >>> _ = file.write_text("time,trunk_flexion\\n0.0,20\\n0.5,40\\n1.0,30\\n")
        >>> [(each.name, each.kind, each.messages, each.rate, each.used) for each in info(file).streams]
        [('shift', 'angles', 3, 2.0, True)]
    """
    parse_neutral(neutral)
    named = str(profile) != "auto"
    known = (find_profile(profile),) if named else profiles()
    with ExitStack() as guard:
        for file in files_given(path):
            guard.enter_context(unchanged(file))
        recording = open_recording(path, strict=strict, rate=rate)
        result = Info(
            paths_text(path),
            recording.format,
            tuple(asdict(entry) for entry in recording.topics),
            tuple(_stream(stream, recording, known) for stream in recording.streams),
            warnings=tuple(recording.log.warnings),
        )
        try:
            match = choose(recording, known, topic, named=named, body=body)
            table = table_of_match(recording, match, start, end, neutral=neutral, strict=strict)
        except NotThere:
            raise
        except ProfileError as error:
            ended = recording.log.ended_abnormally
            others = _alternatives(recording, known, None)
            return replace(result, recognised=str(error), alternatives=others, ended_abnormally=ended)
        return _described(result, match, table, _alternatives(recording, known, match))


def _stream(stream: Stream, recording: Recording, known: tuple[Profile, ...]) -> StreamInfo:
    ends = [end for spans in stream.present.values() for span in spans for end in span]
    seconds = max(ends) - min(ends) if ends else 0.0
    most = max(stream.messages, key=stream.messages.__getitem__, default="")
    of_most = stream.messages.get(most, stream.count or 0)
    spans = stream.present.get(most) or ([(min(ends), max(ends))] if ends else [])
    there_for = sum(end - start for start, end in spans)
    there = {
        match.body: tuple(presence(match))
        for match in matches(recording, known)
        if match.stream is stream and match.fits and match.body
    }
    rate = (of_most - len(spans)) / there_for if there_for > 0 and of_most > len(spans) else float("nan")
    messages = stream.total or of_most
    return StreamInfo(stream.name, stream.kind, stream.format, stream.names, messages, seconds, rate, there)


def _described(start: Info, match: Match, table: PostureTable, alternatives: tuple[str, ...]) -> Info:
    time, quality = table.data["time"].to_numpy(np.float64), table.quality
    read = [account["stream"] for account in quality.accounts if account["used"]]
    used = {topic for name in read for topic in (name, *name.split(JOINED))}
    measured = tuple(column for column in COLUMNS if column not in table.unmeasured)
    return replace(
        start,
        streams=tuple(replace(each, used=each.name in used) for each in start.streams),
        profile=table.profile,
        title=match.profile.title if match.profile else "posture table",
        recognised=table.recognised,
        usable=True,
        alternatives=alternatives,
        topic=table.topic,
        present=tuple(match.names or match.columns),
        missing=match.missing,
        frames=len(time),
        seconds=float(time[-1] - time[0]),
        start=table.epoch,
        rate=quality.rate,
        gaps=quality.gaps,
        time_source=quality.time_source,
        time_why=quality.time_why,
        messages=quality.messages,
        skipped=quality.skipped,
        first_skipped=quality.first_skipped,
        ended_abnormally=quality.ended_abnormally,
        sha256=quality.sha256,
        measured=measured,
        unmeasured={column: table.why_unmeasured.get(column, "no value") for column in table.unmeasured},
        assumed=table.assumed,
        warnings=quality.warnings,
        accounts=quality.accounts,
        ranges={column: _range(table.data[column].to_numpy(np.float64)) for column in measured},
    )


def _range(values: np.ndarray) -> tuple[float, float, float]:
    return float(np.nanmin(values)), float(np.nanmedian(values)), float(np.nanmax(values))


def _alternatives(recording: Recording, known: tuple[Profile, ...], chosen: Match | None) -> tuple[str, ...]:
    """Return the other matches that fit, best first, as text."""
    fitting = [match for match in matches(recording, known) if match.fits]
    others = [match for match in fitting if chosen is None or match.why != chosen.why]
    return tuple(f"{match.why}: {len(match.columns)} columns" for match in others[:MOST_ALTERNATIVES])
