"""Recordings of any known format -> posture tables.

open_recording (formats, mcap) -> choose (recognise) -> collect (mapping) -> quality_control -> build_table
"""

from __future__ import annotations

from pathlib import Path

from reba.checks import PATH, POSITIVE, TEXT, YES_NO, accepts
from reba.errors import RebaError
from reba.file_stamp import unchanged
from reba.posture.table import PostureTable
from reba.readers import formats
from reba.readers.build_table import build_table
from reba.readers.formats import open_recording
from reba.readers.quality_control import parse_neutral
from reba.readers.recognise import choose
from reba.readers.recording.profile import PROFILE, Profile, find_profile, profiles
from reba.recording_folder import is_recording_folder

__all__ = ["is_recording", "is_recording_folder", "read"]


def is_recording(path: Path) -> bool:
    """Return whether a file is a recording of a known format, by its name and its first bytes."""
    return formats.is_recording(path)


@accepts(
    RebaError, path=PATH, profile=PROFILE, topic=TEXT.or_none(), neutral=TEXT, strict=YES_NO, rate=POSITIVE.or_none()
)
def read(
    path: str | Path,
    *,
    profile: str | Path | Profile = "auto",
    topic: str | None = None,
    neutral: str = "none",
    strict: bool = False,
    rate: float | None = None,
) -> PostureTable:
    """Read a recording of any known format into a posture table.

    Args:
        path: MCAP file, ROS bag (.bag, .db3) or rosbag2 folder, BVH, C3D, TRC, OpenSim .mot/.sto, MVNX, CSV (also of
            Vicon and OptiTrack Motive), Excel, Parquet, or SMPL poses in .npz; texts may be packed with gzip.
        profile: "auto", the name of a shipped profile (`reba profiles`), a TOML file, or what one of them was read as.
        topic: name of the stream, id of the body, or "<stream>#<id>", where a recording has several.
        neutral: posture to subtract as zero: "none", "first:3s" (median of the first 3 s) or "at:12.5" (around 12.5 s).
        rate: [Hz] of a table or of poses without times, which it numbers.
        strict: refuse a truncated recording, and one of which more than 1 % is lost, instead of reading the rest.

    Returns:
        The posture table: angles [deg] over time [s], with what was recognised, assumed and not measured.

    Raises:
        ReadError: the format is unknown, the file is damaged or has no posture, or it changed while it was read.
        ProfileError: no profile fits, two fit equally, or the recording has several bodies.
        RebaError: `neutral` is wrong.
    """
    parse_neutral(neutral)
    known = profiles() if str(profile) == "auto" else (find_profile(profile),)
    with unchanged(path):
        recording = open_recording(path, strict=strict, rate=rate)
        match = choose(recording, known, topic, named=str(profile) != "auto")
        return build_table(recording, match, neutral=neutral, strict=strict)
