"""Messages that were compressed one by one, as `ros2 bag record --compression-mode message` does.

Only `metadata.yaml` says so, and that is often missing: each message is judged by itself. A CDR message begins with a
zero byte, a zstd frame with its magic number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reba.readers.mcap.bytes import MOST_RATIO, ZSTD_MAGIC, zstd
from reba.readers.mcap.records import BadRecord, Channel, Scan, gather
from reba.readers.mcap.store import ChunkRef


class MessageUnpacker:
    """Unpacks the messages of one file.

    Args:
        limit_bytes: to which those of one segment may unpack.
        packed_size: of the file [bytes], which bounds the sum over all segments.
    """

    def __init__(self, limit_bytes: int, packed_size: int) -> None:
        self._limit = limit_bytes
        self._left = limit_bytes + MOST_RATIO * packed_size

    def unpacked(
        self, segment: ChunkRef, data: bytes, scan: Scan, channels: Mapping[int, Channel], head: int
    ) -> tuple[bytes, Scan]:
        """Return the records of a segment in which no message is packed.

        A message that cannot be unpacked is left as it is; its decoder counts it as undecodable.

        Args:
            channels: by number; messages of those in CDR may be packed.
            head: bytes before the payload of each message, which are kept.

        Raises:
            BadRecord: the messages declare to unpack to more than a file of this size can hold.
        """
        cdr = [number for number, channel in channels.items() if channel.encoding == "cdr"]
        packed = _packed(data, scan, cdr)
        if not packed.any():
            return data, scan
        zstandard, decompressor = zstd()
        most = min(self._limit, self._left + segment.unpacked)
        parts: list[bytes] = []
        lengths = scan.lengths.copy()
        total = 0
        for index, (start, length) in enumerate(zip(scan.payloads.tolist(), scan.lengths.tolist(), strict=True)):
            payload = data[start : start + length]
            if packed[index]:
                try:
                    size = zstandard.frame_content_size(payload)
                    total += max(size, 0)
                    if total > most:
                        raise BadRecord(start - head, f"messages declare more than the {most} bytes they may unpack to")
                    payload = decompressor.decompress(payload) if size > 0 else payload
                except zstandard.ZstdError:
                    pass
            parts += [data[start - head : start], payload]
            lengths[index] = len(payload)
        self._left -= max(total - segment.unpacked, 0)
        segment.unpacked = max(total, segment.unpacked)
        payloads = np.cumsum(lengths + head) - lengths
        return b"".join(parts), replace(scan, payloads=payloads, lengths=lengths, definitions=())


def _packed(data: bytes, scan: Scan, channels: list[int]) -> NDArray[np.bool_]:
    """Return (n,) which messages of the channels begin with the magic number of zstd."""
    width = len(ZSTD_MAGIC)
    mine = scan.lengths > width
    if mine.any():
        heads = gather(np.frombuffer(data, np.uint8), scan.payloads[mine], width).view("<u4")[:, 0]
        mine[mine] = heads == int.from_bytes(ZSTD_MAGIC, "little")
    return mine & np.isin(scan.channels, channels) if mine.any() else mine
