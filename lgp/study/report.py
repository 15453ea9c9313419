"""HTML report of a study: one file without network access, in the style of the reports of `reba`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np

from lgp.statistics.formatting import number, p_value
from lgp.statistics.paired_tests import stars
from lgp.study.privacy import WITH_NAMES, WITHOUT_NAMES, without_names
from lgp.study.scoring import EXTRA, LEVELS, PARTS, SIDED, TOTAL
from lgp.svg import INK, SOFT, error_bar, horizontal_grid, line, svg, text, ticks, vertical_title
from reba.analysis.wording import percent
from reba.method.tables import ACTION_LEVELS
from reba.printable import as_markup
from reba.report.page import template

SOURCE: Final = (
    "Busch, Toussaint & Lopes, Planning Ergonomic Sequences of Actions in Human-Robot Interaction, ICRA 2018, "
    "section IV-C"
)
"""Source of the figure and of the analysis of variance."""


def render(summary: Mapping[str, Any], *, command: str = "", names: bool = False) -> str:
    """Report of a summary of `lgp.study.study.summarise` as HTML text.

    Args:
        command: that reproduces it, shown on the page.
        names: show labels of participants and folders.
    """
    from markupsafe import Markup

    if not names:
        summary, command = without_names(summary, command)
    filters: dict[str, Callable[..., str]] = {
        "p": p_value,
        "number": number,
        "mark": _mark,
        "percent": _percent,
    }
    conditions = summary["conditions"]
    return template("lgp.study", "study.html", filters).render(
        summary=summary,
        conditions=conditions,
        total=summary[TOTAL],
        parts={PARTS[name]: one for name, one in summary["parts"].items()},
        sided=[PARTS[name].split(" (")[0].lower() for name in SIDED],
        described={EXTRA[name]: one for name, one in summary["described"].items()},
        levels=[(level, ACTION_LEVELS[level][0], summary["levels"][name]) for level, name in enumerate(LEVELS)],
        bars=Markup(bars(summary, conditions)),
        paired=Markup(paired(summary, conditions)),
        source=SOURCE,
        command=command,
        privacy=WITH_NAMES if names else WITHOUT_NAMES,
    )


def _mark(p: float | None) -> str:
    return "" if p is None or not stars(p) else f" {stars(p)}"


def _percent(share: float | None) -> str:
    return "–" if share is None else percent(share)


COLOURS: Final = ("#1f6fa8", "#b4540a", "#7a68b5", "#2e7d4f", "#8c6d1f", "#a33b66")
"""Colours of the conditions in their order, repeated from the seventh on; each has its name beside it."""
MOST_NAMED: Final = 16
"""Most participants whose lines are labelled; more labels would overlap."""
_LEFT, _RIGHT = 40.0, 412.0
_LEGEND_STEP, _LETTER_WIDTH = 22.0, 7.6
_BARS_HEIGHT, _FOOT_HEIGHT, _LINES_HEIGHT = 200.0, 74.0, 250.0
_LABEL_STEP = 13.0


def colour(index: int) -> str:
    """Colour of the condition of this index."""
    return COLOURS[index % len(COLOURS)]


def bars(summary: Mapping[str, Any], conditions: Sequence[str]) -> str:
    """Bar chart of mean REBA and mean part scores per condition with standard errors, as Fig. 11 of the paper.

    Thin error bars are standard errors between participants (as in the paper), thick ones within participants. Stars
    over a group mark the smallest p value of its pairs after Holm's correction.
    """
    groups = [("REBA", summary[TOTAL])]
    groups += [(PARTS[name].split(" (")[0], one) for name, one in summary["parts"].items() if not one.get("constant")]
    legend, legend_end = _legend(conditions)
    bottom = legend_end + 24.0 + _BARS_HEIGHT
    shown = [one["conditions"][name] for _, one in groups for name in conditions]
    top = max((_or(one["mean"]) + _or(one["se"]) for one in shown), default=0.0) or 1.0
    scale = _BARS_HEIGHT / top
    step = (_RIGHT - _LEFT) / len(groups)
    width = min(step * 0.8 / len(conditions), 46.0)
    parts = [*legend, *_grid(top, bottom, scale)]
    for index, (title, one) in enumerate(groups):
        middle = _LEFT + step * (index + 0.5)
        for position, name in enumerate(conditions):
            x = middle + (position - (len(conditions) - 1) / 2) * width
            parts += _bar(one["conditions"][name], x, width * 0.88, bottom, scale, colour(position))
        mark = _stars(one["pairs"])
        high = max((_or(one["conditions"][name]["mean"]) + _or(one["conditions"][name]["se"])) for name in conditions)
        parts += [text(middle, bottom - high * scale - 6, mark, size=15)] if mark else []
        turned = text(0, 0, title, size=13, anchor="end")
        parts.append(f'<g transform="translate({middle + 5:.1f} {bottom + 16:.1f}) rotate(-38)">{turned}</g>')
    label = f"Bars: mean REBA score and mean part scores in {', '.join(conditions)}, with standard errors"
    return svg(parts, label, bottom + _FOOT_HEIGHT)


def _bar(one: Mapping[str, Any], x: float, width: float, bottom: float, scale: float, fill: str) -> list[str]:
    if one["mean"] is None:
        return []
    y = bottom - one["mean"] * scale
    box = f'x="{x - width / 2:.1f}" y="{y:.1f}" width="{width:.1f}" height="{bottom - y:.1f}"'
    parts = [f'<rect {box} fill="{fill}"/>']
    if one["se"] is not None:
        parts += error_bar(x, y + one["se"] * scale, y - one["se"] * scale, min(width / 3, 6.0))
    if one["se_within"] is not None:
        parts.append(line(x, y + one["se_within"] * scale, x, y - one["se_within"] * scale, width=4.0))
    return parts


def paired(summary: Mapping[str, Any], conditions: Sequence[str]) -> str:
    """Mean REBA score of each participant as a line over the conditions, and the means of the conditions.

    Participants who lack a condition have a dashed line and hollow dots.
    """
    people: Mapping[str, Mapping[str, Any]] = summary[TOTAL]["participants"]
    known = [value for row in people.values() for value in row.values() if value is not None]
    low, high = (min(known), max(known)) if known else (0.0, 1.0)
    margin = max((high - low) * 0.08, 0.05)
    low, high = low - margin, high + margin
    parts, legend_end = _legend(conditions)
    bottom = legend_end + 14.0 + _LINES_HEIGHT
    named = len(people) <= MOST_NAMED
    right = _RIGHT - (70.0 if named else 20.0)
    step = (right - _LEFT - 40.0) / max(len(conditions) - 1, 1)
    columns = [_LEFT + 40.0 + step * number for number in range(len(conditions))]

    def y(value: float) -> float:
        return bottom - (value - low) / (high - low) * _LINES_HEIGHT

    parts += horizontal_grid(ticks(low, high), y, _LEFT, right + 8, 13)
    for name, row in people.items():
        parts.append(_person(name, [row[condition] for condition in conditions], columns, y))
    if named:
        parts += _names(people, conditions, right + 19, y)
    for index, condition in enumerate(conditions):
        one = summary[TOTAL]["conditions"][condition]
        if one["mean"] is not None:
            middle = y(one["mean"])
            parts.append(line(columns[index] - 15, middle, columns[index] + 15, middle, colour(index), 5.0))
    label = f"Lines: mean REBA score of each participant in {', '.join(conditions)}; thick bars are the means"
    return svg(parts, label, bottom + 12)


def _person(name: str, values: Sequence[float | None], columns: Sequence[float], y: Any) -> str:
    dots = [(x, y(value)) for x, value in zip(columns, values, strict=True) if value is not None]
    complete = len(dots) == len(values)
    parts = [line(*a, *b, SOFT, 1.4, "" if complete else "3 4") for a, b in pairwise(dots)]
    fill = SOFT if complete else "#fff"
    parts += [f'<circle cx="{x:.1f}" cy="{height:.1f}" r="3.4" fill="{fill}" stroke="{SOFT}"/>' for x, height in dots]
    scores = ", ".join("no recording" if value is None else f"{value:.2f}" for value in values)
    return f"<g><title>{as_markup(name)}: {as_markup(scores)}</title>{''.join(parts)}</g>"


def _names(people: Mapping[str, Mapping[str, Any]], conditions: Sequence[str], x: float, y: Any) -> list[str]:
    """Names of participants beside their last dots, shifted so that they do not overlap."""
    from scipy.optimize import isotonic_regression

    last = {name: row[conditions[-1]] for name, row in people.items() if row[conditions[-1]] is not None}
    order = sorted(last, key=lambda name: y(last[name]))
    # Least-squares heights with a distance of at least one step: isotonic regression after subtracting the steps.
    steps = _LABEL_STEP * np.arange(len(order))
    heights = isotonic_regression([y(last[name]) for name in order] - steps).x + steps if order else []
    short = [name if len(name) <= 9 else f"{name[:8]}…" for name in order]
    return [
        text(x, height + 4, name, size=12, colour=SOFT, anchor="start")
        for name, height in zip(short, heights, strict=True)
    ]


def _legend(conditions: Sequence[str]) -> tuple[list[str], float]:
    """Legend of the conditions in as many rows as they need, and the y coordinate where it ends."""
    parts: list[str] = []
    x, y = _LEFT, 12.0
    for index, name in enumerate(conditions):
        width = 34.0 + _LETTER_WIDTH * len(name)
        if x > _LEFT and x + width > _RIGHT:
            x, y = _LEFT, y + _LEGEND_STEP
        parts.append(f'<rect x="{x:.1f}" y="{y - 7:.1f}" width="14" height="14" fill="{colour(index)}"/>')
        parts.append(text(x + 20, y + 5, name, anchor="start"))
        x += width
    return parts, y + 10.0


def _grid(top: float, bottom: float, scale: float) -> list[str]:
    lines = horizontal_grid(ticks(0.0, top), lambda value: bottom - value * scale, _LEFT, _RIGHT, 13)
    title = vertical_title(11, bottom - _BARS_HEIGHT / 2, "mean score")
    return [*lines, title, line(_LEFT, bottom, _RIGHT, bottom, INK)]


def _stars(pairs: Sequence[Mapping[str, Any]]) -> str:
    known = [pair["p_holm"] for pair in pairs if pair.get("p_holm") is not None]
    return stars(min(known)) if known else ""


def _or(value: float | None) -> float:
    return 0.0 if value is None else value
