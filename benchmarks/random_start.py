"""Why the table that is chosen without ergonomics hardly depends on the initial posture of the person.

    python benchmarks/random_start.py [--draws N] [--variants paper paper-rigid] [--json FILE]

For draws of heights and random initial postures, both arms are planned to all three tables without ergonomics. Table
by table: the squared accelerations of the person and of the robot; then the shares of the tables if those of the person
counted more by a factor. A factor of 27 is that of a person who moves in the last of three phases only, as the paper's
Fig. 7 shows it: from rest to rest accelerations fall with the third power of the time. Paths and places are those of
factor 1.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from machine import machine, stamp

from lgp.collision.random_start import random_start
from lgp.experiments import published
from lgp.experiments.effort import effort_by_agent
from lgp.experiments.runs import TABLES
from lgp.experiments.variants import setting
from lgp.kinematics.world import World
from lgp.path.bounds import PathBounds
from lgp.planner import parse_sequence, plan_within, task_of

FACTORS = (1.0, 8.0, 27.0, 64.0, 125.0)


def planned(variant: str, draws: int) -> pd.DataFrame:
    """Return a row for each draw, table and arm that is feasible: accelerations of the person and of the robot."""
    _, base = setting(variant, "screwdriver", None, None, None)
    first, rows = World(base), []
    for run in range(draws):
        world = first.with_scene(base.draw_heights(np.random.default_rng([0, run])))
        start = random_start(world, np.random.default_rng([0, run, 1]))
        bounds, task = PathBounds(world, None, initial_configuration=start), task_of(world.scene)
        for table in TABLES:
            for arm in ("left", "right"):
                hand, where = f"baxter.{arm}", f"table.{table}"
                lines = (f"grasp({hand}, screwdriver)", f"place({hand}, screwdriver, {where})",
                         "grasp(human.right_hand, screwdriver)")  # fmt: skip
                plan = plan_within(bounds, task, parse_sequence(task, lines))
                if plan.feasible:
                    height = world.scene.tables[where].height
                    rows.append({"run": run, "table": table, "height": height, **effort_by_agent(plan)})
    return pd.DataFrame(rows)


def shares(rows: pd.DataFrame, factor: float) -> dict[str, float]:
    """Return the share of each table [%] and the mean height [m], with accelerations of the person times a factor."""
    weighted = rows.assign(cost=rows["baxter"] + factor * rows["human"]).sort_values("cost", kind="stable")
    chosen = weighted.groupby("run").first()
    return {table: 100.0 * float((chosen["table"] == table).mean()) for table in TABLES} | {
        "height": float(chosen["height"].mean())
    }


def main() -> None:
    """Print both tables for each variant."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--variants", nargs="+", default=["paper", "paper-rigid"])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    print(stamp())
    results: dict[str, Any] = {}
    for variant in options.variants:
        rows = planned(variant, options.draws)
        cheapest = (
            rows.assign(cost=rows["baxter"] + rows["human"]).sort_values("cost").groupby(["run", "table"]).first()
        )
        means = cheapest.groupby("table")[["human", "baxter"]].mean()
        print(f"\n{variant}, {options.draws} draws: squared accelerations [rad^2/s^3], mean")
        for table in TABLES:
            print(f"  {table:8s} person {means['human'][table]:8.4f}   robot {means['baxter'][table]:8.4f}")
        by_factor = {factor: shares(rows, factor) for factor in FACTORS}
        theirs = published.CHOICE_PERCENT["random"]["non-ergonomic"]
        print(f"  {'factor':10s} left / center / right [%], height [m]")
        for factor, one in by_factor.items():
            print(f"  {factor:<10g} " + " / ".join(f"{one[table]:.0f}" for table in TABLES) + f", {one['height']:.2f}")
        print(f"  {'the paper':10s} " + " / ".join(str(theirs[table]) for table in TABLES) + ", 1.02")
        results[variant] = {"means": means.to_dict(), "shares": {str(k): v for k, v in by_factor.items()}}
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "variants": results}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
