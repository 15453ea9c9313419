"""Unpacked chunks: as many bytes as declared, or a refusal."""

from __future__ import annotations

import importlib.util
import sys
import zlib
from unittest import mock

import pytest
import zstandard

from reba.readers.mcap.bytes import BadChunk, _crc32, crc32, unpack, unpack_zstd
from tests.support.says import says


@pytest.mark.parametrize("size", [0, 1])
def test_a_large_chunk_is_unpacked_up_to_its_declared_size(size: int) -> None:
    data = bytes(range(256)) * 40
    packed = zstandard.ZstdCompressor(write_content_size=False).compress(data)
    if size:
        assert len(unpack_zstd(packed, len(data) - size, one_call=10)) > len(data) - size
        with pytest.raises(BadChunk) as caught:
            unpack(packed, "zstd", len(data) - size)
        says(caught, "zstd")
    else:
        assert unpack_zstd(packed, len(data), one_call=10) == unpack(packed, "zstd", len(data)) == data


@pytest.mark.parametrize("faster", [True, False])
def test_the_crc_is_the_same_with_zlib_ng_and_without(faster: bool) -> None:
    data = bytes(range(256)) * 40
    _crc32.cache_clear()
    with mock.patch.dict(sys.modules, {} if faster else {"zlib_ng": None}):
        assert crc32(data) == zlib.crc32(data)
        assert (_crc32() is zlib.crc32) is not (faster and importlib.util.find_spec("zlib_ng") is not None)
    _crc32.cache_clear()
