"""MVNX (Xsens/Movella MVN, XML, versions 3 and 4): segment poses, and the joint angles that MVN computed.

Frame of reference: x forward, y left, z up; quaternions w x y z from segment to world; joint angles in degrees, three
to a joint: x abduction or lateral bend, y axial rotation, z flexion (MVN User Manual, "MVNX file"). The frames of type
`identity`, `tpose` and `tpose-isb` are calibration poses, not samples.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final
from xml.parsers import expat

import numpy as np

from reba.arrays import Array
from reba.errors import ReadError
from reba.readers.formats.file_content import file_bytes
from reba.readers.formats.text import LARGEST
from reba.readers.recording.stream import (
    ReadLog,
    Recording,
    Stream,
    Topic,
    array_stream,
    clip,
    unique_names,
)

ERGONOMIC = (
    "T8_Head",
    "T8_LeftUpperArm",
    "T8_RightUpperArm",
    "Pelvis_T8",
    "Vertical_Pelvis",
    "Vertical_T8",
)
"""Order of the joints of `jointAngleErgo` where the file does not name them; older files have the first four."""
CHUNK = 1 << 20


def sniff(path: Path, head: bytes) -> bool:
    """Return whether the first bytes are XML with the element mvnx."""
    return b"<mvnx" in head or (path.suffix.lower() == ".mvnx" and head[:1] == b"<")


def open_mvnx(path: Path) -> Recording:
    """Open an MVNX file: of each subject a stream `segments` (z up, metres) and a stream `jointAngle` of joints [deg].

    Where the file has several subjects, the label of the subject stands before the name of a stream.
    """
    opened = ReadLog()
    parser = _parse(path, opened)
    subjects = [subject for subject in parser.subjects if subject.frames]
    for subject in parser.subjects:
        if not subject.frames and subject.bad_frames:
            opened.skip(subject.bad_frames, subject.first_bad)
    streams: list[Stream] = []
    topics: list[Topic] = []
    labels = unique_names([subject.label for subject in subjects], opened)
    log = opened
    for subject, label in zip(subjects, labels, strict=True):
        log = opened if len(subjects) == 1 else ReadLog()
        log.time_source = "frame time"
        if subject.bad_frames:
            log.skip(subject.bad_frames, subject.first_bad)
        time, epoch = _times(path, subject, log)
        before = f"{label}/" if len(subjects) > 1 else ""
        of_subject = [
            make(subject, f"{before}{name}", parser.version, time, epoch, log)
            for name, make in (("segments", _segments), ("jointAngle", _joints))
        ]
        streams += [stream for stream in of_subject if stream is not None]
        topics += [
            Topic(stream.name, "MVNX", len(time), True, f"{len(stream.names)} signals")
            for stream in of_subject
            if stream
        ]
    if not subjects:
        bad, first = max((subject.bad_frames, subject.first_bad) for subject in parser.subjects)
        why = f"; the first of {bad} unusable ones: {first}" if bad else ""
        raise ReadError(path, f"no complete frame of type normal{why}", hint="export the recording again")
    if not streams:
        raise ReadError(
            path,
            "its frames have neither 'orientation' nor 'jointAngle'",
            hint="export from MVN with segment orientation, position and joint angles",
        )
    topics += [
        Topic(tag, "MVNX", seen, False, "not used for posture") for tag, seen in sorted(parser.other_tags.items())
    ]
    return Recording(str(path), "mvnx", tuple(streams), tuple(topics), opened)


def _parse(path: Path, log: ReadLog) -> Parser:
    """Parse the file up to its end or its first XML error."""
    data = file_bytes(path, log)
    parser = Parser(path)
    try:
        for start in range(0, len(data), CHUNK):
            parser.feed(data[start : start + CHUNK])
        parser.feed(b"", last=True)
    except expat.ExpatError as error:
        where = f"line {error.lineno}: {expat.ErrorString(error.code)}"
        count = sum(len(subject.frames) for subject in parser.subjects)
        if not count:
            raise ReadError(path, f"{where}; no complete frame before it", hint="export the recording again") from error
        log.ended_abnormally = f"{where}; the {count} frames before it were read"
    return parser


def _times(path: Path, subject: Subject, log: ReadLog) -> tuple[Array, float]:
    """Return the time of each frame [s] and the epoch [s], 0 if the file has no date."""
    stated = np.array([frame.time for frame in subject.frames], dtype=np.float64)
    first, rate = subject.frames[0], subject.rate
    step = float(np.median(np.diff(stated))) / 1000.0 if len(stated) > 1 else np.nan
    if np.isnan(stated).any() or step == 0:
        if not 0 < rate < 1e5:
            raise ReadError(path, "frames without 'time' and no 'frameRate'", hint="export the recording again")
        log.time_source = "frame rate"
        log.warn(f"frames have no time; it was counted from frameRate {rate:g} Hz")
        return np.arange(len(stated)) / rate, 0.0
    if abs(step * rate - 1.0) > RATE_ERROR:
        log.warn(f"frames are {step:g} s apart by their times, which were used, and {1 / rate:g} s by frameRate")
    time = stated / 1000.0
    return time, first.epoch / 1000.0 - float(time[0]) if first.epoch > 0 else 0.0


def _segments(subject: Subject, stream: str, version: str, time: Array, epoch: float, log: ReadLog) -> Stream | None:
    """Return the stream of segment poses, None if no frame has an orientation."""
    if not any("orientation" in frame.values for frame in subject.frames):
        return None
    names, identity = unique_names(subject.segments, log), subject.identity
    poses = np.stack([_pose(frame, len(names)) for frame in subject.frames])
    rest = _pose(identity, len(names)) if identity and "orientation" in identity.values else None
    return array_stream(
        stream,
        "frames",
        f"MVNX {version} segments",
        names,
        time,
        poses,
        opened=log,
        parents=("",) * len(names),
        epoch=epoch,
        up="z",
        rest=rest,
    )


def _pose(frame: Frame, count: int) -> Array:
    """Return (k, 7) x y z qx qy qz qw of a frame, NaN for absent values."""
    pose = np.full((count, 7), np.nan)
    if "position" in frame.values:
        pose[:, :3] = frame.values["position"].reshape(count, 3)
    if "orientation" in frame.values:
        quaternions = frame.values["orientation"].reshape(count, 4)
        norm = np.linalg.norm(quaternions, axis=1, keepdims=True)
        # A quaternion far from unit length is damaged.
        unit = quaternions / np.where(norm > 0, norm, 1)
        pose[:, 3:] = np.where(np.abs(norm - 1) < 0.1, unit, np.nan)[:, [1, 2, 3, 0]]
    return pose


def _joints(subject: Subject, stream: str, version: str, time: Array, epoch: float, log: ReadLog) -> Stream | None:
    """Return the stream of joint angles `<joint>_x|y|z`, None if no frame has any."""
    names: list[str] = []
    columns: list[Array] = []
    for tag in ANGLES:
        width = max((len(frame.values[tag]) for frame in subject.frames if tag in frame.values), default=0)
        if not width:
            continue
        labels = list(subject.joints if tag == "jointAngle" else subject.ergonomic)
        if 3 * len(labels) != width:
            known = ERGONOMIC if tag == "jointAngleErgo" else ()
            labels = list(known[: width // 3]) if width // 3 <= len(known) else []
        if 3 * len(labels) != width:
            log.warn(f"{tag} has {width // 3} joints whose names are unknown; it was left out")
            continue
        names += [f"{label}_{axis}" for label in labels for axis in "xyz"]
        blank = np.full(width, np.nan)
        rows = [frame.values.get(tag, blank) for frame in subject.frames]
        columns.append(np.stack([row if len(row) == width else blank for row in rows]))
    if not columns:
        return None
    return array_stream(
        stream,
        "joints",
        f"MVNX {version} joint angles",
        unique_names(names, log),
        time,
        np.concatenate(columns, axis=1),
        opened=log,
        unit="deg",
        epoch=epoch,
        up="z",
    )


ANGLES: Final = ("jointAngle", "jointAngleErgo")
WANTED: Final = ("orientation", "position", *ANGLES)
"""Elements of a frame that are read."""
LABELS: Final = {"segment": "segments", "joint": "joints", "ergonomicJointAngle": "ergonomicJointAngles"}
"""Elements with a `label`, and their parent element."""
RATE_ERROR: Final = 0.1
"""Largest share by which the median step of the times may differ from that of `frameRate` without a warning; a choice:
times are whole milliseconds."""
MAX_SUBJECTS: Final = 50
MAX_LABELS: Final = 1000
MAX_TAGS: Final = 100
MAX_DEPTH: Final = 100


@dataclass
class Frame:
    """One frame: `time` [ms], `epoch` [ms since 1970, NaN if not stated] and numbers by element."""

    time: float
    epoch: float
    values: dict[str, Array] = field(default_factory=dict)


@dataclass
class Subject:
    """What a file has of one person.

    Attributes:
        label: its name in the file.
        rate: `frameRate` [Hz], NaN if not stated.
        segments, joints, ergonomic: labels in the order of the file.
        frames: complete frames of type normal.
        identity: the calibration frame of type identity, else tpose, else None.
        bad_frames, first_bad: number of frames whose values do not fit the segments, and the place of the first.
    """

    label: str = ""
    rate: float = float("nan")
    segments: list[str] = field(default_factory=list)
    joints: list[str] = field(default_factory=list)
    ergonomic: list[str] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)
    identity: Frame | None = None
    bad_frames: int = 0
    first_bad: str = ""


class Parser:
    """Collects labels and frames from the chunks of a file.

    Attributes:
        subjects: in the order of the file.
        other_tags: elements of frames that are not read -> their count.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.version = ""
        self.subjects = [Subject()]
        self.other_tags: dict[str, int] = {}
        self._stack: list[str] = []
        self._frame: Frame | None = None
        self._kind = ""
        self._problem = ""
        self._text: list[str] = []
        self._expat = expat.ParserCreate()
        self._expat.buffer_text = True
        self._expat.StartElementHandler = self._start
        self._expat.EndElementHandler = self._end
        self._expat.CharacterDataHandler = self._data
        self._expat.StartDoctypeDeclHandler = self._doctype

    def feed(self, chunk: bytes, *, last: bool = False) -> None:
        """Parse a further chunk.

        Raises:
            ReadError: a document type definition, an unknown character encoding, another root than mvnx, or more
                labels than a body has.
            expat.ExpatError: the chunk is not XML.
        """
        try:
            self._expat.Parse(chunk, last)
        except ReadError:
            raise
        except (LookupError, ValueError) as error:
            # The parser queries Python for encodings that it does not know.
            raise self._fail(f"its character encoding cannot be read ({error})") from error

    def _fail(self, what: str, hint: str = "export the recording again") -> ReadError:
        return ReadError(self.path, f"line {self._expat.CurrentLineNumber}: {what}", hint=hint)

    def _doctype(self, name: str, system: str | None, public: str | None, internal: int) -> None:
        raise self._fail("a document type definition, which MVNX files do not have", "export it again from MVN")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        if not self._stack and tag != "mvnx":
            raise self._fail(f"the root element is {clip(tag)}, expected mvnx")
        if len(self._stack) == MAX_DEPTH:
            raise self._fail(f"elements nested deeper than {MAX_DEPTH}")
        parent = self._stack[-1] if self._stack else ""
        self._stack.append(tag)
        self._text = []
        if tag == "mvnx":
            self.version = attributes.get("version", "")[:20]
        elif tag == "subject":
            if len(self.subjects) > MAX_SUBJECTS:
                raise self._fail(f"more than {MAX_SUBJECTS} subjects")
            label = attributes.get("label", "") or f"subject{len(self.subjects)}"
            self.subjects.append(Subject(label, _number(attributes.get("frameRate", ""))))
        elif LABELS.get(tag) == parent:
            self._label(tag, attributes)
        elif tag == "frame":
            self._frame = Frame(_number(attributes.get("time", "")), _number(attributes.get("ms", "")))
            self._kind = attributes.get("type", "normal")
            self._problem = ""
        elif parent == "frame" and tag not in WANTED and (tag in self.other_tags or len(self.other_tags) < MAX_TAGS):
            self.other_tags[tag] = self.other_tags.get(tag, 0) + (self._kind == "normal")

    def _label(self, tag: str, attributes: dict[str, str]) -> None:
        subject = self.subjects[-1]
        labels = {"segment": subject.segments, "joint": subject.joints}.get(tag, subject.ergonomic)
        if len(labels) == MAX_LABELS:
            raise self._fail(f"more than {MAX_LABELS} elements {tag}")
        if subject.frames or subject.identity is not None:  # frames before were checked against the labels so far
            raise self._fail(f"an element {tag} after the first frame")
        labels.append(attributes.get("label", "") or f"{tag}{len(labels) + 1}")

    def _data(self, text: str) -> None:
        if self._frame is not None and self._stack[-1] in WANTED:
            self._text.append(text)

    def _end(self, tag: str) -> None:
        self._stack.pop()
        if self._frame is None:
            return
        if tag == "frame":
            self._close_frame(self._frame)
            self._frame = None
        elif tag in WANTED and self._text:
            self._convert(self._frame, tag)
        self._text = []

    def _convert(self, frame: Frame, tag: str) -> None:
        """Convert the numbers of one element; a frame with values that do not fit is not used."""
        words = "".join(self._text).split()
        segments = len(self.subjects[-1].segments)
        width = {"orientation": 4 * segments, "position": 3 * segments}.get(tag)
        try:
            values = np.array(words, dtype=np.float64)
        except ValueError:
            self._note(f"{tag} has a word that is not a number")
            return
        if width is None:
            # Joint labels may follow; every joint has three angles.
            fits, expected = len(values) % 3 == 0, "a multiple of 3"
        else:
            fits, expected = len(values) == width, str(width)
        if not fits:
            self._note(f"{tag} has {len(values)} numbers, expected {expected}")
        elif not (np.abs(values) <= LARGEST).all():
            self._note(f"{tag} has a number beyond {LARGEST:g}")
        elif len(values):
            frame.values[tag] = values

    def _note(self, what: str) -> None:
        self._problem = self._problem or f"line {self._expat.CurrentLineNumber}: {what}"

    def _close_frame(self, frame: Frame) -> None:
        subject = self.subjects[-1]
        if self._kind != "normal":
            if self._kind == "identity" or (self._kind == "tpose" and subject.identity is None):
                subject.identity = frame
        elif self._problem:
            subject.bad_frames += 1
            subject.first_bad = subject.first_bad or self._problem
        elif frame.values:
            subject.frames.append(frame)


def _number(text: str) -> float:
    """Return a number, NaN for other text."""
    try:
        value = float(text)
    except ValueError:
        return float("nan")
    return value if abs(value) <= 1e15 else float("nan")
