"""From which mass of the first part on the order of the toolbox sequence changes: costs of both orders over the mass.

The load term depends on the time for which a part is held, not on the path, so the costs of both plans are straight
lines over the mass, exactly.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from dreba.surrogates.task_factors import OMEGA_LOAD
from lgp.experiments.toolbox_orders import GRASP_FIRST, PLACE_FIRST, skeleton_of
from lgp.logic.task import Task
from lgp.path.phases import Phases
from lgp.plan_record import Plan
from lgp.svg import SOFT, horizontal_grid, legend_line, line, points, svg, text, ticks, vertical_title

MASSES: Final = 9
"""Masses of the sweep, evenly from 0 on."""
COLOURS: Final = {PLACE_FIRST: "#1f6fa8", GRASP_FIRST: "#b4540a"}
HEIGHT = 320.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 62.0, 404.0, 46.0, 262.0


def held_seconds(task: Task, plan: Plan, part: str) -> float:
    """Return how long the person holds a part in a plan [s]."""
    alone = {name: replace(item, mass=float(name == part)) for name, item in plan.scene.objects.items()}
    slices = int(np.sum(plan.phase == 0))
    phases = Phases.of(replace(plan.scene, objects=alone), skeleton_of(task, plan), slices, plan.durations)
    return float(np.diff(plan.time, prepend=0.0) @ phases.loads().sum(axis=1))


def mass_sweep(
    totals: Mapping[str, float], seconds: Mapping[str, float], mass: float, weight: float, turn: float | None
) -> list[dict[str, Any]]:
    """Return the cost of each order for masses of the first part from 0 on, and which is cheaper.

    Args:
        totals: order -> cost with the part's `mass` [kg].
        seconds: order -> how long the part is held [s].
        weight: of a score point for a second.
        turn: mass from which on placing first pays, None without one; the sweep reaches beyond it.
    """
    end = max(2.0 * mass, 1.25 * (turn or 0.0)) or 1.0
    step = 10.0 ** math.floor(math.log10(end / (MASSES - 1)))
    step *= next(part for part in (1.0, 2.0, 2.5, 5.0, 10.0) if (MASSES - 1) * part * step >= end * (1.0 - 1e-9))
    rows = []
    for number in range(MASSES):
        other = round(number * step, 6)
        costs = {
            order: total + weight * (other - mass) * seconds[order] / OMEGA_LOAD for order, total in totals.items()
        }
        rows.append({"mass": other, "costs": costs, "order": min(costs, key=lambda order: costs[order])})
    return rows


def mass_figure(rows: Sequence[Mapping[str, Any]], mass: float, turn: float | None) -> str:
    """Return the costs of both orders over the mass of the first part as SVG, "" without a sweep."""
    if not rows:
        return ""
    masses = np.array([row["mass"] for row in rows])
    every = np.array([list(row["costs"].values()) for row in rows])
    low, high = float(every.min()), float(max(every.max(), every.min() + 1e-6))

    def x(value: Any) -> Any:
        return _LEFT + np.asarray(value) / masses[-1] * (_RIGHT - _LEFT)

    def y(cost: Any) -> Any:
        return _BOTTOM - (np.asarray(cost) - low) / (high - low) * (_BOTTOM - _TOP)

    low, high = low - 0.04 * (high - low), high + 0.04 * (high - low)
    parts = horizontal_grid(ticks(low, high), y, _LEFT, _RIGHT)
    parts.append(vertical_title(13, (_TOP + _BOTTOM) / 2, "cost of the plan"))
    for number, (order, colour) in enumerate(COLOURS.items()):
        costs = np.array([row["costs"][order] for row in rows])
        parts.append(
            f'<polyline points="{points(x(masses), y(costs))}" fill="none" stroke="{colour}" stroke-width="2.2"/>'
        )
        parts += legend_line(_LEFT + 170.0 * number, 18, order, colour)
    for value in masses[::2]:
        parts.append(text(float(x(value)), _BOTTOM + 18, f"{value:g}", size=13))
    for value, dash in ((mass, "none"), *(((turn, "5 5"),) if turn is not None and turn <= masses[-1] else ())):
        parts.append(line(float(x(value)), _TOP, float(x(value)), _BOTTOM, SOFT, 1.2, dash))
    parts.append(text((_LEFT + _RIGHT) / 2, _BOTTOM + 40, "mass of the first part [kg]", size=13, colour=SOFT))
    return svg(parts, "Lines: cost of both orders by the mass of the first part", HEIGHT)
