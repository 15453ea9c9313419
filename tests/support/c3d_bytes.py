"""Small C3D files for tests, byte by byte as the C3D User Guide lays them out."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import ArrayLike

INTEL, DEC, MIPS = 84, 85, 86


def c3d_bytes(
    labels: list[str],
    points: ArrayLike,
    *,
    rate: float = 100.0,
    unit: str = "mm",
    first: int = 1,
    scale: float = -1.0,
    processor: int = INTEL,
    analogs: int = 0,
    texts: dict[str, list[str]] | None = None,
) -> bytes:
    """Return a C3D file of `points` (n, k, 3) in the unit; a row with NaN is written as a gap.

    `scale` below 0 writes floats, above 0 integers of that step.
    """
    order = ">" if processor == MIPS else "<"
    xyz = np.asarray(points, dtype=np.float64)
    frames, count = xyz.shape[:2]
    parameters = b"\x01\x50\x00" + bytes([processor]) + _group(order, 1, "POINT")
    parameters += _parameter(order, 1, "USED", 2, [], struct.pack(order + "H", count))
    parameters += _parameter(order, 1, "RATE", 4, [], _floats([rate], processor))
    for name, entries in {"UNITS": [unit], "LABELS": labels, **(texts or {})}.items():
        width = max(map(len, entries), default=0)
        raw = b"".join(entry.encode("latin-1").ljust(width) for entry in entries)
        parameters += _parameter(order, 1, name, -1, [width, len(entries)], raw)
    parameters += b"\0\0"
    blocks = -(-len(parameters) // 512)
    start = 2 + blocks
    header = bytes([2, 0x50]) + struct.pack(order + "5H", count, analogs, first, first + frames - 1, 0)
    header += _floats([scale], processor) + struct.pack(order + "2H", start, int(analogs > 0))
    header += _floats([rate], processor)
    cells = np.concatenate([np.nan_to_num(xyz), np.where(np.isnan(xyz).any(axis=2), -1.0, 0.0)[..., None]], axis=2)
    if scale > 0:
        cells[..., :3] = np.round(cells[..., :3] / scale)
    rows = np.concatenate([cells.reshape(frames, -1), np.full((frames, analogs), 7.0)], axis=1)
    data = _floats(rows, processor) if scale < 0 else rows.astype(order + "i2").tobytes()
    return header.ljust(512, b"\0") + parameters.ljust(512 * blocks, b"\0") + data


def _floats(values: ArrayLike, processor: int) -> bytes:
    numbers = np.asarray(values, dtype=np.float64).ravel()
    if processor == DEC:
        halves = (numbers * 4).astype("<f4").view("<u2").reshape(-1, 2)[:, ::-1]
        return halves.tobytes()
    return numbers.astype(">f4" if processor == MIPS else "<f4").tobytes()


def _group(order: str, number: int, name: str) -> bytes:
    return struct.pack("bb", len(name), -number) + name.encode() + struct.pack(order + "H", 3) + b"\0"


def _parameter(order: str, number: int, name: str, kind: int, shape: list[int], raw: bytes) -> bytes:
    body = struct.pack("bB", kind, len(shape)) + bytes(shape) + raw + b"\0"
    return struct.pack("bb", len(name), number) + name.encode() + struct.pack(order + "H", 2 + len(body)) + body
