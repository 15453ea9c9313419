"""Plots of REBA over time: for notebooks as a plotly figure, static as SVG for print."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from reba.analysis.score_table import ScoreTable
from reba.analysis.wording import seconds, span
from reba.arrays import Array
from reba.errors import PostureError
from reba.method.tables import ACTION_LEVEL_FROM, ACTION_LEVELS
from reba.posture.factors import ACTIVITIES, flag
from reba.report.findings import WorstInterval, worst_intervals
from reba.report.labels import LEVEL_COLOURS
from reba.report.series import (
    PARTS_OF_MEANS,
    VIEWS,
    Curve,
    StepCurve,
    band,
    changes,
    flag_intervals,
    line,
    part_means,
    steps,
)
from reba.report.summary import RecordingSummary, summarise

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

INK: Final = "#1b2430"
RANGE_FILL: Final = "rgba(72, 52, 170, 0.42)"
RANGE_LINE: Final = "#403a82"
GAP_FILL: Final = "rgba(110, 118, 130, 0.28)"
TOP: Final = 15.6
"""Upper end of the score axis: the highest score with a margin."""
LONG: Final = 900.0
"""[s] Time axes that are longer are in minutes, here and on the page (`score_track.js`)."""
MAX_GAPS: Final = 200
"""Gaps drawn as grey areas, the longest ones; lines are interrupted at every gap."""


def level_bands() -> list[tuple[float, float, str, str]]:
    """Return (from, to, colour, name) of each action level on the score axis; edges lie half way between scores."""
    edges = [start - 0.5 for start in ACTION_LEVEL_FROM] + [TOP]
    return [(edges[i], edges[i + 1], LEVEL_COLOURS[i], ACTION_LEVELS[i][0]) for i in range(len(LEVEL_COLOURS))]


def drawn_gaps(record: RecordingSummary) -> list[tuple[float, float]]:
    """Return the gaps that are drawn, in time order."""
    longest = sorted(record.gaps, key=lambda gap: gap[0] - gap[1])[:MAX_GAPS]
    return sorted(longest)


def time_range(record: RecordingSummary, span: float) -> list[float]:
    """Return the ends of the time axis [s]: `span` seconds from the first frame."""
    start = float(record.scores.time[0]) if record.frames else 0.0
    margin = 0.01 * span
    return [start - margin, start + span + margin]


def plot(scores: ScoreTable) -> Figure:
    """Return the plot of REBA over time with buttons for the totals of either arm.

    Raises:
        PostureError: there is no frame.
    """
    if not len(scores.data):
        raise PostureError("the scores have no frames, so there is nothing to draw")
    record = summarise(scores)
    figure = timeline(record, worst_intervals(record), record.length)
    buttons = [
        {
            "label": title,
            "method": "restyle",
            "args": [{"visible": [t.meta in (name, "activity") for t in figure.data]}],
        }
        for name, title in VIEWS.items()
    ]
    place = {"x": 0.0, "y": 1.0, "xanchor": "left", "yanchor": "bottom", "pad": {"b": 22}, "showactive": True}
    figure.update_layout(updatemenus=[{"type": "buttons", "direction": "right", "buttons": buttons, **place}])
    figure.update_layout(height=440, margin={"t": 90})
    return figure


def timeline(record: RecordingSummary, intervals: list[WorstInterval], span: float) -> Figure:
    """Return the plot of REBA over time: totals with their ranges, levels, gaps, worst intervals, activity.

    The recording has at least one frame; the time axis is `span` [s] long.
    """
    import plotly.graph_objects as go

    figure = go.Figure()
    for name in VIEWS:
        for trace in _curve_traces(record, record.curves[name], shown=name == "reba"):
            figure.add_trace(go.Scatter(**trace, meta=name))
    for trace in _activity_traces(record):
        figure.add_trace(go.Scatter(**trace, meta="activity"))
    figure.update_layout(
        **_layout("REBA", 400),
        shapes=[*_level_shapes(), *_gap_shapes(record), *_worst_shapes(intervals)],
        annotations=[*_level_names(), *_worst_numbers(intervals)],
        xaxis={**_TIME_AXIS, "range": time_range(record, span), "anchor": "y2"},
        yaxis={
            "domain": [0.2, 1.0], "range": [0.5, TOP], "tickvals": [1, 2, 4, 8, 11, 15], "fixedrange": True,
            "title": {"text": "REBA"}, "zeroline": False, "showgrid": False,
        },
        yaxis2={
            "domain": [0.0, 0.15], "range": [-0.6, 2.6], "tickvals": [0, 1, 2], "ticktext": list(reversed(ACTIVITIES)),
            "fixedrange": True, "zeroline": False, "showgrid": False, "tickfont": {"size": 11},
        },
    )  # fmt: skip
    return figure


def _curve_traces(record: RecordingSummary, curve: Curve, *, shown: bool) -> list[dict[str, Any]]:
    points = steps(record.scores, curve, record.gaps)
    low, high, value = (part[points.frame] for part in (curve.low, curve.high, curve.value))
    open_, known = low < high, ~np.isnan(value)
    style = {"mode": "lines", "visible": shown, "showlegend": False}
    traces: list[dict[str, Any]] = []
    if open_.any():
        x, y = band(points, low, high, open_)
        traces.append({**style, "x": _short(x), "y": y.astype(np.float32), "fill": "toself", "fillcolor": RANGE_FILL,
                       "line": {"width": 0}, "hoverinfo": "skip"})  # fmt: skip
        edge = {"width": 1, "color": RANGE_LINE, "shape": "hv"}
        x, y = line(points, low, open_)
        traces.append({**style, "x": _short(x), "y": y.astype(np.float32), "line": edge, "hoverinfo": "skip"})
        _, top = line(points, high, open_)
        hover = "%{x:.2f} s: REBA %{customdata} to %{y}<extra></extra>"
        traces.append({**style, "x": _short(x), "y": top.astype(np.float32), "line": edge, "customdata": y.tolist(),
                       "hovertemplate": hover})  # fmt: skip
    if known.any():
        x, y = line(points, value, known)
        traces.append({**style, "x": _short(x), "y": y.astype(np.float32), "hovertemplate": "%{x:.2f} s: REBA %{y}"
                       "<extra></extra>", "line": {"width": 1.6, "color": INK, "shape": "hv"}})  # fmt: skip
    return traces


def _activity_traces(record: RecordingSummary) -> list[dict[str, Any]]:
    n = record.frames
    frames = np.arange(n)
    last = np.zeros(n, bool)
    time = record.scores.time
    if n:
        last[np.searchsorted(time, [start for start, _ in record.gaps], side="right") - 1] = True
        last[-1] = True
    points = StepCurve(time, time + record.weights, last, frames)
    traces = []
    for row, kind in enumerate(reversed(ACTIVITIES)):
        flags = np.broadcast_to(flag(kind, getattr(record.scores.factors, kind), n), (n,))
        intervals = flag_intervals(points, flags, max_pause=record.seconds / 2000)
        x = [value for start, end in intervals for value in (start, end, None)]
        y = [value for _ in intervals for value in (row, row, None)]
        traces.append({
            "x": x, "y": y, "yaxis": "y2", "mode": "lines", "showlegend": False,
            "line": {"width": 7, "color": "#5c3c99"}, "hovertemplate": f"%{{x:.1f}} s: {kind}<extra></extra>",
        })  # fmt: skip
    return traces


def _level_shapes() -> list[dict[str, Any]]:
    return [
        {"type": "rect", "xref": "paper", "x0": 0, "x1": 1, "yref": "y", "y0": low, "y1": high, "fillcolor": colour,
         "opacity": 0.42, "line": {"width": 0}, "layer": "below"}
        for low, high, colour, _ in level_bands()
    ]  # fmt: skip


def _level_names() -> list[dict[str, Any]]:
    return [
        {"xref": "paper", "x": 1, "xanchor": "left", "yref": "y", "y": (low + high) / 2, "text": name,
         "showarrow": False, "font": {"size": 11, "color": INK}, "bgcolor": "rgba(255,255,255,0.65)", "borderpad": 1}
        for low, high, _, name in level_bands()
    ]  # fmt: skip


def _gap_shapes(record: RecordingSummary) -> list[dict[str, Any]]:
    return [
        {"type": "rect", "xref": "x", "x0": start, "x1": end, "yref": "paper", "y0": 0, "y1": 1, "fillcolor": GAP_FILL,
         "line": {"width": 0}, "layer": "below"}
        for start, end in drawn_gaps(record)
    ]  # fmt: skip


def _worst_shapes(intervals: list[WorstInterval]) -> list[dict[str, Any]]:
    return [
        {"type": "rect", "xref": "x", "x0": one.start, "x1": one.end, "yref": "y", "y0": 0.5, "y1": TOP,
         "fillcolor": "rgba(27, 36, 48, 0.07)", "line": {"width": 1, "color": "rgba(27, 36, 48, 0.55)", "dash": "dot"}}
        for one in intervals
    ]  # fmt: skip


def _worst_numbers(intervals: list[WorstInterval]) -> list[dict[str, Any]]:
    return [
        {"x": one.time, "y": TOP, "yref": "y", "yanchor": "bottom", "text": f"<b>{one.number}</b>", "showarrow": False,
         "font": {"size": 12, "color": "#ffffff"}, "bgcolor": INK, "borderpad": 2}
        for one in intervals
    ]  # fmt: skip


_TIME_AXIS: Final[dict[str, Any]] = {
    "title": {"text": "time [s]"}, "showgrid": False, "zeroline": False, "nticks": 8, "tickangle": 0,
}  # fmt: skip


def _layout(title: str, height: int) -> dict[str, Any]:
    return {
        "height": height, "margin": {"l": 62, "r": 72, "t": 50, "b": 44}, "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff", "hovermode": "closest", "hoverdistance": 60, "dragmode": "zoom",
        "font": {"family": "system-ui, sans-serif", "size": 13, "color": INK}, "meta": title,
    }  # fmt: skip


def _short(seconds: Array) -> Array:
    return np.round(seconds, 4)


_LEFT, _RIGHT, _UP, _DOWN = 30.0, 832.0, 22.0, 272.0
"""Edges of the plot area in the SVG [px of its view box]."""
_NUMBER: Final = 18.0
"""[px of the view box] Numbers of intervals stand at least so far apart."""
_BUCKETS: Final = 800
"""Parts of the time axis in print: one per pixel of the plot area."""
_BOTTOM: Final = 0.5
"""Lower end of the score axis: the lowest score with a margin."""


def time_svg(
    record: RecordingSummary,
    intervals: list[WorstInterval],
    length: float,
    *,
    curve: Curve | None = None,
    label: str = "",
    number: int = 1,
) -> str:
    """Return the static plot of REBA over time as SVG.

    Args:
        length: of the time axis [s].
        curve, label: what is plotted and its text alternative; None: the total.
        number: recordings in the report, which share its size.
    """
    start, end = time_range(record, length)

    def x(times: Array) -> Array:
        return _LEFT + (np.asarray(times) - start) / ((end - start) or 1.0) * (_RIGHT - _LEFT)

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
    total = record.curves["reba"] if curve is None else curve
    points = steps(record.scores, total, record.gaps, max(_BUCKETS // number, 200))
    low, high, value = (part[points.frame] for part in (total.low, total.high, total.value))
    axis = "time [min]" if _in_minutes(start, end) else "time [s]"
    if curve is None and changes(low, high) > (_RIGHT - _LEFT) / 2:
        means = part_means(record.scores, total, PARTS_OF_MEANS)
        axis += f"; line: mean over {seconds(record.length / PARTS_OF_MEANS)}, grey: lowest to highest score"
        parts.append(_spread(x(record.scores.time), y(total.low - 0.1), y(total.high + 0.1)))
        low, high = means.low, means.high
        value = np.where(low == high, low, np.nan)
        points = StepCurve(means.edges[:-1], means.edges[1:], np.isnan(np.append(low[1:], np.nan)), points.frame[:0])
    px, py = band(points, low, high, low < high)
    parts.append(f'<path class="range" d="{_path(x(px), y(py), closed=True)}"/>')
    lx, ly = line(points, value, ~np.isnan(value))
    parts.append(f'<path class="score" d="{_path(x(lx), y(ly), closed=False)}"/>')
    for first, last, _, name in level_bands():
        middle = float(y(np.array((first + last) / 2)))
        parts.append(f'<text class="level" x="{_RIGHT + 6:g}" y="{middle + 4:.1f}">{name}</text>')
    for score in (*ACTION_LEVEL_FROM, 15):
        parts.append(f'<text class="tick" x="{_LEFT - 6:g}" y="{float(y(np.array(score))) + 4:.1f}">{score}</text>')
    free = 0.0
    for one in sorted(intervals, key=lambda interval: interval.time):
        at = max(float(x(np.array(one.time))), free)
        free = at + _NUMBER
        parts.append(f'<rect class="number" x="{at - 8:.1f}" y="3" width="16" height="16" rx="3"/>')
        parts.append(f'<text class="number" x="{at:.1f}" y="15.5">{one.number}</text>')
    unit = 60.0 if _in_minutes(start, end) else 1.0
    for tick in _ticks(start / unit, end / unit):
        at = float(x(np.array(tick * unit)))
        parts.append(f'<line class="axis" x1="{at:.1f}" y1="{_DOWN:g}" x2="{at:.1f}" y2="{_DOWN + 5:g}"/>')
        parts.append(f'<text class="time" x="{at:.1f}" y="{_DOWN + 18:g}">{tick:g}</text>')
    parts.append(f'<text class="time" x="{(_LEFT + _RIGHT) / 2:g}" y="{_DOWN + 34:g}">{axis}</text>')
    opening = f'<svg class="timeline" viewBox="0 0 900 308" role="img" aria-label="{label or time_label(record)}">'
    return f"{opening}{''.join(parts)}</svg>"


def time_label(record: RecordingSummary) -> str:
    """Return the text alternative of the plot over time."""
    ends = record.summary["range"]
    return (
        f"REBA over time from {record.scores.time[0]:.1f} to {record.scores.time[-1]:.1f} s: "
        f"median {span(ends['median_low'], ends['median_high'])}, p90 {span(ends['p90_low'], ends['p90_high'])}, "
        f"highest {span(ends['max_low'], ends['max_high'])}; {len(record.gaps)} gaps without samples"
    )


def _in_minutes(start: float, end: float) -> bool:
    return end - start > LONG


def _spread(x: Array, top: Array, bottom: Array) -> str:
    """Return an area from the lowest to the highest of the values that share a place on the axis."""
    place, first = np.unique(x.astype(np.int64), return_index=True)
    ends = zip(place, np.maximum.reduceat(top, first), np.minimum.reduceat(bottom, first), strict=True)
    return f'<path class="spread" d="{"".join(f"M{at}.5 {a:.1f}V{b:.1f}" for at, a, b in ends)}"/>'


def _rect(x: float, y: float, width: float, height: float, style: str) -> str:
    return f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" {style}/>'


def _path(x: Array, y: Array, *, closed: bool) -> str:
    """Return SVG path commands: polygons if closed, else step lines; NaN separates pieces."""
    commands: list[str] = []
    new_piece = True
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if a != a or b != b:
            commands += ["Z"] if closed else []
            new_piece = True
        elif new_piece:
            commands.append(f"M{a:.1f} {b:.1f}")
            new_piece = False
        else:
            commands.append(f"L{a:.1f} {b:.1f}" if closed else f"H{a:.1f}V{b:.1f}")
    return "".join(commands) + ("Z" if closed and commands else "")


def _ticks(start: float, end: float) -> list[float]:
    """Return about eight round times between the ends of the axis."""
    rough = (end - start) / 8 or 1.0
    power = 10.0 ** np.floor(np.log10(rough))
    step = float(next(power * factor for factor in (1, 2, 5, 10) if power * factor >= rough))
    return [round(value, 6) + 0.0 for value in np.arange(np.ceil(start / step) * step, end, step).tolist()]
