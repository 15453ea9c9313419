"""The report: one HTML file about scored recordings that needs no network and prints on A4.

Scores -> recording.py (what all sections share) -> verdict, parts, worst, angles, assumptions, grade
       -> figures.py and static_plot.py (plots) -> page.py -> template.html
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from reba.errors import RebaError

if TYPE_CHECKING:
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
    from reba.report.page import page

    return page(scores, command)


def write_report(path: str | Path, scores: Sequence[Scores], *, command: str = "") -> None:
    """Write the report as one HTML file; the file appears only when it is complete.

    Args:
        path: file to write; its folder must exist.
        scores: one or more scored recordings.
        command: command line to show.

    Raises:
        RebaError: no recording was given, or the file cannot be written.

    Example:
        >>> write_report("report.html", [reba.score(reba.read("lift.mcap"))])  # doctest: +SKIP
    """
    html = render(scores, command=command)
    target = Path(path)
    part = target.with_name(target.name + ".part")
    try:
        part.write_text(html, encoding="utf-8")
        part.replace(target)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink()
        raise RebaError(
            f"{target}: the report cannot be written ({error.strerror}); give a file in a folder that exists"
        ) from error
