"""Chosen stream -> posture table: mapped, quality controlled, with all assumptions and warnings for the user."""

from __future__ import annotations

from collections.abc import Iterable
from warnings import warn

import numpy as np
import pandas as pd

from reba.arrays import Array
from reba.errors import ProfileError, RadiansWarning, ReadError
from reba.posture.columns import COLUMNS, INDEX
from reba.posture.named_angles import RADIANS_TEXT, look_like_radians
from reba.posture.table import PostureTable, Quality
from reba.readers.accounts import account_warnings, accounts_of, refuse_losses
from reba.readers.formats import file_hash
from reba.readers.mapping import collect, mapper_for, sorted_by_time
from reba.readers.mapping.gap_codes import GapCodes
from reba.readers.mapping.reference_frames import PelvisPose, read_pelvis_pose
from reba.readers.mapping.segments import AXES
from reba.readers.quality_control import (
    apply_neutral,
    beyond_limits,
    empty_columns,
    find_gaps,
    first_frame_is_outlier,
    frozen_warning,
    intermittent_columns,
    median_rate,
    quality_control,
)
from reba.readers.recognise import Match
from reba.readers.recording.profile import Profile
from reba.readers.recording.stream import LOST_HINT, MESSAGES, Block, ReadLog, Recording, Stream


def build_table(recording: Recording, match: Match, *, neutral: str = "none", strict: bool = False) -> PostureTable:
    """Read the chosen stream of a recording into a posture table; `neutral` and `strict` as in `reba.read`.

    Raises:
        ReadError: no sample can be used, or `strict` and the recording is truncated.
        ProfileError: no angle was measured.
        RebaError: `neutral` is wrong or has no frame.
    """
    profile = match.profile
    if profile is None or match.names is None:
        return _ready_table(recording, match, neutral, strict)
    pelvis = _pelvis_pose(recording, match, profile)
    helpers = tuple(stream for stream, _ in pelvis_streams(recording, match, profile)) if pelvis is not None else ()
    mapper = mapper_for(profile, match.names, match.stream, pelvis)
    samples = collect(match.stream, mapper)
    start = samples.from_zero() if recording.format in MESSAGES else 0.0
    _check_samples(recording, samples.log, len(samples.table), strict)
    posed = match.stream.rest is not None or recording.format == "mvnx"
    if posed and first_frame_is_outlier(samples.angles):
        samples.log.unused["first_frame"] += 1
        samples.log.warn("the first frame is an outlier (T-pose or zeros) and was left out")
        samples.table = samples.table[1:]
    reasons = quality_control(samples, mapper, profile, match.stream.kind, neutral).reasons
    unmeasured = empty_columns(samples.angles)
    if len(unmeasured) == len(COLUMNS):
        why = "; ".join(dict.fromkeys(reasons.values())) or "no sample has a complete segment"
        raise ProfileError(f"{recording.path}: {match.why}, but no angle was measured: {why}; record it again")
    note = apply_neutral(samples.time, samples.angles, neutral)
    warnings = [*mapper.warnings, *_column_warnings(samples.angles)]
    assumed = [text for text in (match.note, *mapper.assumed, note) if text]
    data = pd.DataFrame(samples.table, columns=["time", *COLUMNS], copy=False)
    return PostureTable(
        data=data,
        profile=profile.name,
        source=recording.path,
        topic=match.stream.name,
        unmeasured=tuple(unmeasured),
        why_unmeasured={column: reasons[column] for column in unmeasured if column in reasons},
        assumed=tuple(dict.fromkeys(assumed)),
        recognised=_recognised(match, reasons, unmeasured),
        quality=_quality(recording, match, start, samples.log, samples.time, samples.angles, warnings, strict, helpers),
        epoch=match.stream.epoch + start,
        signals=tuple(mapper.wanted),
    )


def _ready_table(recording: Recording, match: Match, neutral: str, strict: bool) -> PostureTable:
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
    unmeasured = empty_columns(angles)
    absent = {column: "no such column" for column in unmeasured if column not in ordered.columns}
    return PostureTable(
        data=data,
        profile="table",
        source=recording.path,
        topic=match.stream.name,
        unmeasured=tuple(unmeasured),
        why_unmeasured={column: absent.get(column, "no value") for column in unmeasured},
        assumed=(note,) if note else (),
        recognised=match.why,
        quality=_quality(recording, match, 0.0, log, time, angles, _column_warnings(angles), strict),
        epoch=match.stream.epoch,
    )


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
                result.append((stream.join(dict.fromkeys(others, first)), first))
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


def _column_warnings(angles: Array) -> list[str]:
    return [f"{column}: {text}" for column, text in beyond_limits(angles).items()] + intermittent_columns(angles)


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
    angles: Array,
    warnings: list[str],
    strict: bool,
    helpers: tuple[Stream, ...] = (),
) -> Quality:
    accounts = accounts_of(recording, match, log, float(time[-1] - time[0]), helpers)
    if strict:
        refuse_losses(recording.path, accounts[0], log)
    warnings = [*warnings, *account_warnings(accounts[0])]
    frozen = frozen_warning(time, angles)
    if look_like_radians(angles):
        if strict:
            raise ReadError(recording.path, RADIANS_TEXT, hint="read it without strict to use them as they are")
        warnings = [*warnings, RADIANS_TEXT]
        warn(f"{recording.path}: {RADIANS_TEXT}", RadiansWarning, stacklevel=4)
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
        sha256=file_hash(recording.path),
        accounts=accounts,
    )
