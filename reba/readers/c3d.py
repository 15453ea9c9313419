"""C3D (biomechanics): marker positions in metres; analog channels and model outputs are only listed.

The layout comes from `c3d_layout.py`. A point is a gap where its fourth word is negative (C3D User Guide, "Residual")
or a coordinate is no number.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reba.errors import ReadError
from reba.readers.c3d_layout import HINT, MAGIC, ORDERS, Layout, floats, read_layout
from reba.readers.markers import marker_recording, metres
from reba.readers.stream import ReadLog, Recording, Topic
from reba.readers.text import read_bytes

OUTPUT_GROUPS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "BONES", "REACTIONS")
"""Parameters of the group POINT that name points which are no positions (Vicon model outputs)."""

FARTHEST = 1000.0
"""[m] from the origin; no capture volume is larger, so what lies beyond is damage and becomes a gap."""

MAX_RATE = 1e5


def sniff(path: Path, head: bytes) -> bool:
    """Return whether the first bytes are a C3D header: the parameter block, then 0x50."""
    return len(head) > 2 and head[1] == MAGIC and 2 <= head[0] <= 16


def open_c3d(path: Path) -> Recording:
    """Open a C3D file: points in metres, NaN in gaps, one stream per subject; frame 1 is at time 0.

    Raises:
        ReadError: the header, a parameter, the unit or the rate is damaged, or there is no whole frame.
    """
    log = ReadLog(time_source="frame rate")
    data = read_bytes(path)
    layout = read_layout(path, data)
    if not layout.points:
        raise ReadError(path, "it has no points", offset=2, hint="export the trial with its markers")
    rate = layout.number("POINT", "RATE") or layout.rate
    if not 0 < rate < MAX_RATE:
        raise ReadError(path, f"the frame rate is {rate:g} Hz", offset=20, hint=HINT)
    units = layout.texts("POINT", "UNITS")
    if not units or not units[0]:
        log.warn("the file states no unit of length; mm was assumed")
    scale = metres(path, units[0] if units and units[0] else "mm", "POINT:UNITS")
    points = _points(path, data, layout, log) * scale
    far = np.abs(points).max(axis=2, initial=0.0) > FARTHEST
    if far.any():
        log.warn(f"{int(far.sum())} positions lie more than {FARTHEST:g} m away; they were read as gaps")
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
    # Vicon states the vertical as the upward direction of the screen; with a minus sign others mean something else.
    screen = (layout.texts("POINT", "Y_SCREEN") or [""])[0].lower()
    up = screen[1:] if screen in ("+x", "+y", "+z") else ""
    return marker_recording(path, ("c3d", "C3D markers"), labels, time, points, log, topics=topics, up=up)


def _points(path: Path, data: bytes, layout: Layout, log: ReadLog) -> NDArray[np.float64]:
    """Return (n, k, 3) points in the unit of the file, NaN in gaps, of the whole frames that are there."""
    size = 4 if layout.scale < 0 else 2
    width = 4 * layout.points + layout.analogs
    there = (len(data) - layout.start) // (width * size)
    count = min(there, layout.frames)
    if count < 1:
        raise ReadError(path, "no whole frame behind the header", offset=layout.start, hint=HINT)
    if count < layout.frames:
        log.ended_abnormally = f"cut at byte {len(data)}: {count} of {layout.frames} frames are whole; those were read"
    raw = data[layout.start : layout.start + count * width * size]
    with np.errstate(all="ignore"):
        if size == 4:
            words: NDArray[np.float64] = floats(raw, layout.processor).reshape(count, width).astype(np.float64)
            scale = 1.0
        else:
            words = np.frombuffer(raw, ORDERS[layout.processor] + "i2").reshape(count, width).astype(np.float64)
            scale = layout.scale
        cells = words[:, : 4 * layout.points].reshape(count, layout.points, 4)
        points = cells[..., :3] * scale
        gap = ~np.isfinite(points).all(axis=2) | ~(cells[..., 3] >= 0)
    points[gap] = np.nan
    return points


def _labels(layout: Layout) -> tuple[list[str], dict[str, int]]:
    """Return a label per point, "" for what is no marker, and how many points each output group names."""
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
        hits = [index for index, label in enumerate(labels) if label in named or label.rpartition(":")[2] in named]
        if hits:
            outputs[group] = len(hits)
        for index in hits:
            labels[index] = ""
    return labels, outputs
