"""The page of a moved surface: before and after drawn, REBA over height and distance; one file without a network."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from lgp.workplace import wording
from lgp.workplace.improvement import MovedSurface, MovedWorkplace
from lgp.workplace.postures import Place, Posture
from reba.analysis.wording import moment as time_of
from reba.files import write_atomic, write_text
from reba.method.tables import ACTION_LEVELS, LEVEL_OF, PART_MAXIMA
from reba.outputs import FileOutput, check_outputs
from reba.posture.columns import COLUMNS
from reba.posture.skeleton import SPOTS, Mark, stick_figure
from reba.report.labels import angle_name
from reba.report.page import template

SHOWN_DIFFERENCE: Final = 5.0
"""[deg] Angles that differ by less are left out of the table: measurement error is as large."""


def write_report(workplace: MovedWorkplace, path: str | Path, *, command: str = "") -> None:
    """Write the page as one HTML file.

    Args:
        command: command line that reproduces it, shown on the page.

    Raises:
        RebaError: the file cannot be written.
    """
    check_outputs(FileOutput(path))
    html = render(workplace, command=command)
    write_atomic(Path(path), lambda part: write_text(part, html))


def render(workplace: MovedWorkplace, *, command: str = "") -> str:
    """Return the page as HTML text."""

    return template("lgp.workplace", "workplace.html").render(
        workplace=workplace,
        moments=[_section(moment, workplace) for moment in workplace.moments],
        notes=wording.assumptions(workplace),
        levels=[(number, name) for number, (name, _) in enumerate(ACTION_LEVELS)],
        command=command,
    )


def _section(moment: MovedSurface, workplace: MovedWorkplace) -> dict[str, Any]:
    """Return the template variables of one frame."""
    from markupsafe import Markup

    postures = [("As measured", moment.measured)]
    if moment.unchanged.reba < moment.measured.reba:
        postures.append(("Best posture at this place", moment.unchanged))
    if moment.best is not moment.here:
        postures.append((f"Surface {wording.move(moment.best)}", moment.proposed))
    return {
        "moment": moment,
        "time": time_of(moment.time),
        "result": wording.result(moment, workplace),
        "nearness": wording.nearness(moment),
        "here": wording.where(moment.here),
        "postures": [
            {
                "title": title,
                "posture": posture,
                "score": wording.scored(posture),
                "svg": Markup(drawing(title, posture)),
            }
            for title, posture in postures
        ],
        "rows": [
            {"height": f"{100 * row[0].height:.0f}", "cells": [_cell(place, moment, in_grid=True) for place in row]}
            for row in reversed(moment.grid)
        ],
        "distances": [f"{100 * place.distance:.0f}" for place in moment.grid[0]],
        "sideways": [{**_cell(place, moment, in_grid=False), "side": _side(place)} for place in moment.sideways],
        "at": wording.where(moment.best),
        "angles": _angles([posture for _, posture in postures]),
    }


def _side(place: Place) -> str:
    side = round(100 * place.side)
    return f"{abs(side)} {'right' if side > 0 else 'left'}" if side else "0"


def _cell(place: Place, moment: MovedSurface, *, in_grid: bool) -> dict[str, Any]:
    reba = None if place.posture is None else place.posture.reba
    mark = wording.mark(place, moment, in_grid=in_grid)
    return {"reba": reba, "level": None if reba is None else int(LEVEL_OF[reba]), "mark": mark}


def _angles(postures: list[Posture]) -> list[dict[str, Any]]:
    """Return the angles that differ between postures."""
    table = np.array([posture.angles for posture in postures])
    rows = []
    for name, values in zip(COLUMNS, table.T, strict=True):
        if not np.isnan(values).any() and np.ptp(values) >= SHOWN_DIFFERENCE:
            rows.append(
                {
                    "name": angle_name(name),
                    "values": [f"{value:.0f}".removeprefix("-" if value > -0.5 else " ") for value in values],
                }
            )
    return rows


def drawing(title: str, posture: Posture) -> str:
    """Return a posture as SVG, its part scores at the joints."""
    marks = {}
    for name in SPOTS:
        highest = PART_MAXIMA[name.removesuffix("_left").removesuffix("_right")]
        if posture.parts[name] > 1:
            marks[name] = Mark(str(posture.parts[name]), (posture.parts[name] - 1) / (highest - 1))
    return stick_figure(posture.angles, marks, f"{title}: {wording.scored(posture)}")
