"""Pareto fronts of the screwdriver experiment: mean REBA score against time, and against the effort of the robot.

A front is traced by a weight of the cost: each value is planned for the same draws of table heights, in a folder of its
own, so that an interrupted analysis continues. A weighted sum finds the convex part of a front only.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from lgp.experiments.runs import RunStore
from lgp.experiments.summary import ERGONOMIC
from lgp.experiments.variations import SceneVariation, own_value
from lgp.scene.model import Scene
from lgp.statistics.paired_tests import mean_of
from lgp.svg import SOFT, error_bar, horizontal_grid, points, svg, text, ticks, vertical_title
from reba.report.page import read

if TYPE_CHECKING:
    import pandas as pd

FOLDER: Final = "pareto"
"""Folder of these runs, below that of the experiment."""
SCORE: Final = "reba_mean"
"""Column of the runs that every front has: the mean true REBA score over the plan."""
COLOUR: Final = "#1f6fa8"
HEIGHT = 320.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 52.0, 404.0, 22.0, 262.0


def fronts(scene: Scene) -> dict[str, list[tuple[float, SceneVariation]]]:
    """Return the variations of each front with the value of its weight, by the column of runs that it trades.

    >>> from lgp.scene.scene_file import load_scene
    >>> {name: len(one) for name, one in fronts(load_scene("screwdriver")).items()}
    {'duration': 7, 'robot_effort': 7}
    """
    varied = {}
    for name, entry in _entries().items():
        now = float(own_value(scene, entry["key"]))
        values = [*entry.get("values", ()), *(round(now * factor, 9) for factor in entry.get("factors", ()))]
        changes = entry.get("changes", {})
        varied[name] = [
            (value, SceneVariation(name, f"{value:g}", json.dumps({**changes, entry["key"]: value})))
            for value in values
        ]
    return varied


def pareto_fronts(
    folder: str | Path,
    scene: Scene,
    runs: int,
    settings: Mapping[str, Any],
    plan: Callable[..., Iterable[tuple[pd.DataFrame, pd.DataFrame]]],
    *,
    on_event: Callable[[str], None] | None = None,
) -> list[dict[str, Any]]:
    """Plan the missing runs of every weight from the rest posture; return each front with its points as plain data.

    Args:
        scene: that is varied.
        plan: plans the runs of these numbers with `scene=`, see `lgp.experiments.screwdriver.plan_runs`.
        on_event: called with one line for each weight that lacks runs.

    Raises:
        LgpError: a folder holds runs of other settings.
    """
    traced = []
    for name, varied in fronts(scene).items():
        rows = []
        for value, variation in varied:
            own = {**settings, "front": name, "value": value}
            store = RunStore(Path(folder) / FOLDER / variation.name, own)
            missing = set(range(runs)) - store.done("rest")
            if missing and on_event is not None:
                on_event(f"{name}, weight {value:g}: {len(missing)} runs")
            table, _ = store.complete(runs, "rest", partial(plan, scene=variation.scene(scene)))
            rows.append((value, table[table["run"] < runs]))
        entry = _entries()[name]
        traced.append({
            "name": name, "title": entry["title"], "axis": entry["axis"], "weight": entry["weight"],
            "points": points_of(name, rows),
        })  # fmt: skip
    return traced


def points_of(name: str, tables: Sequence[tuple[float, pd.DataFrame]]) -> list[dict[str, Any]]:
    """Return the points of a front, one for each weight: means over the runs that are feasible with every weight.

    Args:
        name: column of the runs that is traded for the score.
        tables: weight and its runs.
    """
    ergonomic = [(value, runs[runs["condition"] == ERGONOMIC].set_index("run")) for value, runs in tables]
    common = set.intersection(*(set(runs.index[runs["feasible"]]) for _, runs in ergonomic))
    made = []
    for value, runs in ergonomic:
        used = runs.loc[sorted(common)]
        made.append({
            "value": value, "n": len(used), "of": len(runs),
            **{column: asdict(mean_of(used[column])) for column in (name, SCORE, "reba_grasp")},
        })  # fmt: skip
    for one in made:
        one["on_front"] = not any(_dominates(other, one, name) for other in made)
    return made


def _dominates(first: Mapping[str, Any], second: Mapping[str, Any], name: str) -> bool:
    """Whether a point is no worse in both means, and better in one."""
    a, b = ([one[column]["mean"] for column in (name, SCORE)] for one in (first, second))
    return bool(np.less_equal(a, b).all() and np.less(a, b).any())


def pareto_figure(front: Mapping[str, Any]) -> str:
    """Return a front as SVG: means with standard errors, joined by rising weight; points off the front are hollow.

    An empty text where fewer than two points have runs.
    """
    name, rows = front["name"], [one for one in front["points"] if one["n"]]
    if len(rows) < 2:
        return ""
    across, up = (np.array([[one[key]["mean"], one[key]["se"] or 0.0] for one in rows], float) for key in (name, SCORE))
    across, up = (np.nan_to_num(part) for part in (across, up))
    logarithmic = across[:, 0].min() > 0.0
    scaled = np.log10(across[:, 0]) if logarithmic else across[:, 0]
    low, high = float(scaled.min()), float(max(scaled.max(), scaled.min() + 1e-9))
    bottom, top = 1.0, float(max(1.5, (up[:, 0] + up[:, 1]).max() * 1.02))

    def x(value: Any) -> Any:
        return _LEFT + 20 + (np.asarray(value) - low) / (high - low) * (_RIGHT - _LEFT - 40)

    def y(score: Any) -> Any:
        return _BOTTOM - (np.asarray(score) - bottom) / (top - bottom) * (_BOTTOM - _TOP)

    parts = horizontal_grid([bottom, *(tick for tick in ticks(bottom, top) if tick > bottom)], y, _LEFT, _RIGHT)
    parts.append(vertical_title(14, (_TOP + _BOTTOM) / 2, "mean REBA score"))
    px, py = x(scaled), y(up[:, 0])
    parts.append(f'<polyline points="{points(px, py)}" fill="none" stroke="{COLOUR}" stroke-width="1.4"/>')
    for number, (row, left, height) in enumerate(zip(rows, px, py, strict=True)):
        parts += error_bar(float(left), float(y(up[number].sum())), float(y(up[number, 0] - up[number, 1])), 4.0)
        fill = COLOUR if row["on_front"] else "#ffffff"
        parts.append(f'<circle cx="{left:.1f}" cy="{height:.1f}" r="5" fill="{fill}" stroke="{COLOUR}"/>')
        parts.append(
            text(float(left) + 8, float(height) - 8, f"{row['value']:g}", size=12, colour=SOFT, anchor="start")
        )
    for value in _axis_ticks(across[:, 0], logarithmic):
        parts.append(text(float(x(np.log10(value) if logarithmic else value)), _BOTTOM + 18, f"{value:.3g}", size=13))
    parts.append(text((_LEFT + _RIGHT) / 2, _BOTTOM + 40, front["axis"], size=13, colour=SOFT))
    return svg(parts, f"Points: {front['title']}, by weight", HEIGHT)


def _axis_ticks(values: Any, logarithmic: bool) -> list[float]:
    """Return the ends of the axis and its middle."""
    low, high = float(values.min()), float(values.max())
    return [low, float(np.sqrt(low * high)) if logarithmic else 0.5 * (low + high), high] if high > low else [low]


@cache
def _entries() -> dict[str, dict[str, Any]]:
    return tomllib.loads(read("lgp.experiments", "pareto.toml"))
