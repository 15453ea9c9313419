"""Unpacking a chunk: never more memory than its bytes can fill, never another size than the chunk declares."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Final

_AT_ONCE: Final = 1 << 26
"""Chunks up to this size [bytes] are unpacked in one call; larger ones grow with the bytes that really come out."""
_STEP: Final = 1 << 24
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
    while len(data) <= size and (part := read(_STEP)):
        data += part
    return bytes(data)


_UNPACK: Final[dict[str, Callable[[bytes, int], bytes]]] = {
    "": _plain,
    "zstd": _unpack_zstd,
    "lz4": _unpack_lz4,
}
"""The well-known compressions, https://mcap.dev/spec/registry#well-known-compression-formats."""
