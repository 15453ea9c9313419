"""The paper's Figs. 5 to 7 as plain SVG: bars with standard errors and significance, and the profile of a plan.

Drawn 420 units wide, so that the text is readable on a telephone and the files stand alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from lgp.experiments.runs import CONDITIONS, STARTS, pivot
from lgp.scene.model import Scene
from lgp.statistics.paired_tests import stars
from lgp.svg import INK, LINE, SOFT, line, points, svg, text, ticks
from reba.arrays import Array
from reba.method.scoring import score_array
from reba.method.tables import PART_MAXIMA
from reba.posture.columns import COLUMNS, SIDES
from reba.posture.skeleton import SPOTS, Mark, stick_figure

if TYPE_CHECKING:
    import pandas as pd

COLOURS: Final = {"non-ergonomic": "#b4540a", "ergonomic": "#1f6fa8", "re-optimized": "#7a68b5"}
"""One per condition; each also has its name beside it."""
DASHES: Final = {"rest": "none", "random": "6 4"}
"""As in the paper's Fig. 7."""
HEIGHT = 320.0
_LEFT, _RIGHT, _DOWN = 44.0, 412.0, 272.0
_BARS_UP, _PROFILE_UP = 96.0, 62.0
"""Room above the bars for the brackets, above the lines for the key."""
_BRACKET = 26.0
_KEY = (_LEFT, _LEFT + 140.0, _LEFT + 256.0)
"""Where the entries of the key begin."""
_LEVEL = {(0, 1): 1, (1, 2): 1, (0, 2): 2}
"""How high the bracket over a pair of bars stands."""


def bars(scores: Mapping[str, Any], label: str) -> str:
    """Return mean scores per condition with standard errors, and a bracket over every compared pair.

    Args:
        scores: `reba_grasp` or `reba_mean` of one start of a summary.
        label: text for people who cannot see it.
    """
    conditions = scores["conditions"]
    means = [_number(conditions[name]["mean"]) for name in CONDITIONS]
    errors = [_number(conditions[name]["se"]) for name in CONDITIONS]
    top = max((mean + error for mean, error in zip(means, errors, strict=True)), default=0.0) or 1.0
    scale = (_DOWN - _BARS_UP) / top
    step = (_RIGHT - _LEFT) / len(CONDITIONS)
    centres = [_LEFT + step * (place + 0.5) for place in range(len(CONDITIONS))]
    parts = _grid(ticks(0.0, top), lambda value: _DOWN - value * scale, "mean REBA score")
    for name, centre, mean, error in zip(CONDITIONS, centres, means, errors, strict=True):
        parts.append(text(centre, _DOWN + 18, name))
        n = conditions[name]["n"]
        said = f"{mean:.2f} (n = {n})" if n else "n = 0"
        parts.append(text(centre, _DOWN + 36, said, size=13, colour=SOFT))
        if not n:
            continue
        y = _DOWN - mean * scale
        parts.append(f'<rect x="{centre - 36:.1f}" y="{y:.1f}" width="72" height="{_DOWN - y:.1f}" '
                     f'fill="{COLOURS[name]}"/>')  # fmt: skip
        low, high = y + error * scale, y - error * scale
        parts += [line(centre, low, centre, high), *(line(centre - 7, end, centre + 7, end) for end in (low, high))]
    for pair in scores["pairs"]:
        parts += _bracket(pair, centres)
    return svg(parts, label, HEIGHT)


def _bracket(pair: Mapping[str, Any], centres: Sequence[float]) -> list[str]:
    places = CONDITIONS.index(pair["first"]), CONDITIONS.index(pair["second"])
    y = _BARS_UP - 10 - _LEVEL[places] * _BRACKET + 6
    a, b = centres[places[0]] + 6, centres[places[1]] - 6
    mark = "not tested" if pair["p_holm"] is None else stars(pair["p_holm"]) or "n.s."
    return [line(a, y, b, y), line(a, y, a, y + 7), line(b, y, b, y + 7), text((a + b) / 2, y - 5, mark)]


def profile(paths: pd.DataFrame, label: str) -> str:
    """Return the mean score over the time of the plans, per condition and start, with its standard error as a band.

    Args:
        paths: with `lgp.experiments.runs.PATH_COLUMNS`.
        label: text for people who cannot see it.
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
        return _DOWN - (np.asarray(score) - bottom) / (top - bottom) * (_DOWN - _PROFILE_UP)

    parts = _grid(sorted({bottom, *ticks(bottom, top)}), lambda value: float(y(value)), "mean REBA score")
    parts += _phases(paths, x)
    for start in starts:
        for condition in CONDITIONS:
            curve = means[(means["initial"] == start) & (means["condition"] == condition)]
            px, mean, error = x(curve["time"].to_numpy()), curve["mean"].to_numpy(), curve["sem"].to_numpy()
            band = points(np.r_[px, px[::-1]], y(np.r_[mean + error, (mean - error)[::-1]]))
            parts.append(f'<polygon points="{band}" fill="{COLOURS[condition]}" fill-opacity="0.16"/>')
            parts.append(f'<polyline points="{points(px, y(mean))}" fill="none" stroke="{COLOURS[condition]}" '
                         f'stroke-width="2.2" stroke-dasharray="{DASHES[start]}"/>')  # fmt: skip
    return svg([*parts, *_key(starts)], label, HEIGHT)


def _phases(paths: pd.DataFrame, x: Any) -> list[str]:
    """Return dividers between the phases and their numbers; plans of unlike lengths share the longest one's."""
    ends = paths.groupby("phase")["time"].max()
    parts, before = [], 0.0
    for phase, end in zip(ends.index.tolist(), ends.tolist(), strict=True):
        parts.append(line(float(x(end)), _PROFILE_UP, float(x(end)), _DOWN, LINE, 1.0))
        parts.append(text(float(x((before + end) / 2)), _DOWN + 18, f"phase {phase + 1}"))
        parts.append(text(float(x(end)), _DOWN + 36, f"{end:g} s", size=12, colour=SOFT, anchor="end"))
        before = float(end)
    return parts


def _key(starts: Sequence[str]) -> list[str]:
    parts = []
    for at, name in zip(_KEY, CONDITIONS, strict=True):
        parts += [line(at, 14, at + 22, 14, COLOURS[name], 4.0), text(at + 28, 19, name, anchor="start")]
    for at, start in zip(_KEY, starts, strict=False):
        parts.append(line(at, 38, at + 22, 38, INK, 2.2, DASHES[start]))
        parts.append(text(at + 28, 43, f"{start} start", anchor="start"))
    return parts


def _grid(at: Sequence[float], y: Any, title: str) -> list[str]:
    parts = []
    for tick in at:
        parts.append(line(_LEFT, y(tick), _RIGHT, y(tick), LINE, 1.0))
        parts.append(text(_LEFT - 6, y(tick) + 4.5, f"{tick:g}", anchor="end"))
    middle = (_DOWN + _PROFILE_UP) / 2
    turned = f'<g transform="translate(13 {middle:.1f}) rotate(-90)">{text(0, 0, title, size=13, colour=SOFT)}</g>'
    return [*parts, turned]


def _number(value: float | None) -> float:
    return 0.0 if value is None else value


COMPARED: Final = ("non-ergonomic", "re-optimized")
"""Conditions of the two figures: the same sequence of actions, planned without and with the ergonomic cost."""


@dataclass(frozen=True)
class Posture:
    """A drawn posture: its condition, table, true REBA score, and SVG."""

    condition: str
    table: str
    reba: int
    svg: str


@dataclass(frozen=True)
class Example:
    """The run that stands for all: of median difference in score between the two conditions.

    Attributes:
        run, start: which one.
        of: runs it was chosen from.
        difference: its score without minus its score with the ergonomic cost.
        postures: one per condition of `COMPARED`.
    """

    run: int
    start: str
    of: int
    difference: float
    postures: tuple[Posture, ...]


def example(runs: pd.DataFrame, paths: pd.DataFrame) -> Example | None:
    """Return the run of median difference, of random starts if there are any; None where none has both conditions."""
    for start in reversed(STARTS):
        scores = pivot(runs, "reba_grasp", start)[list(COMPARED)].dropna()
        if not len(scores):
            continue
        differences = (scores[COMPARED[0]] - scores[COMPARED[1]]).sort_values(kind="stable")
        run = int(differences.index[len(differences) // 2])
        here = runs[(runs["run"] == run) & (runs["initial"] == start)].set_index("condition")["table"]
        mine = paths[(paths["run"] == run) & (paths["initial"] == start)]
        if not set(COMPARED) <= set(mine["condition"]):
            continue
        postures = tuple(_posture(mine[mine["condition"] == name], name, str(here[name])) for name in COMPARED)
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
        # 255 stands for a score that the angles leave open.
        if 1 < value <= PART_MAXIMA[part]:
            marks[name] = Mark(str(value), (value - 1) / (PART_MAXIMA[part] - 1))
    reba = int(np.rint(last["reba"]))
    return Posture(condition, table, reba, stick_figure(angles, marks, f"{condition}: grasp with REBA {reba}"))


SCALE: Final = 200.0
"""Units of the drawing per metre."""
MARGIN: Final = 0.22
"""Floor drawn around everything [m]."""


def reach_map(scene: Scene, spots: pd.DataFrame) -> str:
    """Return the drawing; the human's forward direction (x) points up, so its left is on the left.

    Args:
        scene: the scene.
        spots: rows of `hand table height x y reached`, as `lgp.kinematics.reachability.Reachability.data`.
    """
    corners = {name: _corners(table.position, table.size, table.yaw) for name, table in scene.tables.items()}
    feet = np.array([agent.position[:2] for agent in scene.agents])
    everything = np.concatenate([*corners.values(), feet])
    low, high = everything.min(axis=0) - MARGIN, everything.max(axis=0) + MARGIN

    def at(points: Array) -> Array:
        """Floor [m] (n, 2) -> drawing (n, 2)."""
        return np.stack([high[1] - points[:, 1], high[0] - points[:, 0]], axis=1) * SCALE

    width, height = (high - low)[::-1] * SCALE
    parts = []
    for name, edge in corners.items():
        outline = " ".join(f"{x:.0f},{y:.0f}" for x, y in at(edge))
        parts.append(f'<polygon points="{outline}" fill="#ffffff" stroke="{SOFT}"/>')
        x, y = at(edge).mean(axis=0)
        top = at(edge)[:, 1].min()
        parts.append(_text(x, top - 6, name.removeprefix("table."), INK))
    for (x, y), share in zip(at(_spots(spots)[["x", "y"]].to_numpy()), _spots(spots)["share"], strict=True):
        parts.append(
            f'<circle cx="{x:.0f}" cy="{y:.0f}" r="5" fill="#1f6fa8" fill-opacity="{0.08 + 0.82 * share:.2f}" '
            f'stroke="{SOFT}" stroke-width="0.6"><title>{100 * share:.0f} % of the heights</title></circle>'
        )
    for agent, (x, y) in zip(scene.agents, at(feet), strict=True):
        ahead = np.radians(agent.yaw)
        nose = at(np.array([agent.position[:2]]) + 0.12 * np.array([[np.cos(ahead), np.sin(ahead)]]))[0]
        parts.append(f'<circle cx="{x:.0f}" cy="{y:.0f}" r="11" fill="{INK}"/>')
        parts.append(
            f'<line x1="{x:.0f}" y1="{y:.0f}" x2="{nose[0]:.0f}" y2="{nose[1]:.0f}" stroke="{INK}" stroke-width="5"/>'
        )
        # The name stands behind the back.
        parts.append(_text(x, y + 28 if nose[1] <= y else y - 18, agent.name, INK))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="chart" viewBox="0 0 {width:.0f} {height:.0f}" role="img" '
        f'aria-label="The scene from above with the share of heights that are reached" font-family="sans-serif">'
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="#f7f8fa" stroke="{LINE}"/>{"".join(parts)}</svg>'
    )


def _spots(spots: pd.DataFrame) -> pd.DataFrame:
    """Return `x y share`: how many of the heights the human and some hand of a robot reach; one side where it is fixed.

    Tables of a given height are where objects lie at first, which only robots need to reach.
    """
    heights = spots.groupby("table")["height"].transform("nunique")
    human = spots["hand"].str.startswith("human.")
    wanted = spots[(heights > 1) | ~human].assign(human=human)
    somebody = wanted.groupby(["table", "x", "y", "height", "human"])["reached"].max()
    both = somebody.groupby(level=["table", "x", "y", "height"]).min()
    return both.groupby(level=["table", "x", "y"]).mean().rename("share").reset_index()


def _corners(position: tuple[float, float], size: tuple[float, float], yaw: float) -> Array:
    turn = np.radians(yaw)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array(size) / 2.0
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return np.asarray(corners @ rotation + position)


def _text(x: float, y: float, words: str, colour: str) -> str:
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="middle" font-size="15" fill="{colour}">{words}</text>'
