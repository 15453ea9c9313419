"""SVG primitives of the figures: lines, text, axis ticks; narrow, so that text is readable on a phone.

Text is escaped; coordinates are units of the view box, y down.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from reba.arrays import Array
from reba.printable import as_markup
from reba.provenance import generator

INK, SOFT, LINE = "#1b2430", "#4d5866", "#d5dae1"
"""Colours of lines and text, notes, and grids, as in the reports."""
WIDTH = 420.0
"""Width of the view box."""


def line(x1: float, y1: float, x2: float, y2: float, colour: str = INK, width: float = 1.4, dash: str = "") -> str:
    """Return a line element."""
    dashes = f' stroke-dasharray="{dash}"' if dash else ""
    ends = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
    return f'<line {ends} stroke="{colour}" stroke-width="{width:g}"{dashes}/>'


def text(x: float, y: float, content: str, *, size: int = 14, colour: str = INK, anchor: str = "middle") -> str:
    """Return a text element; `anchor` is start, middle or end.

    >>> text(1, 2, "a < b", anchor="start")
    '<text x="1.0" y="2.0" font-size="14" fill="#1b2430" text-anchor="start">a &lt; b</text>'
    """
    look = f'font-size="{size}" fill="{colour}" text-anchor="{anchor}"'
    return f'<text x="{x:.1f}" y="{y:.1f}" {look}>{as_markup(content)}</text>'


def points(x: Array, y: Array) -> str:
    """Return coordinates (n,) as the points attribute of a polyline or polygon."""
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


def ticks(low: float, high: float) -> list[float]:
    """Return axis ticks from `low` to `high`: at most eight round numbers.

    >>> ticks(0.0, 3.1)
    [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]
    >>> ticks(8.7, 26.7), ticks(0.0, 0.03)[-1]
    ([10.0, 15.0, 20.0, 25.0], 0.03)
    """
    width = max(high - low, 1e-9)
    unit = 10.0 ** np.floor(np.log10(width / 7.5))
    step = next(size for size in (unit, 2.0 * unit, 5.0 * unit, 10.0 * unit) if width / size <= 7.5 * (1.0 + 1e-9))
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return [float(f"{number * step:.9g}") + 0.0 for number in np.arange(first, last + 1.0)]


def horizontal_grid(
    values: Sequence[float], y: Callable[[float], float], left: float, right: float, size: int = 14
) -> list[str]:
    """Horizontal grid lines from `left` to `right` at axis values, each with its value left of the axis."""
    parts = []
    for value in values:
        height = float(y(value))
        parts.append(line(left, height, right, height, LINE, 1.0))
        parts.append(text(left - 6, height + 4.5, f"{value:g}", size=size, anchor="end"))
    return parts


def vertical_title(x: int, y: float, words: str) -> str:
    """Title of a vertical axis, read from bottom to top and centred at (x, y)."""
    turned = text(0, 0, words, size=13, colour=SOFT)
    return f'<g transform="translate({x} {y:.1f}) rotate(-90)">{turned}</g>'


def error_bar(x: float, low: float, high: float, cap: float) -> list[str]:
    """Error bar from `low` to `high` at x, with a cap of half width `cap` at both ends."""
    return [line(x, low, x, high), *(line(x - cap, end, x + cap, end) for end in (low, high))]


def legend_line(x: float, y: float, name: str, colour: str = INK, width: float = 4.0, dash: str = "") -> list[str]:
    """Legend entry of a line: a sample of it that begins at (x, y), and its name."""
    return [line(x, y, x + 22, y, colour, width, dash), text(x + 28, y + 5, name, anchor="start")]


def svg(parts: Sequence[str], label: str, height: float) -> str:
    """Return the SVG document; `label` is its text for screen readers."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="chart" viewBox="0 0 {WIDTH:g} {height:g}" role="img" '
        f'aria-label="{as_markup(label)}" font-family="system-ui, sans-serif">' + "".join(parts) + "</svg>"
    )


def with_generator(drawing: str) -> str:
    """Return an SVG document as a file holds it: with the program that drew it, and a line end.

    >>> with_generator("<svg viewBox='0 0 1 1'></svg>").startswith("<svg viewBox='0 0 1 1'><metadata>dreba ")
    True
    """
    start, end, rest = drawing.partition(">")
    return f"{start}{end}<metadata>{generator()}</metadata>{rest.rstrip()}\n"
