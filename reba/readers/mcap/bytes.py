"""Bytes of a recording: positioned reads of a file (unpacked to a temporary one if zstd-compressed), unpacked chunks.

Reads instead of a memory map: resident memory stays at one chunk, and a file that becomes shorter while it is read
(still being recorded or copied) raises an error and not a bus error.
"""

from __future__ import annotations

import tempfile
import weakref
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import IO, Any, Final

from reba.errors import ReadError
from reba.open_file import open_regular

MAGIC: Final = b"\x89MCAP0\r\n"
"""First and last bytes of an MCAP file, https://mcap.dev/spec#magic."""
NOT_MCAP: Final = ("does not start with the MCAP magic bytes", "give an .mcap recording")
ZSTD_MAGIC: Final = b"\x28\xb5\x2f\xfd"
"""First bytes of a zstd frame, RFC 8878 section 3.1.1; `ros2 bag record --compression-mode file` writes such files."""
_FILE_STEP: Final = 1 << 22
"""[bytes] Step of unpacking a file: bounds how far it can exceed the limit."""
_HEAD: Final = 18
"""[bytes] Longest zstd frame header, RFC 8878 section 3.1.1.1."""


class ByteSource:
    """Random access to the bytes of one recording; `size` is that of the unpacked file, `packed_size` of the given one.

    Args:
        magic: first bytes that it must have; `foreign`: what to say, and to do, about others.

    Raises:
        ReadError: the file is absent, empty, does not start with `magic`, or unpacks to more than `limit_bytes`.
    """

    def __init__(self, path: Path, limit_bytes: int, magic: bytes = MAGIC, foreign: tuple[str, str] = NOT_MCAP) -> None:
        self.path = path
        self._file = opened(path)
        # The file closes when the last stream of the recording is garbage-collected.
        weakref.finalize(self, self._file.close)
        self.size = self.packed_size = self._end()
        if self.size == 0:
            raise ReadError(path, "the file is empty", hint="record it again; the recorder wrote no data")
        if self.read_at(0, 4) == ZSTD_MAGIC:
            # Without a name; closed by the finalizer.
            unpacked = tempfile.TemporaryFile()  # noqa: SIM115
            weakref.finalize(self, unpacked.close)
            unpack_file(path, self._file, unpacked, limit_bytes)
            self._file = unpacked
            self.size = self._end()
        if self.read_at(0, len(magic)) != magic:
            raise ReadError(path, foreign[0], hint=foreign[1], offset=0)

    def _end(self) -> int:
        return self._file.seek(0, 2)

    def refresh(self) -> bool:
        """Update the size of a file that is appended to; return whether it changed."""
        before = self.size
        self.size = self.packed_size = self._end()
        return self.size != before

    def read_at(self, offset: int, count: int) -> bytes:
        """Return up to `count` bytes from `offset`, fewer only at the end of the file."""
        try:
            self._file.seek(offset)
            data = self._file.read(min(count, max(self.size - offset, 0)))
            # One read returns at most 2 GiB.
            while len(data) < count and (more := self._file.read(count - len(data))):
                data += more
            return data
        except OSError as error:
            raise ReadError(
                self.path, f"cannot be read ({error.strerror})", hint="copy it to a local disk", offset=offset
            ) from error


def opened(path: Path) -> IO[bytes]:
    """Open a file of a recording.

    Raises:
        ReadError: it is absent, or cannot be read.
    """
    try:
        return open_regular(path, buffering=0)
    except OSError as error:
        what = f"cannot be opened ({error.strerror})"
        raise ReadError(path, what, hint="check the path and its permissions") from error


def unpack_file(path: Path, packed: IO[bytes], unpacked: IO[bytes], limit_bytes: int) -> None:
    """Write the bytes of a zstd-compressed recording to `unpacked`.

    Raises:
        ReadError: it is damaged, or unpacks to more than `limit_bytes`.
    """
    import zstandard

    too_big = ReadError(
        path,
        f"unpacks to more than {limit_bytes} bytes",
        hint="unpack it with `zstd -d` and give the file that this makes, or raise limit_bytes",
    )
    packed.seek(0)
    try:
        if zstandard.frame_content_size(packed.read(_HEAD)) > limit_bytes:
            raise too_big
        packed.seek(0)
        with zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True, closefd=False) as reader:
            while part := reader.read(_FILE_STEP):
                unpacked.write(part)
                if unpacked.tell() > limit_bytes:
                    raise too_big
    except zstandard.ZstdError as error:
        raise ReadError(path, f"is a damaged zstd file ({error})", hint="copy or record the file again") from error


ONE_CALL: Final = 1 << 26
"""[bytes] Chunks up to this size are unpacked in one call; larger ones step by step, as their size may be false."""
_CHUNK_STEP: Final = 1 << 24
"""[bytes] Step of unpacking a large chunk."""
_LZ4_MOST: Final = 256
"""Bound of the lz4 ratio: a block unpacks to at most 255 times its size (LZ4 block format, "Limits")."""

MOST_RATIO: Final = 1000
"""Bytes that chunks, or messages packed one by one, may unpack to for each (packed) byte of the file, beyond
`limit_bytes`; a choice."""


class BadChunk(Exception):
    """The bytes of a chunk do not unpack to the size that the chunk declares."""


def unpack(packed: bytes, compression: str, size: int) -> bytes:
    """Return the `size` bytes of an unpacked chunk.

    Raises:
        BadChunk: unknown compression, damaged bytes, another size than declared, or memory runs out.
    """
    if compression not in _UNPACK:
        known = ", ".join(repr(name) for name in _UNPACK)
        raise BadChunk(f"the chunk is compressed with {compression!r}, known are {known}")
    try:
        data = _UNPACK[compression](packed, size)
    except MemoryError as error:
        raise BadChunk(f"a chunk of {size} bytes exceeds the memory") from error
    if len(data) != size:
        raise BadChunk(f"the chunk unpacks to {len(data)} bytes, not to the {size} that it declares")
    return data


def _plain(packed: bytes, size: int) -> bytes:
    return packed


@cache
def zstd() -> tuple[Any, Any]:
    """Return the module that unpacks zstd and a decompressor."""
    import zstandard

    return zstandard, zstandard.ZstdDecompressor()


def crc32(data: bytes) -> int:
    """Return the CRC-32 of a chunk or a summary.

    >>> hex(crc32(b"123456789"))
    '0xcbf43926'
    """
    return _crc32()(data)


@cache
def _crc32() -> Callable[[bytes], int]:
    """Return the CRC-32 of zlib-ng if installed: that of most systems' zlib takes as long as unpacking zstd."""
    try:
        from zlib_ng import zlib_ng
    except ImportError:
        return zlib.crc32
    faster: Callable[[bytes], int] = zlib_ng.crc32
    return faster


def unpack_zstd(packed: bytes, size: int, one_call: int = ONE_CALL) -> bytes:
    """Return the unpacked bytes: in one call up to `one_call` [bytes], else in steps up to the first beyond `size`."""
    zstandard, decompressor = zstd()
    try:
        stated = zstandard.frame_content_size(packed)
        if stated not in (-1, size):
            raise BadChunk(f"the chunk declares {size} bytes, its zstd frame {stated}")
        if size <= one_call:
            return bytes(decompressor.decompress(packed, max_output_size=size)) if size else b""
        with decompressor.stream_reader(packed) as reader:
            return _grow(reader.read, size)
    except zstandard.ZstdError as error:
        raise BadChunk(f"its zstd data are damaged ({error})") from error


def _unpack_lz4(packed: bytes, size: int) -> bytes:
    import lz4.frame

    if size > len(packed) * _LZ4_MOST:
        raise BadChunk(f"{len(packed)} bytes of lz4 cannot unpack to the {size} that the chunk declares")
    try:
        # One byte more than declared detects a larger chunk.
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, size + 1))
    except (RuntimeError, EOFError, ValueError) as error:
        raise BadChunk(f"its lz4 data are damaged ({error})") from error


def _unpack_bz2(packed: bytes, size: int) -> bytes:
    try:
        import bz2
    except ImportError as error:
        raise BadChunk("it is compressed with bz2, and this Python was built without it") from error
    try:
        return bz2.BZ2Decompressor().decompress(packed, size + 1)
    except (OSError, EOFError, ValueError) as error:
        raise BadChunk(f"its bz2 data are damaged ({error})") from error


def _grow(read: Callable[[int], bytes], size: int) -> bytes:
    data = bytearray()
    while len(data) <= size and (part := read(_CHUNK_STEP)):
        data += part
    return bytes(data)


_UNPACK: Final[dict[str, Callable[[bytes, int], bytes]]] = {
    "": _plain,
    "zstd": unpack_zstd,
    "lz4": _unpack_lz4,
    "none": _plain,
    "bz2": _unpack_bz2,
}
"""The compressions of MCAP, https://mcap.dev/spec/registry#compression-formats, and of ROS 1 bags."""
