"""Zip archives that are recordings (.npz, .xlsx); what unpacks to more than its size can hold is refused."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from reba.errors import ReadError
from reba.open_file import open_regular
from reba.readers.formats.file_content import ANY_BYTES, RATIO

MOST_MEMBERS: Final = 10_000
HINT: Final = "the file is truncated or damaged: write or copy it again"


def first_member(head: bytes) -> str:
    """Return the name of the first file of an archive from its first bytes, "" if they are of no archive."""
    if not head.startswith(b"PK\x03\x04") or len(head) < 30:
        return ""
    return head[30 : 30 + int.from_bytes(head[26:28], "little")].decode("latin-1")


@contextmanager
def open_zip(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open an archive for reading; what fails inside of the block because of its bytes is a `ReadError` too.

    Raises:
        ReadError: it cannot be read or is damaged, or states to unpack to more than a recording of its size.
    """
    try:
        with open_regular(path) as file, zipfile.ZipFile(file) as archive:
            members = archive.infolist()
            size = sum(member.file_size for member in members)  # no member can be read beyond what it states
            packed = path.stat().st_size
            if len(members) > MOST_MEMBERS or size > max(ANY_BYTES, RATIO * packed):
                what = f"{len(members)} parts of {size} bytes unpacked, which no recording packed to {packed} bytes has"
                raise ReadError(path, what, hint="write the recording again")
            yield archive
    except ReadError:
        raise
    except OSError as error:
        raise ReadError(path, error.strerror or str(error), hint="give an existing, readable file") from error
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError) as error:
        what = f"not a readable archive ({' '.join(str(error).split())[:120]})"
        raise ReadError(path, what, hint=HINT) from error
