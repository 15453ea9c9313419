"""Recordings of any known format -> posture tables.

open_recording (formats, mcap) -> choose (recognise) -> collect (mapping) -> quality_control -> build_table -> parts
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from reba.checks import MOMENT, PATHS, POSITIVE, TEXT, YES_NO, Allowed, accepts, is_number
from reba.errors import RebaError
from reba.file_stamp import unchanged
from reba.posture.table import PostureTable
from reba.readers import formats
from reba.readers.build_table import Reading, read_in_parts
from reba.readers.formats import Paths, files_given, open_recording
from reba.readers.parts import block_tables, table_of_match
from reba.readers.quality_control import parse_neutral
from reba.readers.recognise import Match, choose
from reba.readers.recording.profile import PROFILE, Profile, find_profile, profiles
from reba.readers.recording.stream import Recording
from reba.recording_folder import is_recording_folder

__all__ = ["is_recording", "is_recording_folder", "read", "read_blocks"]

BLOCK_SECONDS = Allowed("seconds from 0.001 to 1e9", lambda value: is_number(value) and 0.001 <= value <= 1_000_000_000)
"""Length of a block."""
READING: Final[dict[str, Allowed]] = {
    "path": PATHS,
    "profile": PROFILE,
    "start": MOMENT.or_none(),
    "end": MOMENT.or_none(),
    "topic": TEXT.or_none(),
    "body": TEXT.or_none(),
    "neutral": TEXT,
    "strict": YES_NO,
    "rate": POSITIVE.or_none(),
}
"""What the arguments of functions that read a recording may be."""


def is_recording(path: Path) -> bool:
    """Return whether a file is a recording of a known format, by its name and its first bytes."""
    return formats.is_recording(path)


def may_be_recording(path: Path) -> bool:
    """Return whether a file has a name as recordings have, tables and workbooks included."""
    return formats.may_be_recording(path)


@accepts(RebaError, **READING)
def read(
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
) -> PostureTable:
    """Read a recording of any known format into a posture table.

    Args:
        path: MCAP file, ROS bag (.bag, .db3) or rosbag2 folder, BVH, C3D, TRC, OpenSim .mot/.sto, MVNX, CSV (also of
            Vicon and OptiTrack Motive), Excel, Parquet, or SMPL poses in .npz; texts may be packed with gzip, and `~`
            is the home folder. A list has the files of one recording of messages that was split, in any order;
            several recordings are read one by one.
        profile: "auto", the name of a shipped profile (`reba profiles`), a TOML file, or what one of them was read as.
        start, end: [s] of the `time` column: only frames from `start` to `end`, both included. All of the recording
            still decides about names, clock, units, signs and the neutral posture, so the frames are those that the
            complete table has at these times.
        topic: name of the stream, id of the body, or "<stream>#<id>", where a recording has several.
        body: id of the body, where a stream has several.
        neutral: posture to subtract as zero: "none", "first:3s" (median of the first 3 s) or "at:12.5" (around 12.5 s).
        rate: [Hz] of a table or of poses without times, which it numbers.
        strict: refuse a truncated recording, and one of which more than 1 % is lost, instead of reading the rest.

    Returns:
        The posture table: angles [deg] over time [s], with what was recognised, assumed and not measured.

    Raises:
        ReadError: the format is unknown, the file is damaged or has no posture, no frame lies in the interval, or the
            file changed while it was read.
        ProfileError: no profile fits, two fit equally, or the recording has several bodies.
        RebaError: `neutral` is wrong.
    """
    parse_neutral(neutral)
    with ExitStack() as guard:
        recording, match = _opened(guard, path, profile, topic, body, strict, rate)
        return table_of_match(recording, match, start, end, neutral=neutral, strict=strict)


@accepts(RebaError, seconds=BLOCK_SECONDS, **READING)
def read_blocks(
    path: Paths,
    *,
    seconds: float = 60.0,
    profile: str | Path | Profile = "auto",
    start: float | None = None,
    end: float | None = None,
    topic: str | None = None,
    body: str | None = None,
    neutral: str = "none",
    strict: bool = False,
    rate: float | None = None,
) -> Iterator[PostureTable]:
    """Read a recording block by block, so that a long one needs little memory.

    The recording is read completely before the first block, with its frames in a temporary file, because all of it
    decides. The blocks together are `reba.read` of the recording, and their scores are its scores: `reba.score` of a
    block detects the activity in the complete movement. Of each block `quality` is that of the recording, apart from
    gaps and restarts of the clock. Posture tables (CSV, Parquet) are in memory as a whole.

    Args:
        seconds: length of a block.
        path, profile, start, end, topic, body, neutral, strict, rate: as in `reba.read`.

    Raises:
        RebaError: as in `reba.read`, before the first block.

    Example:
        >>> import tempfile
        >>> file = Path(tempfile.mkdtemp(), "shift.csv")
        >>> _ = file.write_text("time,trunk_flexion\\n" + "".join(f"{at},{at % 60}\\n" for at in range(150)))
        >>> [len(block.data) for block in read_blocks(file, seconds=60)]
        [60, 60, 30]
    """
    parse_neutral(neutral)
    with ExitStack() as guard:
        recording, match = _opened(guard, path, profile, topic, body, strict, rate)
        part = start is not None or end is not None
        reading: Reading = read_in_parts(recording, match, neutral=neutral, strict=strict, times=part)
    return block_tables(reading, start, end, float(seconds))


def _opened(
    guard: ExitStack,
    path: Paths,
    profile: str | Path | Profile,
    topic: str | None,
    body: str | None,
    strict: bool,
    rate: float | None,
) -> tuple[Recording, Match]:
    """Open a recording, guarded against changes, and choose what is read of it."""
    named = str(profile) != "auto"
    known = (find_profile(profile),) if named else profiles()
    for file in files_given(path):
        guard.enter_context(unchanged(file))
    recording = open_recording(path, strict=strict, rate=rate)
    return recording, choose(recording, known, topic, named=named, body=body)
