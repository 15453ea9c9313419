"""Figure of the shares of the tables over the weight of the ergonomic cost: where the shape of the paper begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from scipy.stats import binomtest

from lgp.experiments import published
from lgp.experiments.runs import TABLES
from lgp.experiments.summary import ERGONOMIC
from lgp.svg import LINE, SOFT, error_bar, horizontal_grid, legend_line, line, points, svg, text, vertical_title

COLOURS: Final = {"left": "#b4540a", "center": "#1f6fa8", "right": "#7a68b5"}
"""Table -> colour; its name stands in the legend."""
WEIGHT_LABEL: Final = "weight of the ergonomic cost"
HEIGHT = 320.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 52.0, 404.0, 46.0, 262.0
_SHIFT = 4.0
"""Horizontal distance of the points of two tables at one weight, so that their intervals do not hide each other."""


def weight_figure(rows: Sequence[Mapping[str, Any]], weights: Mapping[str, float]) -> str:
    """Return the figure as SVG, an empty text where fewer than two weights were planned.

    Args:
        rows: of the sensitivity table, see `lgp.experiments.sensitivity.sensitivity_table`.
        weights: setting of a row -> weight, "" for the unchanged scene.
    """
    chosen = [
        row
        for row in rows
        if row["condition"] == ERGONOMIC and row["n"] and row["choice"] in ("as it is", WEIGHT_LABEL)
    ]
    chosen = sorted((row for row in chosen if row["setting"] in weights), key=lambda row: weights[row["setting"]])
    values = np.array([weights[row["setting"]] for row in chosen])
    if len(values) < 2 or values[0] <= 0.0:
        return ""
    logs = np.log10(values)

    def x(log: Any) -> Any:
        return _LEFT + 14 + (np.asarray(log) - logs[0]) / (logs[-1] - logs[0]) * (_RIGHT - _LEFT - 28)

    def y(percent: Any) -> Any:
        return _BOTTOM - np.asarray(percent) / 100.0 * (_BOTTOM - _TOP)

    parts = horizontal_grid([0, 25, 50, 75, 100], lambda value: float(y(value)), _LEFT, _RIGHT)
    parts.append(vertical_title(14, (_TOP + _BOTTOM) / 2, "share of runs [%]"))
    for row, log in zip(chosen, logs, strict=True):
        own = row["setting"] == ""
        if own:
            parts.append(line(float(x(log)), _TOP, float(x(log)), _BOTTOM, SOFT if own else LINE, 1.0))
        parts.append(text(float(x(log)), _BOTTOM + 18, f"{weights[row['setting']]:g}", size=13))
    parts.append(text((_LEFT + _RIGHT) / 2, _BOTTOM + 40, "weight of a score point for a second", size=13, colour=SOFT))
    reference = published.CHOICE_PERCENT["rest"][ERGONOMIC]
    for number, table in enumerate(TABLES):
        colour, shift = COLOURS[table], _SHIFT * (number - 1)
        parts += legend_line(_LEFT + 118.0 * number, 18, table, colour)
        height = float(y(reference[table]))
        parts.append(line(_LEFT, height, _RIGHT, height, colour, 1.2, "5 5"))
        shares = np.array([row[table] for row in chosen])
        px = x(logs) + shift
        parts.append(f'<polyline points="{points(px, y(shares))}" fill="none" stroke="{colour}" stroke-width="2.2"/>')
        for row, left, share in zip(chosen, px, shares, strict=True):
            count = round(share / 100.0 * row["n"])
            low, high = binomtest(count, int(row["n"])).proportion_ci(method="wilson")
            parts += error_bar(float(left), float(y(100 * low)), float(y(100 * high)), 3.0)
    return svg(parts, "Lines: share of each table in the ergonomic plans by the weight of the ergonomic cost", HEIGHT)
