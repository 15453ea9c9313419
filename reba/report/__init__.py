"""The report: one self-contained HTML file about scored recordings that needs no network and prints on A4.

Scores -> `summary` (figures shared by all sections) -> `findings`, `sections`, `series` (content of the sections)
       -> `plots` -> `page` -> template.html
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from reba.analysis.score_table import SCORES, ScoreTable
from reba.checks import PATH, TEXT, YES_NO, from_home, items_of, shown
from reba.errors import RebaError, warn_user
from reba.file_names import file_name, text_without_folders
from reba.files import write_atomic, write_text
from reba.outputs import FileOutput, check_outputs
from reba.report.page import Form, page
from reba.report.pdf import print_pdf
from reba.report.pictures import NONE, Pictures, statement
from reba.report.privacy import (
    WITH_NAMES,
    WITHOUT_NAMES,
    command_without_names,
    without_names,
)

Recordings = ScoreTable | Sequence[ScoreTable]
"""Scores of one recording or of several."""
BLANK = Form()
"""Lines to fill in by hand."""


def render(
    scores: Recordings,
    *,
    command: str = "",
    form: Form = BLANK,
    failed: Sequence[tuple[str, str]] = (),
    names: bool = False,
    pictures: Sequence[Pictures] = (),
) -> str:
    """Return the report on one recording or several as HTML text; `command` is the command line that reproduces it.

    Args:
        failed: path and error of recordings that could not be scored; they are listed.
        names: show the names that recordings give to people, marker sets and streams, and paths.
        pictures: of a camera, for each recording; () for none.

    Raises:
        RebaError: no recording was given.
    """
    recordings = [scores] if isinstance(scores, ScoreTable) else list(scores)
    if not recordings:
        raise RebaError("a report needs at least one scored recording; none was given")
    pictures = pictures or [NONE] * len(recordings)
    if names:
        return page(recordings, command, form, failed, f"{WITH_NAMES} {statement(pictures)}", pictures)
    hidden = [without_names(each) for each in recordings]
    listed = [(file_name(path), text_without_folders(error, path)) for path, error in failed]
    command = command_without_names(command, recordings, {topic for one in pictures for topic in one.topics})
    return page(hidden, command, form, listed, f"{WITHOUT_NAMES} {statement(pictures)}", pictures)


def write_report(
    scores: Recordings,
    path: str | Path,
    *,
    command: str = "",
    task: str = "",
    assessor: str = "",
    date: str = "",
    failed: Sequence[tuple[str, str]] = (),
    names: bool = False,
    pictures: Pictures | Sequence[Pictures] = (),
) -> None:
    """Write the report as one HTML file, or as PDF if the path ends so; it appears only when it is complete.

    A PDF is printed by Chromium, Chrome or Edge on this machine, without a network.

    Args:
        scores: scores of one recording or of several.
        path: file to write; its folder is created if missing.
        command: command line to show, with which the report can be reproduced.
        task, assessor, date: what the first printed page says of them; "" leaves a line to fill in.
        failed: path and error of recordings that could not be scored; they are listed.
        names: show the names that recordings give to people, marker sets and streams, and paths; they are left out by
            default. The name of the file is shown, whatever it says.
        pictures: of a camera, from `reba.camera_pictures`, for each recording; there are none by default.

    Raises:
        RebaError: no recording was given, the file cannot be written, it is a recording, or no browser prints the PDF.

    Example:
        >>> import tempfile, pandas, reba
        >>> frames = pandas.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 70.0]})
        >>> file = Path(tempfile.mkdtemp(), "report.html")
        >>> reba.write_report(reba.score(frames), file)
        >>> file.read_text(encoding="utf-8")[:15]
        '<!DOCTYPE html>'
    """
    if isinstance(scores, str | os.PathLike):
        warn_user("write_report(path, scores) is deprecated; use write_report(scores, path)", DeprecationWarning)
        scores, path = path, scores  # type: ignore[assignment]
    several: list[ScoreTable] = list(scores) if isinstance(scores, list | tuple) else [scores]  # type: ignore[list-item]
    if not all(SCORES.fits(each) for each in several):
        raise RebaError(f"write_report: scores is {shown(scores)}; expected {SCORES.expected}, or a list of these")
    if not PATH.fits(path):
        raise RebaError(f"write_report: path is {shown(path)}; expected {PATH.expected}")
    for argument, text in {"command": command, "task": task, "assessor": assessor, "date": date}.items():
        if not TEXT.fits(text):
            raise RebaError(f"write_report: {argument} is {shown(text)}; expected {TEXT.expected}")
    if not YES_NO.fits(names):
        raise RebaError(f"write_report: names is {shown(names)}; expected {YES_NO.expected}")
    failures = items_of(failed)
    if failures is None or not all(
        isinstance(one, tuple | list) and len(one) == 2 and all(map(TEXT.fits, one)) for one in failures
    ):
        raise RebaError(f"write_report: failed is {shown(failed)}; expected pairs of a path and its error")
    shots = (pictures,) if isinstance(pictures, Pictures) else items_of(pictures)
    if shots is None or len(shots) not in (0, len(several)) or not all(isinstance(one, Pictures) for one in shots):
        expected = "what reba.camera_pictures returns, for each recording"
        raise RebaError(f"write_report: pictures is {shown(pictures)}; expected {expected}")
    path = from_home(path)
    check_outputs(FileOutput(path), inputs=[path for each in several for path in each.postures.inputs])
    html = render(several, command=command, form=Form(task, assessor, date), failed=failures, names=names,
                  pictures=shots)  # fmt: skip
    if Path(path).suffix.lower() == ".pdf":
        write_atomic(Path(path), lambda part: print_pdf(html, part))
    else:
        write_atomic(Path(path), lambda part: write_text(part, html))
