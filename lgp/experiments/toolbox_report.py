"""The page of the toolbox experiment: sequences beside the paper's, what orders cost, true REBA scores by part."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from lgp.experiments.figures import COLOURS
from lgp.experiments.toolbox_orders import ORDERS
from lgp.plan_record import Plan
from lgp.scene.model import Scene
from lgp.statistics.formatting import number
from lgp.svg import INK, LINE, SOFT, line, points, svg, text, ticks
from reba.files import write_atomic, write_text
from reba.report.page import template

NAMES: Final = {
    "trunk": "trunk",
    "neck": "neck",
    "legs": "legs",
    "load_force": "weight",
    "upper_arm_right": "shoulder, right",
    "lower_arm_right": "elbow, right",
    "wrist_right": "wrist, right",
    "upper_arm_left": "shoulder, left",
    "lower_arm_left": "elbow, left",
    "wrist_left": "wrist, left",
}
"""Part scores as the paper's Fig. 11 calls them."""
HEIGHT = 300.0
_LEFT, _RIGHT, _UP, _DOWN = 44.0, 412.0, 46.0, 252.0


def write_page(
    folder: str | Path, summary: Mapping[str, Any], plans: Mapping[str, Plan], scene: Scene, command: str = ""
) -> None:
    """Write `report.html` into a folder.

    Args:
        folder: of the results.
        summary: as `lgp.experiments.toolbox.experiment` returns it.
        plans: condition -> its plan.
        scene: what was planned for.
        command: command line to show, so that the page can be made again.

    Raises:
        RebaError: it cannot be written.
    """
    from markupsafe import Markup

    html = template("lgp.experiments", "toolbox.html", {"number": number, "short": _short}).render(
        summary=summary,
        names=NAMES,
        orders=ORDERS,
        scene=scene,
        chart=Markup(over_time(plans)),
        command=command,
    )
    write_atomic(Path(folder) / "report.html", lambda part: write_text(part, html))


def over_time(plans: Mapping[str, Plan]) -> str:
    """Return the true REBA score of every slice, one stepped line a condition, as SVG."""
    scores = {name: plan.reba() for name, plan in plans.items()}
    values = {name: np.asarray(found.reba, dtype=float) for name, found in scores.items() if found is not None}
    times = {name: np.concatenate([[0.0], plans[name].time]) for name in values}
    end = max((float(time[-1]) for time in times.values()), default=1.0)
    top = max((float(series.max()) for series in values.values()), default=1.0) + 1.0

    def x(time: Any) -> Any:
        return _LEFT + np.asarray(time) / end * (_RIGHT - _LEFT)

    def y(score: Any) -> Any:
        return _DOWN - np.asarray(score) / top * (_DOWN - _UP)

    parts = []
    for tick in (tick for tick in ticks(0.0, top) if tick == int(tick)):
        parts += [line(_LEFT, float(y(tick)), _RIGHT, float(y(tick)), LINE, 1.0)]
        parts.append(text(_LEFT - 6, float(y(tick)) + 4.5, f"{tick:g}", anchor="end"))
    longest = max(plans.values(), key=lambda plan: len(plan.actions))
    for step in range(len(longest.actions)):
        here = longest.time[longest.phase == step]
        parts.append(line(float(x(here[-1])), _UP, float(x(here[-1])), _DOWN, LINE, 1.0))
        parts.append(text(float(x(here.mean())), _DOWN + 18, str(step + 1)))
    parts.append(text((_LEFT + _RIGHT) / 2, _DOWN + 38, "action", size=13, colour=SOFT))
    for place, (name, series) in enumerate(values.items()):
        at = _LEFT + 150.0 * place
        parts += [line(at, 16, at + 22, 16, COLOURS[name], 4.0), text(at + 28, 21, name, anchor="start", colour=INK)]
        # A slice stands for the time that ends with it; two equal lines stay visible one unit apart.
        stepped = np.repeat(times[name], 2)[1:-1], np.repeat(series, 2)
        shape = points(x(stepped[0]), y(stepped[1]) - 1.5 * place)
        parts.append(f'<polyline points="{shape}" fill="none" stroke="{COLOURS[name]}" stroke-width="2.2"/>')
    return svg(parts, "Lines: true REBA score over the actions of both plans", HEIGHT)


def _short(action: str) -> str:
    """Return an action without what all names of parts begin with."""
    return action.replace("toolbox/", "")
