"""The scene from above as SVG: tables, who stands where, and how much of each table's heights everybody reaches."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

    from lgp.world.scene import Scene

Array = NDArray[np.float64]

SCALE: Final = 200.0
"""Units of the drawing per metre."""
MARGIN: Final = 0.22
"""Floor drawn around everything [m]."""
INK, SOFT, LINE = "#1b2430", "#4d5866", "#d5dae1"


def reach_map(scene: Scene, spots: pd.DataFrame) -> str:
    """Return the drawing; the human's forward direction (x) points up, so its left is on the left.

    Args:
        scene: the scene.
        spots: rows of `hand table height x y reached`, as `lgp.world.reachability.Reachability.data`.
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
