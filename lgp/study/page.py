"""The page of a study: one HTML file that needs no network, in the style of the reports of `reba`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import PurePath
from typing import Any, Final

from lgp.experiments.page import number, p_value
from lgp.experiments.statistics import stars
from lgp.study.figures import bars, paired
from lgp.study.measures import EXTRA, LEVELS, PARTS, SIDED, TOTAL
from reba.report.templates import template
from reba.tables import ACTION_LEVELS

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
