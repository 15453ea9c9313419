"""The bytes of a recording: positioned reads of a plain file, or of a zstd-compressed one unpacked to a temporary file.

Plain reads instead of a memory map: resident memory stays at one chunk, and a file that shrinks while it is read
(one that is still being recorded or copied) gives an error, not a bus error.
"""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import IO, Any, Final

from reba.errors import ReadError

MAGIC: Final = b"\x89MCAP0\r\n"
"""First and last bytes of an MCAP file, https://mcap.dev/spec#magic."""
ZSTD_MAGIC: Final = b"\x28\xb5\x2f\xfd"
"""First bytes of a zstd frame, RFC 8878 section 3.1.1; `ros2 bag record --compression-mode file` makes such files."""
_READ_STEP_FILE: Final = 1 << 22
_HEAD: Final = 18
"""The longest zstd frame header."""


class ByteSource:
    """Random access to the bytes of one recording.

    Attributes:
        path: the file that was given.
        size: bytes of the (unpacked) recording.

    Raises:
        ReadError: the file is absent, empty, no MCAP file, or unpacks to more than `limit_bytes`.
    """

    def __init__(self, path: Path, limit_bytes: int) -> None:
        self.path = path
        try:
            self._file: IO[bytes] = path.open("rb", buffering=0)
        except OSError as error:
            raise ReadError(
                path, f"cannot be opened ({error.strerror})", hint="check the path and its permissions"
            ) from error
        # The file closes when the last stream of the recording goes.
        weakref.finalize(self, self._file.close)
        self.size = self._end()
        if self.size == 0:
            raise ReadError(path, "the file is empty", hint="record it again; the recorder wrote nothing")
        if self.read_at(0, 4) == ZSTD_MAGIC:
            self._file = _unpack(path, self._file, limit_bytes)
            weakref.finalize(self, self._file.close)
            self.size = self._end()
        if self.read_at(0, len(MAGIC)) != MAGIC:
            raise ReadError(path, "does not start with the MCAP magic bytes", hint="give an .mcap recording", offset=0)

    def _end(self) -> int:
        return self._file.seek(0, 2)

    def refresh(self) -> bool:
        """Take up what was appended to the file; return whether its size changed."""
        before, self.size = self.size, self._end()
        return self.size != before

    def read_at(self, offset: int, count: int) -> bytes:
        """Return up to `count` bytes from `offset`, fewer only at the end of the file.

        Raises:
            ReadError: the system cannot read there.
        """
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


def _unpack(path: Path, packed: IO[bytes], limit_bytes: int) -> IO[bytes]:
    """Unpack a zstd-compressed recording to an unnamed temporary file."""
    import zstandard

    too_big = ReadError(
        path,
        f"unpacks to more than {limit_bytes} bytes",
        hint="unpack it with `zstd -d` and give the .mcap file, or raise limit_bytes",
    )
    packed.seek(0)
    if zstandard.frame_content_size(packed.read(_HEAD)) > limit_bytes:
        raise too_big
    # Closed by the finalizer of the source that owns it.
    unpacked = tempfile.TemporaryFile()  # noqa: SIM115
    packed.seek(0)
    try:
        with zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True, closefd=False) as reader:
            while part := reader.read(_READ_STEP_FILE):
                unpacked.write(part)
                if unpacked.tell() > limit_bytes:
                    raise too_big
    except zstandard.ZstdError as error:
        unpacked.close()
        raise ReadError(path, f"is a damaged zstd file ({error})", hint="copy or record the file again") from error
    except ReadError:
        unpacked.close()
        raise
    return unpacked


_AT_ONCE: Final = 1 << 26
"""Chunks up to this size [bytes] are unpacked in one call; larger ones grow with the bytes that really come out."""
_READ_STEP: Final = 1 << 24
_LZ4_MOST: Final = 256
"""An lz4 block cannot unpack to more than 255 times its size (LZ4 block format, "Limits")."""


class BadChunk(Exception):
    """The bytes of a chunk cannot be unpacked to what the chunk declares."""


def unpack(packed: bytes, compression: str, size: int) -> bytes:
    """Return the `size` bytes that a chunk holds.

    Raises:
        BadChunk: unknown compression, damaged bytes, another size than declared, or memory runs out.
    """
    if compression not in _UNPACK:
        known = ", ".join(repr(name) for name in _UNPACK)
        raise BadChunk(f"the chunk is compressed with {compression!r}, known are {known}")
    try:
        data = _UNPACK[compression](packed, size)
    except MemoryError as error:
        raise BadChunk(f"memory is too small for a chunk of {size} bytes") from error
    if len(data) != size:
        raise BadChunk(f"the chunk unpacks to {len(data)} bytes, not to the {size} that it declares")
    return data


def _plain(packed: bytes, size: int) -> bytes:
    return packed


@cache
def _zstd() -> tuple[Any, Any]:
    import zstandard

    return zstandard, zstandard.ZstdDecompressor()


def _unpack_zstd(packed: bytes, size: int) -> bytes:
    zstandard, decompressor = _zstd()
    try:
        inside = zstandard.frame_content_size(packed)
        if inside not in (-1, size):
            raise BadChunk(f"the chunk declares {size} bytes, its zstd frame {inside}")
        if size <= _AT_ONCE:
            return bytes(decompressor.decompress(packed, max_output_size=size)) if size else b""
        with decompressor.stream_reader(packed) as reader:
            return _grow(reader.read, size)
    except zstandard.ZstdError as error:
        raise BadChunk(f"its zstd data are damaged ({error})") from error


def _unpack_lz4(packed: bytes, size: int) -> bytes:
    import lz4.frame

    if size > len(packed) * _LZ4_MOST:
        raise BadChunk(f"{len(packed)} bytes of lz4 cannot hold the {size} that the chunk declares")
    try:
        # One byte more than declared shows that there is more.
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, size + 1))
    except (RuntimeError, EOFError, ValueError) as error:
        raise BadChunk(f"its lz4 data are damaged ({error})") from error


def _grow(read: Callable[[int], bytes], size: int) -> bytes:
    data = bytearray()
    while len(data) <= size and (part := read(_READ_STEP)):
        data += part
    return bytes(data)


_UNPACK: Final[dict[str, Callable[[bytes, int], bytes]]] = {
    "": _plain,
    "zstd": _unpack_zstd,
    "lz4": _unpack_lz4,
}
"""The well-known compressions, https://mcap.dev/spec/registry#well-known-compression-formats."""
