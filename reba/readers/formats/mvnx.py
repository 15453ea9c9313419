"""A streaming parser of MVNX: labels and frames, one element at a time, never a tree.

Document type definitions are refused, and with them every entity that could be expanded.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from reba.errors import ReadError
from reba.readers.memory import clip
from reba.readers.text import LARGEST

ANGLES: Final = ("jointAngle", "jointAngleErgo")
WANTED: Final = ("orientation", "position", *ANGLES)
"""Elements of a frame that are read."""

LABELS: Final = {"segment": "segments", "joint": "joints", "ergonomicJointAngle": "ergonomicJointAngles"}
"""Elements with a `label`, and the element that holds them."""

MAX_LABELS: Final = 1000
MAX_TAGS: Final = 100
MAX_DEPTH: Final = 100


@dataclass
class Frame:
    """One frame: `time` [ms], `epoch` [ms since 1970, NaN if not given] and numbers by element."""

    time: float
    epoch: float
    values: dict[str, NDArray[np.float64]] = field(default_factory=dict)


class Parser:
    """Collects labels and frames from the chunks of a file.

    Attributes:
        version, rate: of the file and its subject; rate NaN if not given [Hz].
        segments, joints, ergonomic: labels in the order of the file.
        frames: whole frames of type normal, of the first subject.
        identity: the calibration frame of type identity, or tpose, if there is one.
        bad_frames, first_bad: frames whose numbers do not fit the segments, and where the first one stands.
        other_tags: how often each element of a frame stood there that is not read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.version = ""
        self.rate = float("nan")
        self.segments: list[str] = []
        self.joints: list[str] = []
        self.ergonomic: list[str] = []
        self.frames: list[Frame] = []
        self.identity: Frame | None = None
        self.bad_frames = 0
        self.first_bad = ""
        self.other_tags: dict[str, int] = {}
        self._stack: list[str] = []
        self._subjects = 0
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
            expat.ExpatError: what follows is no XML.
        """
        try:
            self._expat.Parse(chunk, last)
        except ReadError:
            raise
        except (LookupError, ValueError) as error:
            # The parser asks Python for encodings it does not know itself.
            raise self._fail(f"its character encoding cannot be read ({error})") from error

    def _fail(self, what: str, hint: str = "export the recording again") -> ReadError:
        return ReadError(self.path, f"line {self._expat.CurrentLineNumber}: {what}", hint=hint)

    def _doctype(self, name: str, system: str | None, public: str | None, internal: int) -> None:
        raise self._fail("a document type definition, which no MVNX file has", "export it again from MVN")

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
            self._subjects += 1
            if self._subjects == 1:
                self.rate = _number(attributes.get("frameRate", ""))
        elif self._subjects > 1:
            return
        elif LABELS.get(tag) == parent:
            self._label(tag, attributes)
        elif tag == "frame":
            self._frame = Frame(_number(attributes.get("time", "")), _number(attributes.get("ms", "")))
            self._kind = attributes.get("type", "normal")
            self._problem = ""
        elif parent == "frame" and tag not in WANTED and (tag in self.other_tags or len(self.other_tags) < MAX_TAGS):
            self.other_tags[tag] = self.other_tags.get(tag, 0) + (self._kind == "normal")

    def _label(self, tag: str, attributes: dict[str, str]) -> None:
        labels = {"segment": self.segments, "joint": self.joints}.get(tag, self.ergonomic)
        if len(labels) == MAX_LABELS:
            raise self._fail(f"more than {MAX_LABELS} elements {tag}")
        if self.frames or self.identity is not None:  # whose numbers were counted by the labels so far
            raise self._fail(f"an element {tag} behind the first frame")
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
            self._take(self._frame, tag)
        self._text = []

    def _take(self, frame: Frame, tag: str) -> None:
        """Convert the numbers of one element; those that do not fit make the frame unusable."""
        words = "".join(self._text).split()
        width = {"orientation": 4 * len(self.segments), "position": 3 * len(self.segments)}.get(tag)
        try:
            values = np.array(words, dtype=np.float64)
        except ValueError:
            self._note(f"{tag} holds what is no number")
            return
        if width is None:
            # Joint angles are named later; a triple is what every joint has.
            fits, expected = len(values) % 3 == 0, "a multiple of 3"
        else:
            fits, expected = len(values) == width, str(width)
        if not fits:
            self._note(f"{tag} holds {len(values)} numbers, expected {expected}")
        elif not (np.abs(values) <= LARGEST).all():
            self._note(f"{tag} holds a number of implausible size")
        elif len(values):
            frame.values[tag] = values

    def _note(self, what: str) -> None:
        self._problem = self._problem or f"line {self._expat.CurrentLineNumber}: {what}"

    def _close_frame(self, frame: Frame) -> None:
        if self._kind != "normal":
            if self._kind == "identity" or (self._kind == "tpose" and self.identity is None):
                self.identity = frame
        elif self._problem:
            self.bad_frames += 1
            self.first_bad = self.first_bad or self._problem
        elif frame.values:
            self.frames.append(frame)


def _number(text: str) -> float:
    """Return a number, NaN for anything else."""
    try:
        value = float(text)
    except ValueError:
        return float("nan")
    return value if abs(value) <= 1e15 else float("nan")
