"""C3D (biomechanics): marker positions in metres; analog channels and model outputs are only listed.

Source: C3D User Guide. A point is a gap where its fourth word is negative ("Residual") or a coordinate is not finite.
"""

from __future__ import annotations

import itertools
import math
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.errors import ReadError
from reba.readers.formats.file_content import file_bytes
from reba.readers.formats.lengths import metres, metres_by_size
from reba.readers.formats.marker_sets import marker_recording
from reba.readers.recording.stream import ReadLog, Recording, Topic

OUTPUT_GROUPS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "BONES", "REACTIONS")
"""Parameters of the group POINT that name points without position (Vicon model outputs)."""
FARTHEST = 1000.0
"""[m] Largest distance from the origin; no capture volume is larger, so points beyond are damaged and become gaps."""
MAX_RATE = 1e5


def sniff(path: Path, head: bytes) -> bool:
    """Return whether the first bytes are a C3D header: the parameter block, then 0x50."""
    return len(head) > 2 and head[1] == MAGIC and 2 <= head[0] <= 16


def open_c3d(path: Path) -> Recording:
    """Open a C3D file: points in metres, NaN in gaps, one stream per subject; frame 1 is at time 0."""
    log = ReadLog(time_source="frame rate")
    data = file_bytes(path, log)
    layout = read_layout(path, data)
    if not layout.points:
        raise ReadError(path, "no points", offset=2, hint="export the trial with its markers")
    rate = layout.number("POINT", "RATE") or layout.rate
    if not 0 < rate < MAX_RATE:
        raise ReadError(path, f"the frame rate is {rate:g} Hz, expected above 0", offset=20, hint=HINT)
    points = _points(path, data, layout, log)
    unit = next(iter(layout.texts("POINT", "UNITS")), "")
    points *= metres(path, unit, "POINT:UNITS") if unit else metres_by_size(points, log, "mm")
    far = np.abs(points).max(axis=2, initial=0.0) > FARTHEST
    if far.any():
        log.warn(f"{int(far.sum())} positions are more than {FARTHEST:g} m from the origin; they were read as gaps")
        points[far] = np.nan
    time = (np.arange(len(points)) + max(layout.first - 1, 0)) / rate
    labels, outputs = _labels(layout)
    topics = [
        Topic(group.lower(), "C3D model output", len(points), False, f"{count} outputs, no positions")
        for group, count in outputs.items()
    ]
    if layout.analogs:
        channels = layout.number("ANALOG", "USED")
        which = f"{channels:g} channels" if channels else f"{layout.analogs} values in a frame"
        topics.append(Topic("analog", "C3D analog", len(points), False, f"{which}: force plates, EMG and the like"))
    # Vicon states the vertical as the upward direction of the screen; other programs use the minus sign differently.
    screen = (layout.texts("POINT", "Y_SCREEN") or [""])[0].lower()
    up = screen[1:] if screen in ("+x", "+y", "+z") else ""
    return marker_recording(path, ("c3d", "C3D markers"), labels, time, points, log, topics=topics, up=up)


def _points(path: Path, data: bytes, layout: C3dHeader, log: ReadLog) -> Array:
    """Return (n, k, 3) points in the unit of the file, NaN in gaps, of the complete frames."""
    size = 4 if layout.scale < 0 else 2
    width = 4 * layout.points + layout.analogs
    available = (len(data) - layout.start) // (width * size)
    count = min(available, layout.frames)
    if count < 1:
        raise ReadError(path, "no complete frame after the header", offset=layout.start, hint=HINT)
    if count < layout.frames:
        log.ended_abnormally = (
            f"truncated at byte {len(data)}: {count} of {layout.frames} frames are complete; those were read"
        )
    # The last block is filled up to its end.
    if (available - count) * width * size >= BLOCK:
        if layout.first + layout.frames - 1 == MOST_COUNTED:
            what = f"the file counts up to {MOST_COUNTED} frames and has {available}; those were read"
            count = available
        else:
            what = f"the header states {count} frames and the file has room for {available - count} more; not read"
        log.warn(what)
    raw = data[layout.start : layout.start + count * width * size]
    with np.errstate(all="ignore"):
        if size == 4:
            words: Array = floats(raw, layout.processor).reshape(count, width).astype(np.float64)
            scale = 1.0
        else:
            words = np.frombuffer(raw, ORDERS[layout.processor] + "i2").reshape(count, width).astype(np.float64)
            scale = layout.scale
        cells = words[:, : 4 * layout.points].reshape(count, layout.points, 4)
        points = cells[..., :3] * scale
        gap = ~np.isfinite(points).all(axis=2) | ~(cells[..., 3] >= 0)
    points[gap] = np.nan
    return points


def _labels(layout: C3dHeader) -> tuple[list[str], dict[str, int]]:
    """Return a label per point, "" for points that are not markers, and the number of points of each output group."""
    labels = list(layout.texts("POINT", "LABELS"))
    for number in itertools.count(2):
        more = layout.texts("POINT", f"LABELS{number}")
        if not more:
            break
        labels += more
    labels = (labels + [""] * layout.points)[: layout.points]
    outputs: dict[str, int] = {}
    for group in OUTPUT_GROUPS:
        named = set(layout.texts("POINT", group)) - {""}
        members = [index for index, label in enumerate(labels) if label in named or label.rpartition(":")[2] in named]
        if members:
            outputs[group] = len(members)
        for index in members:
            labels[index] = ""
    return labels, outputs


BLOCK = 512
MOST_COUNTED = 0xFFFF
"""Number of the last frame that a header can state."""
MAGIC = 0x50
ORDERS = {84: "<", 85: "<", 86: ">"}
"""Processor type in the parameter section: 84 Intel, 85 DEC (VAX floats), 86 MIPS; byte order of its integers."""
DEC = 85
MAX_RECORDS = 10_000
"""More groups and parameters than any file has; ends a damaged chain."""
HINT = "the file is damaged: export or copy it again"
Value = list[str] | Array


@dataclass(frozen=True)
class C3dHeader:
    """Header and parameters of a C3D file.

    Attributes:
        points: markers in a frame.
        analogs: analog values in a frame, all channels.
        first: number of the first frame, from 1.
        frames: frames stated.
        scale: [unit] per step of integer points; negative for points stored as floats.
        start: byte of the first frame.
        rate: frames per second as the header states it [Hz].
        processor: a key of `ORDERS`.
        parameters: by group and name in upper case; text as a list, numbers flat.
    """

    points: int
    analogs: int
    first: int
    frames: int
    scale: float
    start: int
    rate: float
    processor: int
    parameters: dict[tuple[str, str], Value]

    def texts(self, group: str, name: str) -> list[str]:
        """Return a text parameter, [] where it is missing or not text."""
        value = self.parameters.get((group, name), [])
        return value if isinstance(value, list) else []

    def number(self, group: str, name: str) -> float | None:
        """Return the first number of a parameter, None where it is missing or not a number."""
        value = self.parameters.get((group, name), [])
        return None if isinstance(value, list) or not len(value) else float(value[0])


def read_layout(path: Path, data: bytes) -> C3dHeader:
    """Return the header and parameters of a C3D file."""
    if len(data) < 2 * BLOCK or data[1] != MAGIC:
        raise ReadError(path, "not a C3D header", offset=0, hint="give a .c3d file; " + HINT)
    section = (data[0] - 1) * BLOCK
    if section < BLOCK or section + 4 > len(data):
        raise ReadError(path, f"the header points to parameters in block {data[0]}", offset=0, hint=HINT)
    processor = data[section + 3]
    if processor not in ORDERS:
        raise ReadError(path, f"processor type {processor}, expected 84, 85 or 86", offset=section + 3, hint=HINT)
    order = ORDERS[processor]
    points, analogs, first, last = struct.unpack_from(order + "4H", data, 2)
    (start,) = struct.unpack_from(order + "H", data, 16)
    scale, rate = (_float(data, at, processor) for at in (12, 20))
    parameters = _parameters(path, data, section + 4, processor)
    layout = C3dHeader(
        points, analogs, first, last - first + 1, scale, (start - 1) * BLOCK, rate, processor, parameters
    )
    _check(path, layout, len(data))
    if last == MOST_COUNTED:
        return _with_long_count(layout)
    return layout


def _check(path: Path, layout: C3dHeader, size: int) -> None:
    used = layout.number("POINT", "USED")
    if used is not None and int(used) & 0xFFFF != layout.points:
        what = f"the header states {layout.points} points and POINT:USED {used:g}"
        raise ReadError(path, what, offset=2, hint=HINT)
    if not BLOCK <= layout.start <= size:
        raise ReadError(path, f"the header points to frames at byte {layout.start} of {size}", offset=16, hint=HINT)
    if layout.frames < 1:
        raise ReadError(path, "the header states no frame", offset=6, hint="export the trial with its frames")
    if not (np.isfinite(layout.scale) and layout.scale):
        raise ReadError(path, f"the scale of points is {layout.scale}", offset=12, hint=HINT)


def _with_long_count(layout: C3dHeader) -> C3dHeader:
    """Return the header with the frame count of the parameters, for more frames than 16 bits can count."""
    counts = [float(layout.frames)]
    counts += [layout.number("POINT", name) or 0.0 for name in ("FRAMES", "LONG_FRAMES")]
    fields = [layout.parameters.get(("TRIAL", f"ACTUAL_{end}_FIELD")) for end in ("START", "END")]
    words = [field for field in fields if isinstance(field, np.ndarray) and len(field) == 2]
    if len(words) == 2:
        # Two 16-bit words each, the low one first.
        low, high = (words[1] % 65536 - words[0] % 65536).tolist()
        counts.append(low + 65536 * high + 1)
    best = max(count for count in counts if np.isfinite(count))
    return C3dHeader(**{**vars(layout), "frames": int(best)})


def _parameters(path: Path, data: bytes, at: int, processor: int) -> dict[tuple[str, str], Value]:
    """Return the parameters by group and name, from the chain of records that starts at byte `at`."""
    order = ORDERS[processor]
    groups: dict[int, str] = {}
    parameters: list[tuple[int, str, Value]] = []
    for _ in range(MAX_RECORDS):
        if at + 2 > len(data):
            raise ReadError(path, "the parameters exceed the end of the file", offset=at, hint=HINT)
        length, number = struct.unpack_from("bb", data, at)
        length = abs(length)
        if length == 0:
            break
        body = at + 2 + length
        if body + 4 > len(data):
            raise ReadError(path, "a parameter exceeds the end of the file", offset=at, hint=HINT)
        name = data[at + 2 : body].decode("latin-1").strip().upper()
        (step,) = struct.unpack_from(order + "H", data, body)
        if number < 0:
            groups[-number] = name
        else:
            parameters.append((number, name, _value(path, data, body + 2, processor)))
        if step == 0:
            break
        at = body + step
    return {(groups.get(number, ""), name): value for number, name, value in parameters}


def _value(path: Path, data: bytes, at: int, processor: int) -> Value:
    """Return the value of one parameter whose type is at byte `at`."""
    kind, dimensions = struct.unpack_from("bB", data, at)
    shape = list(data[at + 2 : at + 2 + dimensions])
    first = at + 2 + dimensions
    count = math.prod(shape)
    if kind not in (-1, 1, 2, 4) or dimensions > 7 or first + count * abs(kind) > len(data):
        raise ReadError(path, f"a parameter of type {kind} with sizes {shape[:7]}", offset=at, hint=HINT)
    raw = data[first : first + count * abs(kind)]
    if kind == -1:
        width = shape[0] if shape else 1
        text = raw.decode("latin-1")
        return [text[begin : begin + width].strip(" \0") for begin in range(0, count, width)] if width else []
    if kind == 4:
        return floats(raw, processor).astype(np.float64)
    order = ORDERS[processor]
    return np.frombuffer(raw, "u1" if kind == 1 else order + "i2").astype(np.float64)


def floats(raw: bytes, processor: int) -> NDArray[np.float32]:
    """Return 32-bit floats; DEC floats have swapped halves and, read as IEEE 754, four times their value."""
    if processor != DEC:
        return np.frombuffer(raw, ORDERS[processor] + "f4").astype(np.float32)
    halves = np.frombuffer(raw, "<u2").astype(np.uint16).reshape(-1, 2)[:, ::-1]
    with np.errstate(all="ignore"):
        return np.ascontiguousarray(halves).view(np.float32).ravel() / np.float32(4)


def _float(data: bytes, at: int, processor: int) -> float:
    return float(floats(data[at : at + 4], processor)[0])
