"""Atomic writes, and the one conversion to JSON.

JSON text is strict: NumPy scalars and arrays as numbers and lists, NaN and infinity as null.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np

from reba.errors import RebaError
from reba.open_file import open_regular

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


def write_atomic(path: Path, write: Callable[[Path], None]) -> None:
    """Call `write` with a temporary path beside `path` and rename the complete file."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(part)
        part.replace(path)
    except OSError as error:
        raise RebaError(f"{path}: cannot be written ({error.strerror or error}); choose another place") from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def write_atomic_stream(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Call `write` with a temporary file open for bytes, and rename it to `path` when it is complete.

    For libraries that open no path that is not UTF-8.
    """

    def open_and_write(part: Path) -> None:
        with part.open("wb") as stream:
            write(stream)

    write_atomic(path, open_and_write)


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
