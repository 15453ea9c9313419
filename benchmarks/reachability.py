"""Reachability of a scene as figure: the tables from above, and the reached share of each top by hand and height.

python benchmarks/reachability.py screwdriver -o out/reachability.svg
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import matplotlib
import numpy as np
from machine import stamp
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from lgp.kinematics.reachability import Reachability, reachability, transport_reachability
from lgp.kinematics.world import World
from lgp.scene.scene_file import load_scene

HEIGHTS = tuple(np.linspace(0.6, 1.6, 11).round(2).tolist())


def main() -> None:
    """Compute the map, print its shares, draw it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="?", default="screwdriver")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/reachability.svg"))
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    matplotlib.use("Agg")
    world = World(load_scene(options.scene))
    began = time.perf_counter()
    reach_map = reachability(world, HEIGHTS, spots=5)
    seconds = time.perf_counter() - began
    shares = reach_map.shares()
    print(f"{len(reach_map.data)} questions of reach in {seconds:.2f} s")
    print(shares.round(2).to_string(na_rep="-"))
    for thing in world.scene.objects:
        carried = transport_reachability(world, thing, HEIGHTS, spots=3)
        print(f"\n{thing}, picked up where it lies and put down by the same hand:")
        table = carried.pivot_table(index=["hand", "table"], columns="height", values="reached", aggfunc="mean")
        print(table.round(2).to_string())
    options.output.parent.mkdir(parents=True, exist_ok=True)
    draw(world, reach_map).savefig(options.output)
    print(f"\n{options.output}; {stamp()}")
    if options.json:
        rows = [{"hand": hand, "table": name, **row} for (hand, name), row in shares.T.to_dict().items()]
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps({"seconds": seconds, "shares": rows}, default=str))


def draw(world: World, reach_map: Reachability) -> plt.Figure:
    """Figure with a row per hand: the scene from above, points coloured by the share of reached heights, and shares."""
    hands = list(world.scene.hands)
    figure, axes = plt.subplots(len(hands), 2, figsize=(10, 3.4 * len(hands)), squeeze=False, layout="constrained")
    for (above, shares), hand in zip(axes, hands, strict=True):
        mine = reach_map.data[reach_map.data["hand"] == hand]
        _from_above(above, world, mine.groupby(["x", "y"])["reached"].mean().reset_index())
        above.set_title(f"{hand}: share of heights reached")
        for name, rows in mine.groupby("table", sort=False):
            by_height = rows.groupby("height")["reached"].mean()
            shares.plot(by_height.index, by_height, marker="o", label=name)
        shares.set(xlabel="height of the table [m]", ylabel="share of its top", ylim=(-0.05, 1.05))
        shares.legend(fontsize=8)
    return figure


def _from_above(axes: Axes, world: World, spots: object) -> None:
    scene = world.scene
    for name, table in scene.tables.items():
        yaw, (width, depth) = np.radians(table.yaw), table.size
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (width / 2, depth / 2)
        turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
        axes.add_patch(Polygon(corners @ turn + table.position, fill=False))
        axes.annotate(name, table.position, ha="center", va="center", fontsize=7)
    for agent in scene.agents:
        x, y, _ = agent.position
        ahead = np.radians(agent.yaw)
        axes.arrow(x, y, 0.15 * np.cos(ahead), 0.15 * np.sin(ahead), width=0.02)
        axes.annotate(agent.name, (x, y), xytext=(0, -14), textcoords="offset points", ha="center", fontsize=7)
    drawn = axes.scatter(spots["x"], spots["y"], c=spots["reached"], cmap="viridis", vmin=0, vmax=1, s=14)  # type: ignore[index]
    axes.figure.colorbar(drawn, ax=axes)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")


if __name__ == "__main__":
    main()
