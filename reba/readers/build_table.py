"""Chosen stream -> posture table: mapped, quality controlled, with all assumptions and warnings for the user."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from reba.arrays import Array, Flags
from reba.checks import is_number
from reba.errors import ProfileError, RadiansWarning, ReadError, warn_user
from reba.posture.columns import COLUMNS, INDEX
from reba.posture.named_angles import RADIANS_TEXT, look_like_radians
from reba.posture.table import PostureTable, Quality
from reba.readers.accounts import account_warnings, accounts_of, refuse_losses
from reba.readers.column_statistics import ColumnStatistics
from reba.readers.formats import file_hash
from reba.readers.formats.score_file import is_score_table
from reba.readers.mapping import collect_into, mapper_for
from reba.readers.mapping.frame_table import (
    ROWS,
    Disorder,
    FileFrames,
    Frames,
    MemoryFrames,
    angles_column,
    blocks,
    sorted_by_time,
)
from reba.readers.mapping.gap_codes import GapCodes
from reba.readers.mapping.reference_frames import PelvisPose, read_pelvis_pose
from reba.readers.mapping.segments import AXES
from reba.readers.quality_control import (
    apply_neutral,
    beyond_limits,
    corrections_of,
    equal_frames,
    find_gaps,
    first_frame_is_outlier,
    frozen_warning,
    intermittent_columns,
    median_rate,
    neutral_posture,
    straight_at_180,
    subtract,
)
from reba.readers.recognise import Match
from reba.readers.recording.profile import Profile
from reba.readers.recording.stream import LOST_HINT, MESSAGES, Block, ReadLog, Recording, Stream
from reba.readers.signal_names import bodies


@dataclass(frozen=True)
class Reading:
    """A recording that was read, before its frames become a table.

    Attributes:
        whole: the posture table of all frames, without `data`.
        time: (n,) [s].
        data: returns frames from one position to another as `PostureTable.data`.
        column: returns a column of (n,) values by name.
        times: of the messages that were used [s], if they were asked for.
        pelvis: times [s] of the pelvis from another stream, empty without one.
    """

    whole: PostureTable
    time: Array
    data: Callable[[int, int], pd.DataFrame]
    column: Callable[[str], Array]
    times: Sequence[Array] = ()
    pelvis: Array = field(default_factory=lambda: np.zeros(0))

    def table(self) -> PostureTable:
        """Return the posture table of all frames."""
        return replace(self.whole, data=self.data(0, len(self.time)))


def build_table(recording: Recording, match: Match, *, neutral: str = "none", strict: bool = False) -> PostureTable:
    """Read the chosen stream of a recording into a posture table; `neutral` and `strict` as in `reba.read`.

    Raises:
        ReadError: no sample can be used, or `strict` and the recording is truncated.
        ProfileError: no angle was measured.
        RebaError: `neutral` is wrong or has no frame.
    """
    return read_match(recording, match, neutral, strict).table()


def read_in_parts(
    recording: Recording, match: Match, *, neutral: str = "none", strict: bool = False, times: bool = True
) -> Reading:
    """Read like `build_table`, with frames in a temporary file, so that memory does not grow with them.

    Frames that have to be sorted, and posture tables, are in memory.

    Args:
        times: keep the times of the messages, which the accounts of an interval need.
    """
    try:
        return read_match(recording, match, neutral, strict, FileFrames(recording.path), [] if times else None)
    except Disorder:
        return read_match(recording, match, neutral, strict, MemoryFrames(), [] if times else None)


def read_match(
    recording: Recording,
    match: Match,
    neutral: str,
    strict: bool,
    frames: Frames | None = None,
    times: list[Array] | None = None,
) -> Reading:
    """Read the chosen stream of a recording into `frames` (in memory by default); `times` as in `collect_into`."""
    profile = match.profile
    if profile is None or match.names is None:
        return _read_angles(recording, match, neutral, strict)
    frames = MemoryFrames() if frames is None else frames
    pelvis = _pelvis_pose(recording, match, profile)
    mapper = mapper_for(profile, match.names, match.stream, pelvis)
    log = collect_into(frames, match.stream, mapper, times)
    _check_samples(recording, log, len(frames), strict)
    start = float(frames.rows(0, 1)[0, 0]) if recording.format in MESSAGES else 0.0
    frames.change(partial(_shift, start))
    posed = match.stream.rest is not None or recording.format == "mvnx"
    if posed and first_frame_is_outlier(frames.rows(0, FIRST_FRAMES)[:, 1:]):
        log.unused["first_frame"] += 1
        log.warn("the first frame is an outlier (T-pose or zeros) and was left out")
        frames.drop_first()
    time = frames.column(0)
    seen = _statistics(frames)
    corrections = corrections_of(seen, float(time[-1] - time[0]), mapper, profile, match.stream.kind, neutral)
    frames.change(lambda rows: corrections.apply(rows[:, 1:]))
    reasons = corrections.reasons
    unmeasured = [column for column in COLUMNS if column in reasons]
    if len(unmeasured) == len(COLUMNS):
        why = "; ".join(dict.fromkeys(reasons.values())) or "no sample has a complete segment"
        raise ProfileError(f"{recording.path}: {match.why}, but no angle was measured: {why}; record it again")
    offsets, note = neutral_posture(time, partial(_chosen, frames), neutral)
    if offsets:
        frames.change(lambda rows: subtract(rows[:, 1:], offsets))
    seen = _statistics(frames) if offsets else seen.turned(corrections.turned).without(corrections.hidden)
    beside = pelvis.log.warnings if pelvis is not None else []
    warnings = [*beside, *mapper.warnings, *_column_warnings(seen)]
    assumed = [text for text in (match.note, *mapper.assumed, note) if text]
    whole = PostureTable(
        data=pd.DataFrame(columns=["time", *COLUMNS]),
        profile=profile.name,
        source=recording.path,
        topic=match.stream.name,
        unmeasured=tuple(unmeasured),
        why_unmeasured={column: reasons[column] for column in unmeasured},
        assumed=tuple(dict.fromkeys(assumed)),
        recognised=_recognised(match, reasons, unmeasured),
        quality=_quality(
            recording,
            match,
            start,
            log,
            time,
            frames,
            warnings,
            strict,
            pelvis,
            radians=getattr(mapper, "radians", False),
        ),
        epoch=match.stream.epoch + start,
        signals=tuple(mapper.wanted),
        files=recording.files,
        people=_people(recording, match),
    )
    since = [each - start for each in times or ()]
    unix = np.zeros(0) if pelvis is None else pelvis.time
    return Reading(
        whole, time, partial(_frame, frames), partial(angles_column, frames), since, unix - match.stream.epoch - start
    )


FIRST_FRAMES = 12
"""Frames that show whether the first is an outlier."""


def _shift(start: float, rows: Array) -> None:
    rows[:, 0] -= start


def _statistics(frames: Frames) -> ColumnStatistics:
    seen = ColumnStatistics()
    for rows in blocks(frames):
        seen.add(rows[:, 1:])
    return seen


def _chosen(frames: Frames, chosen: Flags) -> Array:
    """Return the angles (k, 22) of chosen frames."""
    first, last = np.flatnonzero(chosen)[[0, -1]]
    return frames.rows(int(first), int(last) + 1)[chosen[first : last + 1], 1:]


def _frame(frames: Frames, start: int, stop: int) -> pd.DataFrame:
    return pd.DataFrame(frames.rows(start, stop), columns=["time", *COLUMNS], copy=False)


def _read_angles(recording: Recording, match: Match, neutral: str, strict: bool) -> Reading:
    """Return the posture table that a recording already is, absent columns added as NaN."""
    log = ReadLog()
    table = _table(match, log)
    _check_samples(recording, log, len(table), strict)
    rows = np.column_stack([table["time"].to_numpy(np.float64), np.arange(len(table), dtype=np.float64)])
    ordered = table.iloc[sorted_by_time(rows, log)[:, 1].astype(int)].reset_index(drop=True)
    angles = ordered.reindex(columns=list(COLUMNS)).to_numpy(np.float64, copy=True)
    time = ordered["time"].to_numpy(np.float64)
    gaps = GapCodes("angles")
    angles = gaps.without(Block(time, COLUMNS, angles)).values
    gaps.note(log)
    note = apply_neutral(time, angles, neutral)
    others = [column for column in ordered.columns if column not in INDEX and column != "time"]
    data = pd.concat([ordered[["time"]], pd.DataFrame(angles, columns=list(COLUMNS)), ordered[others]], axis=1)
    frames = MemoryFrames.of(np.column_stack([time, angles]))
    seen = _statistics(frames)
    unmeasured = seen.empty_columns()
    absent = {column: "no such column" for column in unmeasured if column not in ordered.columns}
    scored = recording.scored if is_score_table(map(str, ordered.columns)) else None
    whole = PostureTable(
        data=data.iloc[:0],
        profile="table",
        source=recording.path,
        topic=match.stream.name,
        unmeasured=tuple(unmeasured),
        why_unmeasured={column: absent.get(column, "no value") for column in unmeasured},
        assumed=tuple(text for text in (match.note, note) if text),
        recognised=match.why,
        quality=_quality(recording, match, 0.0, log, time, frames, _column_warnings(seen), strict),
        epoch=match.stream.epoch,
        files=recording.files,
        people=_people(recording, match),
        scored=scored,
    )
    if scored is not None:
        whole = _as_recorded(whole, scored)
    return Reading(
        whole,
        time,
        lambda start, stop: data.iloc[start:stop].reset_index(drop=True) if (start, stop) != (0, len(data)) else data,
        lambda name: data[name].to_numpy(),
    )


def _as_recorded(whole: PostureTable, scored: Mapping[str, Any]) -> PostureTable:
    """Return the table of a file of scores with what it says of the recording: profile, assumptions, restarts."""
    quality = scored.get("quality")
    seams = quality.get("seams") if isinstance(quality, dict) else None
    inside = [seam for seam in seams if is_number(seam)] if isinstance(seams, list) else []
    assumed = scored.get("assumed")
    texts = [text for text in assumed if isinstance(text, str)] if isinstance(assumed, list) else []
    people = scored.get("people")
    why = scored.get("why_unmeasured")
    reasons = {column: str(why[column]) for column in whole.unmeasured if isinstance(why, dict) and column in why}
    return replace(
        whole,
        profile=scored["profile"] if isinstance(scored.get("profile"), str) else whole.profile,
        assumed=(*whole.assumed, *texts),
        why_unmeasured=whole.why_unmeasured | reasons,
        people=tuple(name for name in people if isinstance(name, str)) if isinstance(people, list) else whole.people,
        epoch=float(scored["epoch"]) if is_number(scored.get("epoch")) else whole.epoch,
        quality=replace(whole.quality, seams=tuple(map(float, inside))),
    )


def _people(recording: Recording, match: Match) -> tuple[str, ...]:
    """Return the names of bodies, subjects and streams, which pages leave out."""
    ids = {} if match.profile is None else bodies(match.profile, match.stream)
    streams = [stream.name for stream in recording.streams]
    return tuple(dict.fromkeys(name for name in (match.body, *match.ids, *ids, *streams) if name))


def _table(match: Match, log: ReadLog) -> pd.DataFrame:
    """Return the complete table of a stream of angles; its blocks are read for the notes of the reader."""
    blocks = list(match.stream.blocks(log))
    if match.stream.table is not None:
        return match.stream.table()
    parts = [pd.DataFrame(block.values, columns=list(block.names)).assign(time=block.time) for block in blocks]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame({"time": []})


def _pelvis_pose(recording: Recording, match: Match, profile: Profile) -> PelvisPose | None:
    """Return the pose of the pelvis from a stream of frames of the same recording, None without one."""
    return read_pelvis_pose(profile, pelvis_streams(recording, match, profile), AXES[profile.root_axes])


def pelvis_streams(recording: Recording, match: Match, profile: Profile) -> list[tuple[Stream, str]]:
    """Return the streams of frames that have the pelvis of a joints profile, and its name in each.

    The frames of a body that had several ids have the name of the first.
    """
    if profile.kind != "joints":
        return []
    ids = match.ids or (match.body,)
    result = []
    for stream in (stream for stream in recording.streams if stream.kind == "frames"):
        for root in profile.root:
            names = dict.fromkeys(root.replace("{id}", body) for body in ids if body or "{id}" not in root)
            first, *others = [name for name in names if name in stream.names] or [""]
            if others and stream.join is not None:
                result.append((stream.join(dict.fromkeys(others, first), ()), first))
            elif first:
                result.append((stream, first))
    return result


def _check_samples(recording: Recording, log: ReadLog, frames: int, strict: bool) -> None:
    ended = log.ended_abnormally or recording.log.ended_abnormally
    if strict and ended:
        raise ReadError(recording.path, ended, hint="read it without strict to use the samples before")
    if strict and recording.log.lost:
        raise ReadError(recording.path, recording.log.lost, hint=LOST_HINT)
    if not frames:
        first = f": {log.first_skipped}" if log.first_skipped else ""
        raise ReadError(recording.path, f"no sample can be used{first}", hint="see `reba info`")


def _column_warnings(seen: ColumnStatistics) -> list[str]:
    beyond = [f"{column}: {text}" for column, text in beyond_limits(seen).items()]
    return [*beyond, *straight_at_180(seen), *intermittent_columns(seen)]


def _equal(frames: Frames) -> Flags:
    """Return (n - 1,) whether a frame is exactly the one before."""
    return np.concatenate(
        [equal_frames(frames.rows(max(at - 1, 0), at + ROWS)[:, 1:]) for at in range(0, len(frames), ROWS)]
    )


def _recognised(match: Match, reasons: dict[str, str], unmeasured: Iterable[str]) -> str:
    """Return why the profile was chosen and which columns constant signals leave unmeasured, as one line."""
    constant: dict[str, list[str]] = {}
    for column in unmeasured:
        if "constant" in reasons.get(column, ""):
            constant.setdefault(reasons[column], []).append(column)
    parts = [f"{reason} -> {', '.join(columns)} not measured" for reason, columns in constant.items()]
    return "; ".join([match.why, *parts])


def _quality(
    recording: Recording,
    match: Match,
    start: float,
    log: ReadLog,
    time: Array,
    frames: Frames,
    warnings: list[str],
    strict: bool,
    pelvis: PelvisPose | None = None,
    *,
    radians: bool = False,
) -> Quality:
    beside = {} if pelvis is None else {pelvis.stream: pelvis.log}
    accounts = accounts_of(recording, match, log, float(time[-1] - time[0]), beside)
    if strict:
        for account in accounts:
            if account is accounts[0] or account["stream"] in match.stream.static:
                refuse_losses(recording.path, account, match.stream.static.get(account["stream"], log))
    warnings = [*warnings, *account_warnings(accounts[0])]
    frozen = frozen_warning(time, _equal(frames))
    if radians or look_like_radians((rows[:, 1:] for rows in blocks(frames)), len(frames)):
        if strict:
            raise ReadError(recording.path, RADIANS_TEXT, hint="read it without strict to use them as they are")
        warnings = [*warnings, RADIANS_TEXT]
        warn_user(f"{recording.path}: {RADIANS_TEXT}", RadiansWarning)
    seams = tuple(seam - start for seam in match.stream.seams if time[0] < seam - start <= time[-1])
    if seams:
        times = ", ".join(f"{seam:.2f} s" for seam in seams[:3]) + (" ..." if len(seams) > 3 else "")
        warnings = [*warnings, f"the clock restarts at {times}; frames are in the order in which they were recorded"]
    texts = [*recording.log.warnings, *log.warnings, *warnings, *([frozen] if frozen else [])]
    return Quality(
        messages=log.messages,
        skipped=log.skipped,
        first_skipped=log.first_skipped,
        ended_abnormally=log.ended_abnormally or recording.log.ended_abnormally,
        time_source=log.time_source or recording.log.time_source,
        time_why=log.time_why,
        rate=median_rate(time),
        gaps=find_gaps(time),
        seams=seams,
        warnings=tuple(dict.fromkeys(texts)),
        sha256="" if recording.files else file_hash(recording.path),
        accounts=accounts,
    )
