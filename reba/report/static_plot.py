"""REBA over time as plain SVG: what stands in print, without scripts, and until the interactive plot is drawn."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.report.figures import TOP, drawn_gaps, level_bands, time_range
from reba.report.phrases import span
from reba.report.recording import Recording
from reba.report.series import band, line, steps
from reba.report.worst import Worst
from reba.tables import ACTION_LEVEL_FROM

Array = NDArray[np.float64]

_LEFT, _RIGHT, _UP, _DOWN = 30.0, 832.0, 22.0, 272.0
_BUCKETS: Final = 800
_BOTTOM: Final = 0.5


def time_svg(record: Recording, intervals: list[Worst], length: float) -> str:
    """Return the SVG; `length` [s] is that of the time axis."""
    start, end = time_range(record, length)

    def x(seconds: Array) -> Array:
        return _LEFT + (np.asarray(seconds) - start) / ((end - start) or 1.0) * (_RIGHT - _LEFT)

    def y(score: Array) -> Array:
        return _DOWN - (np.asarray(score) - _BOTTOM) / (TOP - _BOTTOM) * (_DOWN - _UP)

    parts = []
    for first, last, colour, _ in level_bands():
        top, bottom = y(np.array([last, first])).tolist()
        parts.append(_rect(_LEFT, top, _RIGHT - _LEFT, bottom - top, f'fill="{colour}" fill-opacity="0.45"'))
    for first, last in drawn_gaps(record):
        a, b = x(np.array([first, last])).tolist()
        parts.append(_rect(a, _UP, b - a, _DOWN - _UP, 'class="gap"'))
    for one in intervals:
        a, b = x(np.array([one.start, one.end])).tolist()
        parts.append(_rect(a, _UP, max(b - a, 1.0), _DOWN - _UP, 'class="worst"'))
    total = record.curves["reba"]
    points = steps(record.scores, total, record.gaps, _BUCKETS)
    low, high, value = (part[points.frame] for part in (total.low, total.high, total.value))
    px, py = band(points, low, high, low < high)
    parts.append(f'<path class="range" d="{_path(x(px), y(py), closed=True)}"/>')
    lx, ly = line(points, value, ~np.isnan(value))
    parts.append(f'<path class="score" d="{_path(x(lx), y(ly), closed=False)}"/>')
    for first, last, _, name in level_bands():
        middle = float(y(np.array((first + last) / 2)))
        parts.append(f'<text class="level" x="{_RIGHT + 6:g}" y="{middle + 4:.1f}">{name}</text>')
    for score in (*ACTION_LEVEL_FROM, 15):
        parts.append(f'<text class="tick" x="{_LEFT - 6:g}" y="{float(y(np.array(score))) + 4:.1f}">{score}</text>')
    for one in intervals:
        at = float(x(np.array(one.time)))
        parts.append(f'<rect class="number" x="{at - 8:.1f}" y="3" width="16" height="16" rx="3"/>')
        parts.append(f'<text class="number" x="{at:.1f}" y="15.5">{one.number}</text>')
    for tick in _ticks(start, end):
        at = float(x(np.array(tick)))
        parts.append(f'<line class="axis" x1="{at:.1f}" y1="{_DOWN:g}" x2="{at:.1f}" y2="{_DOWN + 5:g}"/>')
        parts.append(f'<text class="time" x="{at:.1f}" y="{_DOWN + 18:g}">{tick:g}</text>')
    parts.append(f'<text class="time" x="{(_LEFT + _RIGHT) / 2:g}" y="{_DOWN + 34:g}">time [s]</text>')
    opening = f'<svg class="timeline" viewBox="0 0 900 308" role="img" aria-label="{time_label(record)}">'
    return f"{opening}{''.join(parts)}</svg>"


def time_label(record: Recording) -> str:
    """Return what the plot over time shows, for people who cannot see it."""
    ends = record.summary["range"]
    return (
        f"REBA over time from {record.scores.time[0]:.1f} to {record.scores.time[-1]:.1f} s: "
        f"median {span(ends['median_low'], ends['median_high'])}, p90 {span(ends['p90_low'], ends['p90_high'])}, "
        f"highest {span(ends['max_low'], ends['max_high'])}; {len(record.gaps)} gaps without samples"
    )


def _rect(x: float, y: float, width: float, height: float, look: str) -> str:
    return f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" {look}/>'


def _path(x: Array, y: Array, *, closed: bool) -> str:
    """Return path commands; NaN starts a new piece, a piece that is not closed holds each value to the next point."""
    drawn: list[str] = []
    fresh = True
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if a != a or b != b:
            drawn += ["Z"] if closed else []
            fresh = True
        elif fresh:
            drawn.append(f"M{a:.1f} {b:.1f}")
            fresh = False
        else:
            drawn.append(f"L{a:.1f} {b:.1f}" if closed else f"H{a:.1f}V{b:.1f}")
    return "".join(drawn) + ("Z" if closed and drawn else "")


def _ticks(start: float, end: float) -> list[float]:
    """Return about eight round times between the ends of the axis."""
    rough = (end - start) / 8 or 1.0
    power = 10.0 ** np.floor(np.log10(rough))
    step = float(next(power * factor for factor in (1, 2, 5, 10) if power * factor >= rough))
    return [round(value, 6) + 0.0 for value in np.arange(np.ceil(start / step) * step, end, step).tolist()]
