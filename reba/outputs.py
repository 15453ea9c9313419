"""What a command or a function will write, checked before its work: can it be written, and does it spare the inputs?

A `FileOutput` or `FolderOutput` says what is written; `check_outputs` refuses it in one line before seconds or hours of
work are spent. `reba.files` then writes complete files only.
"""

from __future__ import annotations

import errno
import os
import stat
import tempfile
from collections.abc import Iterable, Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import Final, NamedTuple

from reba.errors import RebaError
from reba.recording_folder import is_recording_folder

Place = str | os.PathLike[str]
LONGEST_NAME: Final = 255
"""[bytes] Longest name of a file on the usual file systems."""


class FileOutput(NamedTuple):
    """A file that will be written.

    Attributes:
        path: as the user gave it.
        suffixes: endings that it may have, any by default.
        beside: endings of further files that are written beside it, added to its name.
    """

    path: Place
    suffixes: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()

    @property
    def written(self) -> tuple[str, ...]:
        """Every file that is written."""
        return (os.fspath(self.path), *(f"{os.fspath(self.path)}{ending}" for ending in self.beside))


class FolderOutput(NamedTuple):
    """A folder that will be written into, created if missing; other files in it stay.

    Attributes:
        path: as the user gave it.
        owns: patterns of the files that are written there, relative to it.
    """

    path: Place
    owns: tuple[str, ...] = ()

    def writes(self, path: Place) -> bool:
        """Return whether a file is one of those that are written there."""
        inside = os.path.relpath(os.path.realpath(path), os.path.realpath(self.path))
        return any(fnmatch(Path(inside).as_posix(), pattern) for pattern in self.owns)


Output = FileOutput | FolderOutput


def check_outputs(
    *outputs: Output | None, inputs: Iterable[Place | None] = (), error: type[RebaError] = RebaError
) -> None:
    """Check that all outputs can be written, and that none of them replaces an input or another output.

    Args:
        outputs: what will be written; None for what was not asked for.
        inputs: files and folders that are read; names that do not exist are ignored.
        error: class of the error.

    Raises:
        RebaError: an output cannot be written, has a wrong ending, is an input, lies in a recording, or two are one.

    >>> check_outputs(FileOutput("scores.xyz", (".csv", ".parquet")))
    Traceback (most recent call last):
    reba.errors.RebaError: scores.xyz: ending '.xyz' is unknown; choose one of .csv, .parquet
    """
    given = [output for output in outputs if output is not None]
    try:
        for output in given:
            if isinstance(output, FileOutput):
                _check_file(output)
            else:
                _check_folder(output)
        read = [path for path in inputs if path is not None and os.path.lexists(path)]
        for number, output in enumerate(given):
            _spare_inputs(output, read)
            for other in given[:number]:
                _refuse_clash(other, output)
    except RebaError as refused:
        raise error(str(refused)) from refused


def check_regular(path: Place, error: type[RebaError] = RebaError) -> None:
    """Refuse a place for a file where there is something other than a regular file: a folder, device or pipe.

    Raises:
        RebaError: the place cannot be used.
    """
    text = os.fspath(path)
    if not text:
        raise error("an empty name: expected the name of a file")
    if os.path.isdir(text):
        raise error(f"{text}: this is a folder, expected one file; give a name in it")
    if text.endswith(("/", os.sep)):
        raise error(f"{text}: this is the name of a folder, expected a file; leave out the last {text[-1]}")
    status = _status(text, error)
    if status is not None and not stat.S_ISREG(status.st_mode):
        raise error(f"{text}: this is not a regular file and cannot be replaced; choose another name")


def _check_file(output: FileOutput) -> None:
    for written in output.written:
        check_regular(written)
    suffix = Path(output.path).suffix.lower()
    if output.suffixes and suffix not in output.suffixes:
        expected = f"choose one of {', '.join(output.suffixes)}"
        if len(output.suffixes) == 1:
            expected = f"choose a name ending in {output.suffixes[0]}"
        raise RebaError(f"{output.path}: ending {suffix!r} is unknown; {expected}")
    _check_writable(output.path, Path(os.path.realpath(output.path)).parent)


def _check_folder(output: FolderOutput) -> None:
    text = os.fspath(output.path)
    if not text:
        raise RebaError("an empty name: expected the name of a folder")
    status = _status(text, kind="folder")
    if status is not None and not stat.S_ISDIR(status.st_mode):
        raise RebaError(f"{text}: this is not a folder; give a folder to write to")
    _check_writable(text, Path(os.path.realpath(text)), "folder")
    for name in output.owns:
        if "*" not in name:
            check_regular(os.path.join(text, name))


def _status(path: str, error: type[RebaError] = RebaError, kind: str = "place") -> os.stat_result | None:
    """Return what is at a place, None if nothing is."""
    try:
        if any(len(os.fsencode(part)) > LONGEST_NAME for part in Path(path).parts):
            raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG))
        return os.stat(path)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as failure:
        raise error(_unwritable(path, failure, kind)) from failure


def _check_writable(path: Place, folder: Path, kind: str = "place") -> None:
    """Write a file without a name into a folder, or the nearest one above it that exists."""
    try:
        while not folder.exists():
            folder = folder.parent
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as failure:
        raise RebaError(_unwritable(path, failure, kind)) from failure


def _unwritable(path: Place, failure: Exception, kind: str) -> str:
    why = getattr(failure, "strerror", None) or failure
    return f"{os.fspath(path)}: cannot be written ({why}); choose another {kind}"


def _spare_inputs(output: Output, inputs: Iterable[Place]) -> None:
    for read in inputs:
        folder = Path(os.path.realpath(read))
        if folder.is_dir() and folder in (place := Path(os.path.realpath(output.path)), *place.parents):
            if is_recording_folder(folder):
                raise RebaError(
                    f"{output.path}: lies in the recording {read}, which would change; choose another place"
                )
        elif isinstance(output, FolderOutput) and output.writes(read):
            raise RebaError(f"{read}: is an input of this command and would be lost in {output.path}; rename it")
        elif isinstance(output, FileOutput) and any(_same(written, read) for written in output.written):
            raise RebaError(f"{output.path}: is also an input of this command and would be lost; choose another name")


def _refuse_clash(first: Output, second: Output) -> None:
    for one, other in ((first, second), (second, first)):
        for written in other.written if isinstance(other, FileOutput) else (other.path,):
            if _claims(one, written):
                raise RebaError(f"{other.path}: is already another output of this command; choose another name")


def _claims(output: Output, path: Place) -> bool:
    """Return whether an output is a place itself or needs it for something else."""
    if isinstance(output, FolderOutput):
        return output.writes(path)
    place = Path(os.path.realpath(path))
    return any(_same(written, path) or Path(os.path.realpath(written)) in place.parents for written in output.written)


def _same(first: Place, second: Place) -> bool:
    """Return whether two names are of one file, through links of both kinds and spellings in upper and lower case."""
    try:
        return os.path.samefile(first, second)
    except OSError:
        return os.path.normcase(os.path.realpath(first)) == os.path.normcase(os.path.realpath(second))


def existing(values: Iterable[object]) -> Iterator[str]:
    """Give the texts among values of options that name something that exists: NAME, or KEY=NAME."""
    for value in values:
        if isinstance(value, tuple | list):
            yield from existing(value)
        elif isinstance(value, str):
            yield from (text for text in (value, value.partition("=")[2]) if text and os.path.lexists(text))
