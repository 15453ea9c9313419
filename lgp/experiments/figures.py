"""Figures of the screwdriver experiment as SVG: Figs. 5 to 8 of the paper, and the scene with its reachability."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from lgp.experiments.runs import CONDITIONS, STARTS, pivot
from lgp.scene.model import Scene
from lgp.statistics.paired_tests import stars
from lgp.svg import (
    INK,
    LINE,
    SOFT,
    error_bar,
    horizontal_grid,
    legend_line,
    line,
    points,
    svg,
    text,
    ticks,
    vertical_title,
)
from reba.arrays import Array
from reba.method.scoring import score_array
from reba.method.tables import PART_MAXIMA
from reba.posture.columns import COLUMNS, SIDES
from reba.posture.skeleton import SPOTS, Mark, stick_figure

if TYPE_CHECKING:
    import pandas as pd

COLOURS: Final = {"non-ergonomic": "#b4540a", "ergonomic": "#1f6fa8", "re-optimized": "#7a68b5"}
"""Condition -> colour; the name of the condition stands beside it, so that colour is not the only sign."""
DASHES: Final = {"rest": "none", "random": "6 4"}
"""Initial posture -> dash pattern of its lines, as in Fig. 7 of the paper."""
HEIGHT = 320.0
_LEFT, _RIGHT, _BOTTOM = 44.0, 412.0, 272.0
_BARS_TOP, _PROFILE_TOP = 96.0, 62.0
"""Tops of the plot areas: space for the brackets above the bars, for the legend above the lines."""
_BRACKET = 26.0
"""Vertical distance of two brackets."""
_LEGEND = (_LEFT, _LEFT + 140.0, _LEFT + 256.0)
"""x of the legend entries."""
_BRACKET_LEVEL = {(0, 1): 1, (1, 2): 1, (0, 2): 2}
"""Pair of bars -> level of its bracket, so that brackets do not cross."""


def bars(scores: Mapping[str, Any], label: str) -> str:
    """Bar chart of mean scores per condition with standard errors, and a bracket over every compared pair (Figs. 5, 6).

    `scores` are `reba_grasp` or `reba_mean` of one initial posture in a summary; `label` is for screen readers.
    """
    conditions = scores["conditions"]
    means = [_number(conditions[name]["mean"]) for name in CONDITIONS]
    errors = [_number(conditions[name]["se"]) for name in CONDITIONS]
    top = max((mean + error for mean, error in zip(means, errors, strict=True)), default=0.0) or 1.0
    scale = (_BOTTOM - _BARS_TOP) / top
    step = (_RIGHT - _LEFT) / len(CONDITIONS)
    centres = [_LEFT + step * (index + 0.5) for index in range(len(CONDITIONS))]
    parts = _grid(ticks(0.0, top), lambda value: _BOTTOM - value * scale)
    for name, centre, mean, error in zip(CONDITIONS, centres, means, errors, strict=True):
        parts.append(text(centre, _BOTTOM + 18, name))
        n = conditions[name]["n"]
        note = f"{mean:.2f} (n = {n})" if n else "n = 0"
        parts.append(text(centre, _BOTTOM + 36, note, size=13, colour=SOFT))
        if not n:
            continue
        y = _BOTTOM - mean * scale
        parts.append(f'<rect x="{centre - 36:.1f}" y="{y:.1f}" width="72" height="{_BOTTOM - y:.1f}" '
                     f'fill="{COLOURS[name]}"/>')  # fmt: skip
        parts += error_bar(centre, y + error * scale, y - error * scale, 7.0)
    for pair in scores["pairs"]:
        parts += _bracket(pair, centres)
    return svg(parts, label, HEIGHT)


def _bracket(pair: Mapping[str, Any], centres: Sequence[float]) -> list[str]:
    bars_ = CONDITIONS.index(pair["first"]), CONDITIONS.index(pair["second"])
    y = _BARS_TOP - 10 - _BRACKET_LEVEL[bars_] * _BRACKET + 6
    a, b = centres[bars_[0]] + 6, centres[bars_[1]] - 6
    mark = "not tested" if pair["p_holm"] is None else stars(pair["p_holm"]) or "n.s."
    return [line(a, y, b, y), line(a, y, a, y + 7), line(b, y, b, y + 7), text((a + b) / 2, y - 5, mark)]


def profile(paths: pd.DataFrame, label: str) -> str:
    """Mean REBA score over time per condition and initial posture, its standard error as a band (Fig. 7).

    `label` is the text for screen readers.
    """
    means = paths.groupby(["initial", "condition", "time"])["reba"].agg(["mean", "sem"]).fillna({"sem": 0.0})
    means = means.reset_index()
    starts = [start for start in STARTS if (means["initial"] == start).any()]
    end = float(paths["time"].max()) if len(paths) else 1.0
    low, high = ((means["mean"] - means["sem"]).min(), (means["mean"] + means["sem"]).max()) if len(means) else (1, 2)
    bottom, top = float(np.floor(low)), float(max(np.ceil(high), np.floor(low) + 1))

    def x(time: Any) -> Any:
        return _LEFT + np.asarray(time) / end * (_RIGHT - _LEFT)

    def y(score: Any) -> Any:
        return _BOTTOM - (np.asarray(score) - bottom) / (top - bottom) * (_BOTTOM - _PROFILE_TOP)

    parts = _grid(sorted({bottom, *ticks(bottom, top)}), lambda value: float(y(value)))
    parts += _phases(paths, x)
    for start in starts:
        for condition in CONDITIONS:
            curve = means[(means["initial"] == start) & (means["condition"] == condition)]
            px, mean, error = x(curve["time"].to_numpy()), curve["mean"].to_numpy(), curve["sem"].to_numpy()
            band = points(np.r_[px, px[::-1]], y(np.r_[mean + error, (mean - error)[::-1]]))
            parts.append(f'<polygon points="{band}" fill="{COLOURS[condition]}" fill-opacity="0.16"/>')
            parts.append(f'<polyline points="{points(px, y(mean))}" fill="none" stroke="{COLOURS[condition]}" '
                         f'stroke-width="2.2" stroke-dasharray="{DASHES[start]}"/>')  # fmt: skip
    return svg([*parts, *_legend(starts)], label, HEIGHT)


def _phases(paths: pd.DataFrame, x: Any) -> list[str]:
    """Dividers between the phases, with their numbers; plans of different lengths share those of the longest."""
    ends = paths.groupby("phase")["time"].max()
    parts, begin = [], 0.0
    for phase, end in zip(ends.index.tolist(), ends.tolist(), strict=True):
        parts.append(line(float(x(end)), _PROFILE_TOP, float(x(end)), _BOTTOM, LINE, 1.0))
        parts.append(text(float(x((begin + end) / 2)), _BOTTOM + 18, f"phase {phase + 1}"))
        parts.append(text(float(x(end)), _BOTTOM + 36, f"{end:g} s", size=12, colour=SOFT, anchor="end"))
        begin = float(end)
    return parts


def _legend(starts: Sequence[str]) -> list[str]:
    parts = []
    for x, name in zip(_LEGEND, CONDITIONS, strict=True):
        parts += legend_line(x, 14, name, COLOURS[name])
    for x, start in zip(_LEGEND, starts, strict=False):
        parts += legend_line(x, 38, f"{start} start", width=2.2, dash=DASHES[start])
    return parts


def _grid(values: Sequence[float], y: Callable[[float], float]) -> list[str]:
    title = vertical_title(13, (_BOTTOM + _PROFILE_TOP) / 2, "mean REBA score")
    return [*horizontal_grid(values, y, _LEFT, _RIGHT), title]


def _number(value: float | None) -> float:
    return 0.0 if value is None else value


COMPARED: Final = ("non-ergonomic", "re-optimized")
"""Conditions of Fig. 8: the same sequence of actions, planned without and with the ergonomic cost."""


@dataclass(frozen=True)
class Posture:
    """Posture at the grasp as a figure: its condition, table, true REBA score and SVG."""

    condition: str
    table: str
    reba: int
    svg: str


@dataclass(frozen=True)
class Example:
    """Representative run: the one of median difference in REBA score between the two conditions of `COMPARED`.

    Attributes:
        of: number of runs it was chosen from.
        difference: score without minus score with the ergonomic cost [points].
        postures: one per condition of `COMPARED`.
    """

    run: int
    start: str
    of: int
    difference: float
    postures: tuple[Posture, ...]


def example(runs: pd.DataFrame, paths: pd.DataFrame) -> Example | None:
    """Run of median difference, from the random start if it has runs; None if no run has both conditions."""
    for start in reversed(STARTS):
        scores = pivot(runs, "reba_grasp", start)[list(COMPARED)].dropna()
        if not len(scores):
            continue
        differences = (scores[COMPARED[0]] - scores[COMPARED[1]]).sort_values(kind="stable")
        run = int(differences.index[len(differences) // 2])
        tables = runs[(runs["run"] == run) & (runs["initial"] == start)].set_index("condition")["table"]
        path = paths[(paths["run"] == run) & (paths["initial"] == start)]
        if not set(COMPARED) <= set(path["condition"]):
            continue
        postures = tuple(_posture(path[path["condition"] == name], name, str(tables[name])) for name in COMPARED)
        return Example(run, start, len(scores), float(differences.loc[run]), postures)
    return None


def _posture(path: pd.DataFrame, condition: str, table: str) -> Posture:
    last = path.sort_values("slice").iloc[-1]
    angles = last[list(COLUMNS)].to_numpy(dtype=float)
    scores = score_array(angles[None], {"load": float(last["load"])})
    marks = {}
    for name in SPOTS:
        part = next((name.removesuffix(f"_{side}") for side in SIDES if name.endswith(side)), name)
        value = int(scores[name][0])
        # 255 marks a score that unmeasured angles leave undetermined.
        if 1 < value <= PART_MAXIMA[part]:
            marks[name] = Mark(str(value), (value - 1) / (PART_MAXIMA[part] - 1))
    reba = int(np.rint(last["reba"]))
    return Posture(condition, table, reba, stick_figure(angles, marks, f"{condition}: grasp with REBA {reba}"))


SCALE: Final = 200.0
"""View box units per metre."""
MARGIN: Final = 0.22
"""Floor around the outermost table or agent [m]."""


def reach_map(scene: Scene, spots: pd.DataFrame) -> str:
    """Scene from above with the share of table heights that are reached; the human's forward axis x points up.

    `spots` has rows of `hand table height x y reached`, see `lgp.kinematics.reachability.Reachability.data`.
    """
    corners = {name: _corners(table.position, table.size, table.yaw) for name, table in scene.tables.items()}
    feet = np.array([agent.position[:2] for agent in scene.agents])
    outline = np.concatenate([*corners.values(), feet])
    low, high = outline.min(axis=0) - MARGIN, outline.max(axis=0) + MARGIN

    def to_view(positions: Array) -> Array:
        """Positions on the floor (n, 2) [m] -> view box (n, 2)."""
        return np.stack([high[1] - positions[:, 1], high[0] - positions[:, 0]], axis=1) * SCALE

    width, height = (high - low)[::-1] * SCALE
    parts = []
    for name, edge in corners.items():
        border = " ".join(f"{x:.0f},{y:.0f}" for x, y in to_view(edge))
        parts.append(f'<polygon points="{border}" fill="#ffffff" stroke="{SOFT}"/>')
        x, y = to_view(edge).mean(axis=0)
        top = to_view(edge)[:, 1].min()
        parts.append(text(x, top - 6, name.removeprefix("table."), size=15))
    shares = _reached_shares(spots)
    for (x, y), share in zip(to_view(shares[["x", "y"]].to_numpy()), shares["share"], strict=True):
        parts.append(
            f'<circle cx="{x:.0f}" cy="{y:.0f}" r="5" fill="#1f6fa8" fill-opacity="{0.08 + 0.82 * share:.2f}" '
            f'stroke="{SOFT}" stroke-width="0.6"><title>{100 * share:.0f} % of the heights</title></circle>'
        )
    for agent, (x, y) in zip(scene.agents, to_view(feet), strict=True):
        yaw = np.radians(agent.yaw)
        nose = to_view(np.array([agent.position[:2]]) + 0.12 * np.array([[np.cos(yaw), np.sin(yaw)]]))[0]
        parts.append(f'<circle cx="{x:.0f}" cy="{y:.0f}" r="11" fill="{INK}"/>')
        parts.append(
            f'<line x1="{x:.0f}" y1="{y:.0f}" x2="{nose[0]:.0f}" y2="{nose[1]:.0f}" stroke="{INK}" stroke-width="5"/>'
        )
        # Behind the back, where the name does not cover the reached area.
        parts.append(text(x, y + 28 if nose[1] <= y else y - 18, agent.name, size=15))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="chart" viewBox="0 0 {width:.0f} {height:.0f}" role="img" '
        f'aria-label="The scene from above with the share of heights that are reached" font-family="sans-serif">'
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="#f7f8fa" stroke="{LINE}"/>{"".join(parts)}</svg>'
    )


def _reached_shares(spots: pd.DataFrame) -> pd.DataFrame:
    """Columns `x y share`: share of the heights at which both the human and a hand of a robot reach the spot.

    On tables of fixed height, where objects lie initially, only the robots count: the human need not reach them.
    """
    heights = spots.groupby("table")["height"].transform("nunique")
    human = spots["hand"].str.startswith("human.")
    wanted = spots[(heights > 1) | ~human].assign(human=human)
    by_agent = wanted.groupby(["table", "x", "y", "height", "human"])["reached"].max()
    both = by_agent.groupby(level=["table", "x", "y", "height"]).min()
    return both.groupby(level=["table", "x", "y"]).mean().rename("share").reset_index()


def _corners(position: tuple[float, float], size: tuple[float, float], yaw: float) -> Array:
    angle = np.radians(yaw)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array(size) / 2.0
    rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return np.asarray(corners @ rotation + position)
