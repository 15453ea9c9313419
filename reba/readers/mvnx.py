"""MVNX (Xsens/Movella MVN, XML, versions 3 and 4): segment poses, and the joint angles that MVN computed.

Frame of reference: x forward, y left, z up; quaternions w x y z from segment to world; joint angles in degrees, three
to a joint: x abduction or lateral bend, y axial rotation, z flexion (MVN User Manual, "MVNX file"). The frames of type
`identity`, `tpose` and `tpose-isb` are calibration poses, not samples.
"""

from __future__ import annotations

from pathlib import Path
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from reba.errors import ReadError
from reba.readers.memory import array_stream, check_time, unique_names
from reba.readers.mvnx_parse import ANGLES, Frame, Parser
from reba.readers.stream import ReadLog, Recording, Stream, Topic
from reba.readers.text import read_bytes

ERGONOMIC = (
    "T8_Head",
    "T8_LeftUpperArm",
    "T8_RightUpperArm",
    "Pelvis_T8",
    "Vertical_Pelvis",
    "Vertical_T8",
)
"""Order of `jointAngleErgo` where the file names none; older files have the first four."""

CHUNK = 1 << 20


def sniff(path: Path, head: bytes) -> bool:
    """Return whether the first bytes are XML with the element mvnx."""
    return b"<mvnx" in head or (path.suffix.lower() == ".mvnx" and head.removeprefix(b"\xef\xbb\xbf")[:1] == b"<")


def open_mvnx(path: Path) -> Recording:
    """Open an MVNX file: a stream `segments` of frames (z up, metres) and a stream `jointAngle` of joints [deg].

    Raises:
        ReadError: no XML, a document type definition, no segments, or no whole frame.
    """
    log = ReadLog(time_source="frame time")
    parser = _parse(path, log)
    if parser.bad_frames:
        log.skip(parser.bad_frames, parser.first_bad)
    if not parser.frames:
        why = f"; the first of {parser.bad_frames} unusable ones: {parser.first_bad}" if parser.bad_frames else ""
        raise ReadError(path, f"no whole frame of type normal{why}", hint="export the recording again")
    time, epoch = _times(path, parser, log)
    streams = [stream for stream in (_segments(parser, time, epoch, log), _joints(parser, time, epoch, log)) if stream]
    if not streams:
        raise ReadError(
            path,
            "its frames hold neither 'orientation' nor 'jointAngle'",
            hint="export from MVN with segment orientation, position and joint angles",
        )
    count = len(parser.frames)
    topics = [Topic(stream.name, "MVNX", count, True, f"{len(stream.names)} signals") for stream in streams]
    topics += [
        Topic(tag, "MVNX", seen, False, "not used for posture") for tag, seen in sorted(parser.other_tags.items())
    ]
    return Recording(str(path), "mvnx", tuple(streams), tuple(topics), log)


def _parse(path: Path, log: ReadLog) -> Parser:
    """Feed the file to the parser; what follows the first error of XML is given up."""
    data = read_bytes(path)
    parser = Parser(path)
    try:
        for start in range(0, len(data), CHUNK):
            parser.feed(data[start : start + CHUNK])
        parser.feed(b"", last=True)
    except expat.ExpatError as error:
        where = f"line {error.lineno}: {expat.ErrorString(error.code)}"
        if not parser.frames:
            raise ReadError(path, f"{where}; no whole frame before it", hint="export the recording again") from error
        log.ended_abnormally = f"{where}; the {len(parser.frames)} frames before it were read"
    return parser


def _times(path: Path, parser: Parser, log: ReadLog) -> tuple[NDArray[np.float64], float]:
    """Return the time of each frame [s] and the epoch [s], 0 if the file gives no date."""
    stated = np.array([frame.time for frame in parser.frames], dtype=np.float64)
    first = parser.frames[0]
    if np.isnan(stated).any():
        if not 0 < parser.rate < 1e5:
            raise ReadError(path, "frames without 'time' and no 'frameRate'", hint="export the recording again")
        log.time_source = "frame rate"
        log.warn(f"frames lack their time; it was counted from frameRate {parser.rate:g} Hz")
        return np.arange(len(stated)) / parser.rate, 0.0
    time = stated / 1000.0
    check_time(time, log)
    return time, first.epoch / 1000.0 - float(time[0]) if first.epoch > 0 else 0.0


def _segments(parser: Parser, time: NDArray[np.float64], epoch: float, log: ReadLog) -> Stream | None:
    """Return the stream of segment poses, None if no frame has an orientation."""
    if not any("orientation" in frame.values for frame in parser.frames):
        return None
    names = unique_names(parser.segments, log)
    poses = np.stack([_pose(frame, len(names)) for frame in parser.frames])
    rest = _pose(parser.identity, len(names)) if parser.identity and "orientation" in parser.identity.values else None
    return array_stream(
        "segments",
        "frames",
        f"MVNX {parser.version} segments",
        names,
        time,
        poses,
        opened=log,
        parents=("",) * len(names),
        epoch=epoch,
        up="z",
        rest=rest,
    )


def _pose(frame: Frame, count: int) -> NDArray[np.float64]:
    """Return (k, 7) x y z qx qy qz qw of a frame, NaN for what it lacks."""
    pose = np.full((count, 7), np.nan)
    if "position" in frame.values:
        pose[:, :3] = frame.values["position"].reshape(count, 3)
    if "orientation" in frame.values:
        turn = frame.values["orientation"].reshape(count, 4)
        norm = np.linalg.norm(turn, axis=1, keepdims=True)
        # A quaternion that is far from unit length is no orientation.
        pose[:, 3:] = np.where(np.abs(norm - 1) < 0.1, turn / np.where(norm > 0, norm, 1), np.nan)[:, [1, 2, 3, 0]]
    return pose


def _joints(parser: Parser, time: NDArray[np.float64], epoch: float, log: ReadLog) -> Stream | None:
    """Return the stream of joint angles `<joint>_x|y|z`, None if no frame has any."""
    names: list[str] = []
    columns: list[NDArray[np.float64]] = []
    for tag in ANGLES:
        width = max((len(frame.values[tag]) for frame in parser.frames if tag in frame.values), default=0)
        if not width:
            continue
        labels = list(parser.joints if tag == "jointAngle" else parser.ergonomic)
        if 3 * len(labels) != width:
            known = ERGONOMIC if tag == "jointAngleErgo" else ()
            labels = list(known[: width // 3]) if width // 3 <= len(known) else []
        if 3 * len(labels) != width:
            log.warn(f"{tag} has {width // 3} joints whose names are unknown; it was left out")
            continue
        names += [f"{label}_{axis}" for label in labels for axis in "xyz"]
        blank = np.full(width, np.nan)
        rows = [frame.values.get(tag, blank) for frame in parser.frames]
        columns.append(np.stack([row if len(row) == width else blank for row in rows]))
    if not columns:
        return None
    return array_stream(
        "jointAngle",
        "joints",
        f"MVNX {parser.version} joint angles",
        unique_names(names, log),
        time,
        np.concatenate(columns, axis=1),
        opened=log,
        unit="deg",
        epoch=epoch,
        up="z",
    )
