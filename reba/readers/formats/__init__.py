"""Registry of the formats that are read: one `Format` each; the content of a file decides, not its name."""

from __future__ import annotations

import importlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from reba.errors import ReadError
from reba.files import sha256_of
from reba.open_file import open_regular
from reba.readers.formats.file_content import GZIP, head_of, is_packed, unpacked_name
from reba.readers.formats.not_read import refuse_by_content, refuse_by_name
from reba.readers.formats.score_file import mcap_record
from reba.readers.mcap import is_mcap, open_mcap, sniff
from reba.readers.recording.stream import Recording
from reba.recording_folder import entries_of, is_split


@dataclass(frozen=True)
class Format:
    """A format and its reader.

    Attributes:
        name: as in messages.
        extensions: usual file name endings.
        module: module with `sniff(path, head)` and the opener.
        opener: name of its function `open_...(path)`.
        timeless: whether its files may lack times, so that the opener takes their `rate`.
    """

    name: str
    extensions: tuple[str, ...]
    module: str
    opener: str
    timeless: bool = False

    def fits(self, path: Path, head: bytes) -> bool:
        """Return whether the first bytes are those of this format."""
        return bool(importlib.import_module(self.module).sniff(path, head))

    def open(self, path: Path, rate: float | None = None) -> Recording:
        """Open a file of this format; `rate` [Hz] is that of a file without times.

        Raises:
            ReadError: it has times, and a rate is given; and others of the reader.
        """
        timeless = {} if rate is None else {"rate": rate}
        if timeless and not self.timeless:
            raise ReadError(path, f"{self.name} files have times of their own", hint="leave the rate out")
        opened: Recording = getattr(importlib.import_module(self.module), self.opener)(path, **timeless)
        return opened


FORMATS: tuple[Format, ...] = (
    Format("C3D", (".c3d",), "reba.readers.formats.c3d", "open_c3d"),
    Format("BVH", (".bvh",), "reba.readers.formats.bvh", "open_bvh"),
    Format("OpenSim motion", (".mot", ".sto"), "reba.readers.formats.opensim", "open_opensim"),
    Format("TRC markers", (".trc",), "reba.readers.formats.trc", "open_trc"),
    Format("Xsens MVNX", (".mvnx",), "reba.readers.formats.mvnx", "open_mvnx"),
    Format("SMPL poses", (".npz",), "reba.readers.formats.smpl", "open_smpl", True),
    Format("Excel workbook", (".xlsx", ".xlsm"), "reba.readers.formats.xlsx", "open_xlsx", True),
    Format("posture or joint table", (".csv", ".tsv", ".parquet"), "reba.readers.formats.table", "open_table", True),
)
"""Formats beside MCAP and ROS bags, those with the most certain first bytes first."""
MOTION_ENDINGS: frozenset[str] = frozenset((".mcap", ".bag", ".c3d", ".bvh", ".mot", ".sto", ".trc", ".mvnx"))
"""Endings of recordings alone: such a file that is damaged from its first byte on is a damaged recording."""
PACKED: tuple[bytes, ...] = (
    b"\x89MCAP",
    b"PAR1",
    b"PK\x03\x04",
    GZIP,
    b"#ROSBAG",
    b"SQLite format 3",
    b"\x28\xb5\x2f\xfd",
)
"""First bytes of formats that are packed themselves or read in parts, which are not read from gzip."""


Paths = str | Path | Sequence[str | Path]
"""Path of a recording, or those of its files."""


def files_given(path: Paths) -> list[str | Path]:
    """Return every path of a recording."""
    return [path] if isinstance(path, str | os.PathLike) else list(path)


def paths_text(path: Paths) -> str:
    """Return the path of a recording, or those of its files, as text."""
    return " + ".join(map(str, files_given(path)))


def open_recording(path: Paths, *, strict: bool = False, rate: float | None = None) -> Recording:
    """Open a recording of any known format; a folder counts as a recording in splits, as of rosbag2, and so does
    a list.

    Args:
        rate: [Hz] of a recording without times, whose rows it numbers.

    Raises:
        ReadError: the file does not exist, has an unknown format, is damaged, or is truncated and `strict` is set.
    """
    if not isinstance(path, str | os.PathLike):
        return _open_files(list(path), strict, rate)
    if path == "":
        # pathlib takes it for the current folder.
        raise ReadError("an empty path", "no file", hint="give the path of a recording")
    place = Path(path)
    try:
        if not place.exists():
            raise ReadError(place, "no such file or folder", hint="check the path")
        # A pipe or a device may have no end.
        if not place.is_dir() and not place.is_file():
            raise ReadError(place, "not a regular file", hint="save the recording to a file")
        if place.is_dir():
            entries_of(place)
    except OSError as error:
        raise ReadError(place, error.strerror or str(error), hint="give a readable file") from error

    if place.is_dir() or sniff(place):
        if rate is not None:
            raise ReadError(place, "recordings of messages have times of their own", hint="leave the rate out")
        return _with_record(open_mcap(place, strict=strict))
    try:
        head = head_of(place)
        packed = is_packed(place)
    except OSError as error:
        raise ReadError(place, error.strerror or str(error), hint="give a readable file") from error
    if packed and head.startswith(PACKED):
        raise ReadError(
            place, "gzip around a file that is packed itself or read in parts", hint="unpack it once: gunzip FILE"
        )
    refuse_by_content(place, head)
    name = unpacked_name(place)
    by_name = sorted(FORMATS, key=lambda known: name.suffix.lower() not in known.extensions)
    for known in by_name:
        if known.fits(name, head):
            return known.open(place, rate)
    named = next((known for known in FORMATS if name.suffix.lower() in known.extensions), None)
    if named is not None and (head or packed):
        return named.open(place, rate)
    if head and name.suffix.lower() in MOTION_ENDINGS:
        what = f"its first bytes are not those of a {name.suffix.lower()} file, so it is damaged or has a wrong name"
        raise ReadError(place, what, hint="record or export it again, or give the file the ending of its format")
    if head:
        refuse_by_name(place)
    what = "the file is empty" if not head else "the format is unknown"
    readable = ", ".join(
        [
            "MCAP (.mcap or a rosbag2 folder)",
            "ROS bags (.bag .db3)",
            *(f"{form.name} ({' '.join(form.extensions)})" for form in FORMATS),
        ]
    )
    raise ReadError(place, what, hint=f"known formats are {readable}")


def _open_files(paths: list[str | Path], strict: bool, rate: float | None) -> Recording:
    """Open the files of one recording of messages: MCAP, bags or databases.

    Raises:
        ReadError: a file is no recording of messages or stands twice, or two of them were recorded at one time.
    """
    if len(paths) <= 1:
        if not paths:
            raise ReadError("an empty list", "no file", hint="give the path of a recording")
        return open_recording(paths[0], strict=strict, rate=rate)
    if rate is not None:
        raise ReadError(paths_text(paths), "recordings of messages have times of their own", hint="leave the rate out")
    files = [Path(path) for path in paths]
    for number, file in enumerate(files):
        try:
            is_file = file.is_file() and sniff(file)
            twice = is_file and any(os.path.samefile(file, other) for other in files[:number])
        except (OSError, ValueError) as error:
            raise ReadError(file, getattr(error, "strerror", None) or str(error), hint="give readable files") from error
        if not is_file:
            what = "not an MCAP, .bag or .db3 file" if file.exists() else "no such file"
            hint = "a list holds the files of one recording of messages; read several recordings one by one"
            raise ReadError(file, what, hint=hint)
        if twice:
            raise ReadError(file, "stands twice in the list", hint="name each file of the recording once")
    return _with_record(open_mcap(files, strict=strict))


def _with_record(recording: Recording) -> Recording:
    """Return an MCAP recording with what its scores, if it has any, were written with."""
    return recording if recording.scored is None else replace(recording, scored=mcap_record(recording.scored))


def is_recording(path: Path) -> bool:
    """Return whether a file is a recording by its name and its first bytes; by its name if it cannot be opened, and
    where only recordings have such a name."""
    if not path.is_file():
        return False
    name = unpacked_name(path)
    if name.suffix.lower() in MOTION_ENDINGS:
        return True
    named = [known for known in FORMATS if name.suffix.lower() in known.extensions]
    try:
        open_regular(path).close()
        if sniff(path):
            return is_mcap(path) or is_split(path.name)  # SQLite files are of many programs
        head = head_of(path) if named else b""
    except FileNotFoundError:  # removed since
        return False
    except OSError:
        return bool(named) or is_split(path.name)
    return any(known.fits(name, head) for known in named)


def may_be_recording(path: Path) -> bool:
    """Return whether recordings have names as that of a file."""
    return path.is_file() and any(unpacked_name(path).suffix.lower() in known.extensions for known in FORMATS)


def file_hash(path: str | Path) -> str:
    """Return the SHA-256 of a file, read in pieces; "" for a folder."""
    return "" if Path(path).is_dir() else sha256_of(Path(path))
