"""Unpacked chunks: as many bytes as declared, or a refusal."""

from __future__ import annotations

import pytest
import zstandard

from reba.readers.mcap.bytes import BadChunk, unpack, unpack_zstd
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
