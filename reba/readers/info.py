"""Content of `reba info`: streams of a recording, what was recognised and why, and which angles it gives."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from reba.checks import PATH, POSITIVE, TEXT, YES_NO, accepts
from reba.errors import ProfileError, RebaError
from reba.file_stamp import unchanged
from reba.posture.columns import COLUMNS
from reba.posture.table import PostureTable
from reba.readers.build_table import build_table
from reba.readers.formats import open_recording
from reba.readers.quality_control import parse_neutral
from reba.readers.recognise import Match, choose, matches
from reba.readers.recording.profile import PROFILE, Profile, find_profile, profiles
from reba.readers.recording.stream import Recording

MOST_ALTERNATIVES = 5


@dataclass(frozen=True)
class Info:
    """Summary of a recording.

    Attributes:
        input: path of the recording.
        format: name of the reader.
        topics: one dict per topic or signal group: name, type, count, usable, why.
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
        result["rate"] = None if math.isnan(self.rate) else self.rate
        return result


@accepts(
    RebaError, path=PATH, profile=PROFILE, topic=TEXT.or_none(), neutral=TEXT, strict=YES_NO, rate=POSITIVE.or_none()
)
def info(
    path: str | Path,
    *,
    profile: str | Path | Profile = "auto",
    topic: str | None = None,
    neutral: str = "none",
    strict: bool = False,
    rate: float | None = None,
) -> Info:
    """Return a summary of a recording; arguments as in `reba.read`.

    A recording in which no profile is recognised is not an error here: the summary has its topics and the reason.

    Raises:
        ReadError: the file is unknown, damaged or empty, or changed while it was read.
        ProfileError: the named profile does not exist or is wrong.
        RebaError: `neutral` is wrong.
    """
    parse_neutral(neutral)
    named = str(profile) != "auto"
    known = (find_profile(profile),) if named else profiles()
    with unchanged(path):
        return _inspected(path, known, topic, neutral, named, strict, rate)


def _inspected(
    path: str | Path,
    known: tuple[Profile, ...],
    topic: str | None,
    neutral: str,
    named: bool,
    strict: bool,
    rate: float | None,
) -> Info:
    recording = open_recording(path, strict=strict, rate=rate)
    topics = tuple(asdict(entry) for entry in recording.topics)
    start = Info(str(path), recording.format, topics, warnings=tuple(recording.log.warnings))
    try:
        match = choose(recording, known, topic, named=named)
        table = build_table(recording, match, neutral=neutral, strict=strict)
    except ProfileError as error:
        ended = recording.log.ended_abnormally
        others = _alternatives(recording, known, None)
        return replace(start, recognised=str(error), alternatives=others, ended_abnormally=ended)
    return _described(start, match, table, _alternatives(recording, known, match))


def _described(start: Info, match: Match, table: PostureTable, alternatives: tuple[str, ...]) -> Info:
    time, quality = table.data["time"].to_numpy(np.float64), table.quality
    measured = tuple(column for column in COLUMNS if column not in table.unmeasured)
    return replace(
        start,
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
