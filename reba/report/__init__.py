"""The report: one HTML file about scored recordings that needs no network and prints on A4.

Scores -> recording.py (what all sections share) -> verdict, parts, worst, angles, assumptions, grade
       -> figures.py and static_plot.py (plots) -> page.py -> template.html
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reba.errors import RebaError
from reba.files import write_atomic, write_text
from reba.report.page import page
from reba.scores import Scores


def render(scores: Sequence[Scores], *, command: str = "") -> str:
    """Return the report as HTML.

    Args:
        scores: one or more scored recordings.
        command: command line to show, so that the report can be made again.

    Raises:
        RebaError: no recording was given.
    """
    if not scores:
        raise RebaError("a report needs at least one scored recording; none was given")

    return page(scores, command)


def write_report(path: str | Path, scores: Sequence[Scores], *, command: str = "") -> None:
    """Write the report as one HTML file; the file appears only when it is complete.

    Args:
        path: file to write; its folder is made where it does not exist.
        scores: one or more scored recordings.
        command: command line to show.

    Raises:
        RebaError: no recording was given, or the file cannot be written.

    Example:
        >>> write_report("report.html", [reba.score(reba.read("lift.mcap"))])  # doctest: +SKIP
    """
    html = render(scores, command=command)
    write_atomic(Path(path), lambda part: write_text(part, html))
