"""Complete files: written under a temporary name, put on disk, then renamed; and the one conversion to JSON.

A write that fails, on a full disk for example, leaves what was there before. JSON text is strict: NumPy scalars and
arrays as numbers and lists, NaN and infinity as null.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import math
import os
import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np

from reba.errors import RebaError
from reba.interrupts import held_back
from reba.open_file import open_regular
from reba.outputs import check_regular

NonFinite = Literal["null", "refuse"]


def as_json(value: Any, *, indent: int | None = None, non_finite: NonFinite = "null") -> str:
    """Return data as strict JSON text of printable ASCII characters.

    Args:
        value: mappings, lists, tuples, NumPy scalars and arrays, numbers, texts, None.
        indent: of each level; None for one line.
        non_finite: "null": NaN and infinity become null; "refuse": they are an error.

    Raises:
        TypeError, ValueError: an object that JSON does not have, or NaN or infinity that are refused.

    >>> as_json({"rate": float("nan"), "frames": np.int64(1), "up": np.array([0.0, 1.0])})
    '{"rate": null, "frames": 1, "up": [0.0, 1.0]}'
    """
    # The other control characters and all that is not ASCII are escaped by json itself.
    return json.dumps(plain_data(value, non_finite), indent=indent, allow_nan=False).replace("\x7f", "\\u007f")


def plain_data(value: Any, non_finite: NonFinite = "null") -> Any:
    """Return data as the dicts, lists, numbers and texts that JSON has; arguments as in `as_json`."""
    if isinstance(value, Mapping):
        return {str(key): plain_data(item, non_finite) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain_data(item, non_finite) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain_data(value.tolist(), non_finite)
    if non_finite == "null" and isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def from_json(text: str | bytes) -> Any:
    """Return the data of a JSON text of a user, with numbers that floats hold: no NaN, 1e999 or 401 digits.

    Raises:
        ValueError, RecursionError: it is no JSON, has another number, or is nested too deep.

    >>> from_json('{"rate": 1e999}')
    Traceback (most recent call last):
    ValueError: a value is 1e999; expected finite numbers
    """
    return json.loads(text, parse_constant=_finite, parse_float=_finite, parse_int=_whole)


def _finite(text: str) -> float:
    if math.isfinite(number := float(text)):
        return number
    raise ValueError(f"a value is {text[:20]}; expected finite numbers")


def _whole(text: str) -> int:
    _finite(text)
    return int(text)


def write_atomic(
    path: str | Path,
    write: Callable[[Path], None],
    *,
    beside: Mapping[str, Callable[[Path], None]] | None = None,
    error: type[RebaError] = RebaError,
) -> None:
    """Call `write` with a temporary path beside a file and rename the complete file; a link is followed.

    Args:
        beside: ending added to the name -> writes a further file, which replaces its former one only with the file.
        error: class of the error.

    Raises:
        RebaError: the file cannot be written; its former content is still there.
    """
    check_regular(path, error)
    parts: dict[Path, Path] = {}
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        file = Path(os.path.realpath(path))
        file.parent.mkdir(parents=True, exist_ok=True)
        for ending, write_one in [*(beside or {}).items(), ("", write)]:
            place = file.with_name(file.name + ending)
            part = parts[place] = place.with_name(_temporary(place.name))
            write_one(part)
            _put_on_disk(part)
        for place, part in parts.items():
            part.replace(place)
        _put_on_disk(file.parent)
    except OSError as failure:
        raise error(f"{path}: cannot be written ({failure.strerror or failure}); choose another place") from failure
    except RebaError as failure:
        why = failure.__cause__
        if not isinstance(why, OSError) or not any(str(part) in str(failure) for part in parts.values()):
            raise  # the user knows no temporary file
        raise error(f"{path}: cannot be written ({why.strerror or why}); choose another place") from failure
    finally:
        for part in parts.values():
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)


def write_folder(
    folder: str | Path,
    write: Callable[[Path], None],
    *,
    last: str | None = None,
    stale: Iterable[str] = (),
    error: type[RebaError] = RebaError,
) -> None:
    """Call `write` with an empty temporary folder and move its files into a folder when all of them are complete.

    Args:
        folder: created if missing; other files in it stay.
        write: writes the files, also in folders of its folder.
        last: name of the file by which a reader recognises that the folder is complete: removed first, moved last.
        stale: patterns of files of an earlier write, which are removed unless they were written again.
        error: class of the error.

    Raises:
        RebaError: a file cannot be written; until all are complete, every former file is still there.
    """
    part: Path | None = None
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
        place = Path(os.path.realpath(folder))
        part = place / _temporary(place.name)
        part.mkdir()
        write(part)
        names = sorted(file.relative_to(part) for file in part.rglob("*") if file.is_file())
        names.sort(key=lambda name: name.as_posix() == last)
        for name in names:
            check_regular(place / name, error)
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            _put_on_disk(part / name)
        with held_back():
            if len(names) > 1 and names[-1].as_posix() == last:
                # Killed from here on, the folder has files of two writes and must not pass for complete.
                (place / last).unlink(missing_ok=True)
            for name in names:
                (part / name).replace(place / name)
        for old in {file for pattern in stale for file in place.glob(pattern)} - {place / name for name in names}:
            old.unlink()
        _put_on_disk(place)
    except OSError as failure:
        raise error(f"{folder}: cannot be written ({failure.strerror or failure}); choose another folder") from failure
    except RebaError as failure:
        if part is None or str(part) not in str(failure):
            raise
        raise error(str(failure).replace(str(part), str(folder))) from failure  # the user knows no temporary folder
    finally:
        if part is not None:
            shutil.rmtree(part, ignore_errors=True)


def _temporary(name: str) -> str:
    """Return a name beside a file that no other write has; of a long name a part, as names have a longest length."""
    return f".{name[:40]}.{os.getpid()}-{os.urandom(4).hex()}.part"


def _put_on_disk(path: Path) -> None:
    """Write a file or the entries of a folder to disk (fsync), so that a power cut does not lose what is renamed."""
    try:
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as error:
        # Some systems refuse it, most of them for folders; that a disk is full may show only now.
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG):
            raise


def write_atomic_stream(
    path: str | Path, write: Callable[[BinaryIO], object], *, error: type[RebaError] = RebaError
) -> None:
    """Call `write` with a temporary file open for bytes, and rename it to `path` when it is complete.

    For libraries that open no path that is not UTF-8.
    """

    def open_and_write(part: Path) -> None:
        with part.open("wb") as stream:
            write(stream)

    write_atomic(path, open_and_write, error=error)


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8."""
    path.write_text(text, encoding="utf-8")


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal text."""
    digest = hashlib.sha256()
    with open_regular(path) as file:
        while part := file.read(1 << 20):
            digest.update(part)
    return digest.hexdigest()


def lock_exclusively(file: int) -> bool:
    """Lock a file by its descriptor, and return False if another process holds the lock.

    The system releases the lock when the process ends. Some systems have no locks: they always give True.
    """
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True
