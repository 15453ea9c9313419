"""Bytes of a recording file, unpacked from gzip, and the name that it has unpacked.

Source: RFC 1952 (gzip): members one after the other, each with a checksum. An honest text of numbers packs to a fifth
or so; what unpacks to far more than its size is refused before it fills the memory.
"""

from __future__ import annotations

import zlib
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from pathlib import Path
from typing import BinaryIO, Final

from reba.errors import ReadError
from reba.open_file import open_regular
from reba.readers.recording.stream import ReadLog

HEAD: Final = 8192
"""[bytes] First part of a file that decides its format."""
GZIP: Final = b"\x1f\x8b"
ANY_BYTES: Final = 1 << 25
"""[bytes] To which every file may unpack; a choice."""
RATIO: Final = 100
"""Unpacked bytes for each packed one that larger files may have; a choice, far above that of recordings."""
_STEP: Final = 1 << 20


def unpacked_name(path: Path) -> Path:
    """Return the path without `.gz`, which names the format.

    >>> unpacked_name(Path("walk.trc.gz")).name, unpacked_name(Path("walk.trc")).name
    ('walk.trc', 'walk.trc')
    """
    return path.with_suffix("") if path.suffix.lower() == ".gz" else path


def is_packed(path: Path) -> bool:
    """Return whether the first bytes are those of gzip."""
    with open_regular(path) as file:
        return file.read(len(GZIP)) == GZIP


def head_of(path: Path) -> bytes:
    """Return the first `HEAD` bytes, unpacked, texts in UTF-8 without a byte order mark; fewer of a short file.

    Raises:
        OSError: the file cannot be read.
    """
    with open_regular(path) as file:
        head = file.read(HEAD)
    if head.startswith(GZIP):
        try:
            head = zlib.decompressobj(wbits=31).decompress(head, HEAD)
        except zlib.error:
            return b""
    if head.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return head.decode("utf-16", "replace").encode()
    return head.removeprefix(BOM_UTF8)


def file_bytes(path: Path, log: ReadLog) -> bytes:
    """Return the content of a file, unpacked; of a truncated gzip file the part before its end, which is noted.

    Raises:
        ReadError: it is missing, empty or a folder, cannot be read, or is gzip that is damaged or unpacks to too much.
    """
    try:
        with open_regular(path) as file:
            packed = file.read(len(GZIP)) == GZIP
            file.seek(0)
            data = _unpacked(path, file, log) if packed else file.read()
    except OSError as error:
        raise ReadError(path, error.strerror or str(error), hint="give an existing, readable file") from error
    if not data:
        raise ReadError(path, "the file is empty", hint="record or copy it again")
    return data


def _unpacked(path: Path, file: BinaryIO, log: ReadLog) -> bytes:
    most = max(ANY_BYTES, RATIO * path.stat().st_size)
    parts: list[bytes] = []
    size = 0
    member = zlib.decompressobj(wbits=31)
    waiting = file.read(_STEP)
    while waiting:
        try:
            part = member.decompress(waiting, _STEP)
        except zlib.error as error:
            what = f"damaged gzip data after {size} unpacked bytes ({error})"
            raise ReadError(path, what, hint="copy or pack it again") from error
        parts.append(part)
        size += len(part)
        if size > most:
            what = f"it unpacks to more than {most} bytes, which no recording packed to {path.stat().st_size} does"
            raise ReadError(path, what, hint="pack the recording again, or give it unpacked")
        if member.eof:
            # Another member may follow, and zeros that fill a block; anything else is no gzip.
            waiting = (member.unused_data or file.read(_STEP)).lstrip(b"\0")
            if waiting and not GZIP.startswith(waiting[:2]):
                log.warn("bytes after the end of the gzip data were left out")
                waiting = b""
            member = zlib.decompressobj(wbits=31) if waiting else member
        else:
            waiting = member.unconsumed_tail or file.read(_STEP)
    if not member.eof:
        log.ended_abnormally = f"the gzip data is truncated after {size} unpacked bytes; what is before was read"
    return b"".join(parts)
