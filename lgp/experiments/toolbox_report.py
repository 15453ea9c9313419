"""HTML report of the toolbox experiment: sequences beside the paper's, costs of the orders, true scores by part."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from lgp.experiments.figures import COLOURS
from lgp.experiments.toolbox_mass import mass_figure
from lgp.experiments.toolbox_orders import ORDERS
from lgp.experiments.variants import Variant
from lgp.files import REPORT
from lgp.plan_record import Plan
from lgp.scene.model import Scene
from lgp.statistics.formatting import number
from lgp.svg import LINE, SOFT, horizontal_grid, legend_line, line, points, svg, text, ticks
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
_LEFT, _RIGHT, _TOP, _BOTTOM = 44.0, 412.0, 46.0, 252.0


def write_page(
    folder: str | Path,
    summary: Mapping[str, Any],
    plans: Mapping[str, Plan],
    scene: Scene,
    chosen: Variant,
    command: str = "",
) -> None:
    """Write `report.html` into a folder.

    Args:
        summary: returned by `lgp.experiments.toolbox.experiment_toolbox`.
        plans: condition -> its plan.
        chosen: variant of the experiment; its assumptions are listed.
        scene: the planned scene; its free choices are listed with their reasons.
        command: command line that reproduces the results, shown on the page.

    Raises:
        RebaError: the file cannot be written.
    """
    from markupsafe import Markup

    html = template("lgp.experiments", "toolbox.html", {"number": number, "short": _short}).render(
        summary=summary,
        names=NAMES,
        orders=ORDERS,
        scene=scene,
        choices=chosen.left_open(scene),
        variant=chosen,
        chart=Markup(over_time(plans)),
        masses=Markup(_masses(summary)),
        command=command,
    )
    write_atomic(Path(folder) / REPORT, lambda part: write_text(part, html))


def _masses(summary: Mapping[str, Any]) -> str:
    first = summary["conditions"]["ergonomic"]["first_part"]
    return mass_figure(first["sweep"], first["mass"], first["mass_for_place_first"])


def over_time(plans: Mapping[str, Plan]) -> str:
    """True REBA score of every slice over time, one stepped line per condition, as SVG."""
    scores = {name: plan.reba() for name, plan in plans.items()}
    values = {name: np.asarray(table.reba, dtype=float) for name, table in scores.items() if table is not None}
    times = {name: np.concatenate([[0.0], plans[name].time]) for name in values}
    end = max((float(time[-1]) for time in times.values()), default=1.0)
    top = max((float(series.max()) for series in values.values()), default=1.0) + 1.0

    def x(time: Any) -> Any:
        return _LEFT + np.asarray(time) / end * (_RIGHT - _LEFT)

    def y(score: Any) -> Any:
        return _BOTTOM - np.asarray(score) / top * (_BOTTOM - _TOP)

    parts = horizontal_grid([tick for tick in ticks(0.0, top) if tick == int(tick)], y, _LEFT, _RIGHT)
    longest = max(plans.values(), key=lambda plan: len(plan.actions))
    for step in range(len(longest.actions)):
        phase = longest.time[longest.phase == step]
        parts.append(line(float(x(phase[-1])), _TOP, float(x(phase[-1])), _BOTTOM, LINE, 1.0))
        parts.append(text(float(x(phase.mean())), _BOTTOM + 18, str(step + 1)))
    parts.append(text((_LEFT + _RIGHT) / 2, _BOTTOM + 38, "action", size=13, colour=SOFT))
    for index, (name, series) in enumerate(values.items()):
        parts += legend_line(_LEFT + 150.0 * index, 16, name, COLOURS[name])
        # A slice covers the interval that ends at its time; the shift of 1.5 units keeps equal lines visible.
        stepped = np.repeat(times[name], 2)[1:-1], np.repeat(series, 2)
        shape = points(x(stepped[0]), y(stepped[1]) - 1.5 * index)
        parts.append(f'<polyline points="{shape}" fill="none" stroke="{COLOURS[name]}" stroke-width="2.2"/>')
    return svg(parts, "Lines: true REBA score over the actions of both plans", HEIGHT)


def _short(action: str) -> str:
    """Action without the prefix `toolbox/` of its part names."""
    return action.replace("toolbox/", "")
