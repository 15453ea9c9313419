"""The page of a study: one HTML file that needs no network, in the style of the reports of `reba`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import PurePath
from typing import Any, Final

import numpy as np

from lgp.statistics.formatting import number, p_value
from lgp.statistics.paired_tests import stars
from lgp.study.scoring import EXTRA, LEVELS, PARTS, SIDED, TOTAL
from lgp.svg import INK, LINE, SOFT, line, svg, text, ticks
from reba.method.tables import ACTION_LEVELS
from reba.report.page import template

SOURCE: Final = (
    "Busch, Toussaint & Lopes, Planning Ergonomic Sequences of Actions in Human-Robot Interaction, ICRA 2018, "
    "section IV-C"
)
"""Where the figure and the analysis of variance are from."""


def render(found: Mapping[str, Any], *, command: str = "") -> str:
    """Return the page as HTML.

    Args:
        found: the summary of a study.
        command: command line to show, so that the page can be made again.
    """
    from markupsafe import Markup

    files = [one["input"] for one in (*found["recordings"], *found["failed"])]
    filters: dict[str, Callable[..., str]] = {
        "p": p_value,
        "number": number,
        "mark": _mark,
        "file": _name,
        "percent": _percent,
        "short": lambda text: _short(text, files),
    }
    conditions = found["conditions"]
    return template("lgp.study", "study.html", filters).render(
        found=found,
        conditions=conditions,
        total=found[TOTAL],
        parts={PARTS[name]: one for name, one in found["parts"].items()},
        sided=[PARTS[name].split(" (")[0].lower() for name in SIDED],
        described={EXTRA[name]: one for name, one in found["described"].items()},
        levels=[(level, ACTION_LEVELS[level][0], found["levels"][name]) for level, name in enumerate(LEVELS)],
        bars=Markup(bars(found, conditions)),
        paired=Markup(paired(found, conditions)),
        source=SOURCE,
        command=command,
    )


def _mark(p: float | None) -> str:
    return "" if p is None or not stars(p) else f" {stars(p)}"


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.0f} %"


def _name(path: str) -> str:
    """Return the name of a file with its folder, which may hold the participant; not where it lies on a machine."""
    return "/".join(PurePath(path.replace("\\", "/")).parts[-2:])


def _short(text: str, files: Sequence[str]) -> str:
    """Return text with the names of files instead of where they lie."""
    for file in sorted(files, key=len, reverse=True):
        text = text.replace(file, _name(file))
    return text


COLOURS: Final = ("#1f6fa8", "#b4540a", "#7a68b5", "#2e7d4f", "#8c6d1f", "#a33b66")
"""One per condition in their order, from the first again after the last; each also has its name beside it."""
MOST_NAMED: Final = 16
"""Participants whose lines carry their names; more would lie over each other."""
_LEFT, _RIGHT = 40.0, 412.0
_KEY_STEP, _KEY_LETTER = 22.0, 7.6
_BARS_HIGH, _FOOT, _LINES_HIGH = 200.0, 74.0, 250.0
_NAME_STEP = 13.0


def colour(place: int) -> str:
    """Return the colour of a condition."""
    return COLOURS[place % len(COLOURS)]


def bars(found: Mapping[str, Any], conditions: Sequence[str]) -> str:
    """Return mean REBA and mean part scores per condition with standard errors, as Fig. 11 of the paper.

    Thin whiskers are standard errors between people (the paper's), thick ones within. A star over a group: the largest
    difference in it holds after Holm.

    Args:
        found: a summary.
        conditions: in their order.
    """
    groups = [("REBA", found[TOTAL])]
    groups += [(PARTS[name].split(" (")[0], one) for name, one in found["parts"].items() if not one.get("constant")]
    key, up = _key(conditions)
    up += 24.0
    down = up + _BARS_HIGH
    shown = [one["conditions"][name] for _, one in groups for name in conditions]
    top = max((_or(one["mean"]) + _or(one["se"]) for one in shown), default=0.0) or 1.0
    scale = _BARS_HIGH / top
    step = (_RIGHT - _LEFT) / len(groups)
    width = min(step * 0.8 / len(conditions), 46.0)
    parts = [*key, *_grid(top, down, scale)]
    for index, (title, one) in enumerate(groups):
        middle = _LEFT + step * (index + 0.5)
        for place, name in enumerate(conditions):
            at = middle + (place - (len(conditions) - 1) / 2) * width
            parts += _bar(one["conditions"][name], at, width * 0.88, down, scale, colour(place))
        mark = _stars(one["pairs"])
        high = max((_or(one["conditions"][name]["mean"]) + _or(one["conditions"][name]["se"])) for name in conditions)
        parts += [text(middle, down - high * scale - 6, mark, size=15)] if mark else []
        turned = text(0, 0, title, size=13, anchor="end")
        parts.append(f'<g transform="translate({middle + 5:.1f} {down + 16:.1f}) rotate(-38)">{turned}</g>')
    label = f"Bars: mean REBA score and mean part scores in {', '.join(conditions)}, with standard errors"
    return svg(parts, label, down + _FOOT)


def _bar(one: Mapping[str, Any], at: float, width: float, down: float, scale: float, fill: str) -> list[str]:
    if one["mean"] is None:
        return []
    y = down - one["mean"] * scale
    box = f'x="{at - width / 2:.1f}" y="{y:.1f}" width="{width:.1f}" height="{down - y:.1f}"'
    parts = [f'<rect {box} fill="{fill}"/>']
    if one["se"] is not None:
        low, high = y + one["se"] * scale, y - one["se"] * scale
        cap = min(width / 3, 6.0)
        parts += [line(at, low, at, high), *(line(at - cap, end, at + cap, end) for end in (low, high))]
    if one["se_within"] is not None:
        parts.append(line(at, y + one["se_within"] * scale, at, y - one["se_within"] * scale, width=4.0))
    return parts


def paired(found: Mapping[str, Any], conditions: Sequence[str]) -> str:
    """Return one line per participant over the conditions, dots for those who lack one, and the means.

    Args:
        found: a summary.
        conditions: in their order.
    """
    people: Mapping[str, Mapping[str, Any]] = found[TOTAL]["participants"]
    known = [value for row in people.values() for value in row.values() if value is not None]
    low, high = (min(known), max(known)) if known else (0.0, 1.0)
    margin = max((high - low) * 0.08, 0.05)
    low, high = low - margin, high + margin
    parts, up = _key(conditions)
    up += 14.0
    down = up + _LINES_HIGH
    named = len(people) <= MOST_NAMED
    right = _RIGHT - (70.0 if named else 20.0)
    step = (right - _LEFT - 40.0) / max(len(conditions) - 1, 1)
    places = [_LEFT + 40.0 + step * number for number in range(len(conditions))]

    def y(value: float) -> float:
        return down - (value - low) / (high - low) * _LINES_HIGH

    for tick in ticks(low, high):
        parts += [line(_LEFT, y(tick), right + 8, y(tick), LINE, 1.0)]
        parts += [text(_LEFT - 6, y(tick) + 4.5, f"{tick:g}", size=13, anchor="end")]
    for name, row in people.items():
        parts.append(_person(name, [row[condition] for condition in conditions], places, y))
    if named:
        parts += _names(people, conditions, right + 19, y)
    for index, condition in enumerate(conditions):
        one = found[TOTAL]["conditions"][condition]
        if one["mean"] is not None:
            middle = y(one["mean"])
            parts.append(line(places[index] - 15, middle, places[index] + 15, middle, colour(index), 5.0))
    label = f"Lines: mean REBA score of each participant in {', '.join(conditions)}; thick bars are the means"
    return svg(parts, label, down + 12)


def _person(name: str, values: Sequence[float | None], places: Sequence[float], y: Any) -> str:
    from markupsafe import escape

    dots = [(x, y(value)) for x, value in zip(places, values, strict=True) if value is not None]
    whole = len(dots) == len(values)
    drawn = [line(*a, *b, SOFT, 1.4, "" if whole else "3 4") for a, b in pairwise(dots)]
    fill = SOFT if whole else "#fff"
    drawn += [f'<circle cx="{x:.1f}" cy="{at:.1f}" r="3.4" fill="{fill}" stroke="{SOFT}"/>' for x, at in dots]
    said = ", ".join("no recording" if value is None else f"{value:.2f}" for value in values)
    return f"<g><title>{escape(name)}: {escape(said)}</title>{''.join(drawn)}</g>"


def _names(people: Mapping[str, Mapping[str, Any]], conditions: Sequence[str], x: float, y: Any) -> list[str]:
    """Return the names beside the last dots, moved apart where they would touch."""
    from scipy.optimize import isotonic_regression

    last = {name: row[conditions[-1]] for name, row in people.items() if row[conditions[-1]] is not None}
    order = sorted(last, key=lambda name: y(last[name]))
    # The nearest heights that are a step apart: without the steps, the nearest that never fall.
    steps = _NAME_STEP * np.arange(len(order))
    heights = isotonic_regression([y(last[name]) for name in order] - steps).x + steps if order else []
    short = [name if len(name) <= 9 else f"{name[:8]}…" for name in order]
    return [
        text(x, at + 4, name, size=12, colour=SOFT, anchor="start") for name, at in zip(short, heights, strict=True)
    ]


def _key(conditions: Sequence[str]) -> tuple[list[str], float]:
    """Return the names of the conditions with their colours, in as many rows as they need, and where they end."""
    parts: list[str] = []
    x, y = _LEFT, 12.0
    for place, name in enumerate(conditions):
        wide = 34.0 + _KEY_LETTER * len(name)
        if x > _LEFT and x + wide > _RIGHT:
            x, y = _LEFT, y + _KEY_STEP
        parts.append(f'<rect x="{x:.1f}" y="{y - 7:.1f}" width="14" height="14" fill="{colour(place)}"/>')
        parts.append(text(x + 20, y + 5, name, anchor="start"))
        x += wide
    return parts, y + 10.0


def _grid(top: float, down: float, scale: float) -> list[str]:
    parts = []
    for tick in ticks(0.0, top):
        y = down - tick * scale
        parts += [line(_LEFT, y, _RIGHT, y, LINE, 1.0), text(_LEFT - 6, y + 4.5, f"{tick:g}", size=13, anchor="end")]
    middle = down - _BARS_HIGH / 2
    turned = text(0, 0, "mean score", size=13, colour=SOFT)
    parts.append(f'<g transform="translate(11 {middle:.1f}) rotate(-90)">{turned}</g>')
    return [*parts, line(_LEFT, down, _RIGHT, down, INK)]


def _stars(pairs: Sequence[Mapping[str, Any]]) -> str:
    known = [pair["p_holm"] for pair in pairs if pair.get("p_holm") is not None]
    return stars(min(known)) if known else ""


def _or(value: float | None) -> float:
    return 0.0 if value is None else value
