"""Sensitivity of the screwdriver experiment: shares of the chosen tables under variations of the scene's free choices.

Each variation has a folder of its own with the same table heights as the first runs of the experiment, so that an
interrupted analysis continues. A remark names variations that change the task itself: the human reaches the screwdriver
without help, or no robot hand reaches it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from lgp.experiments.runs import CONDITIONS, TABLES, RunStore
from lgp.experiments.screwdriver import GOAL_OBJECT
from lgp.experiments.variations import SceneVariation, variations
from lgp.kinematics.reachability import CLOSE, reach, reachability
from lgp.kinematics.world import World
from lgp.scene.model import Scene, Table

if TYPE_CHECKING:
    import pandas as pd

FOLDER: Final = "sensitivity"
"""Folder of the variations, below that of the experiment."""
STARTS: Final = 6
"""Initial guesses of the inverse kinematics of a remark."""
FULL_SHARE: Final = 0.995
"""Share of heights from which on a table counts as reached at all heights: below 1 by the resolution of the map."""


def sensitivity_table(
    folder: str | Path,
    scene: Scene,
    runs: int,
    settings: Mapping[str, Any],
    plan: Callable[..., Iterable[tuple[pd.DataFrame, pd.DataFrame]]],
    *,
    varied: Sequence[SceneVariation] | None = None,
    on_event: Callable[[str], None] | None = None,
) -> pd.DataFrame:
    """Plan the missing runs of every variation from the rest posture; one row per variation and condition.

    Args:
        scene: that is varied.
        plan: plans the runs of these numbers with `scene=`, see `lgp.experiments.screwdriver.plan_runs`.
        varied: variations, by default all.
        on_event: called with one line for each variation that lacks runs.

    Returns:
        Columns `choice setting condition left center right n of remark`: shares of the tables [%] in the n feasible of
        all runs. They add up to less than 100 if the human takes the screwdriver from its initial table.

    Raises:
        LgpError: a folder holds runs of other settings.
    """
    rows = []
    for variation in variations(scene) if varied is None else varied:
        own = {**settings, "choice": variation.choice, "setting": variation.setting}
        store = RunStore(Path(folder) / FOLDER / variation.name, own)
        missing = set(range(runs)) - store.done("rest")
        if missing and on_event is not None:
            on_event(f"{variation.choice} {variation.setting}: {len(missing)} runs")
        changed = variation.scene(scene)
        planned, _ = store.complete(runs, "rest", partial(plan, scene=changed))
        rows += _rows(
            variation, "" if changed is scene else "; ".join(remarks(World(changed))), planned[planned["run"] < runs]
        )
    return _table(rows)


def _rows(variation: SceneVariation, remark: str, runs: pd.DataFrame) -> list[dict[str, Any]]:
    """One row per searched condition; the re-optimized one has the tables of the non-ergonomic one by definition."""
    rows = []
    for condition in CONDITIONS[:2]:
        selected = runs[runs["condition"] == condition]
        tables = selected.loc[selected["feasible"], "table"]
        shares = {table: 100.0 * float((tables == table).mean()) if len(tables) else np.nan for table in TABLES}
        key = {"choice": variation.choice, "setting": variation.setting, "condition": condition}
        rows.append({**key, **shares, "n": len(tables), "of": len(selected), "remark": remark})
    return rows


def _table(rows: list[dict[str, Any]]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(rows, columns=["choice", "setting", "condition", *TABLES, "n", "of", "remark"])


def remarks(world: World) -> list[str]:
    """Properties of a scene that change the task or restrict its choices, one sentence each."""
    scene = world.scene
    item = scene.objects[GOAL_OBJECT]
    table = scene.tables[item.on]
    spot = np.array([[*table.position, table.height + item.size[2] / 2.0]])
    reached = {
        hand.full: float(reach(world, hand, spot, STARTS, np.random.default_rng(0))[0]) < CLOSE
        for hand in scene.hands.values()
    }
    human = {hand.full for hand in scene.hands.values() if hand.human}
    robot = set(reached) - human
    tops = [scene.tables[f"table.{name}"] for name in TABLES]
    notes = []
    if any(reached[hand] for hand in human):
        notes.append(f"the human reaches the {GOAL_OBJECT} without help")
    if not any(reached[hand] for hand in robot):
        notes.append(f"no robot hand reaches the {GOAL_OBJECT}")
    return [*notes, *_overlaps(scene, tops), *_unreached(world, tops, {"the human": human, "the robot": robot})]


def _overlaps(scene: Scene, tops: Sequence[Table]) -> list[str]:
    """Tables that overlap each other or a robot's base in the plan view."""
    notes = []
    for first, second in pairwise(tops):
        gap = np.abs(np.subtract(first.position, second.position)) - np.add(first.size, second.size) / 2.0
        if gap.max() < 0.0:
            notes.append(f"the tables {first.name} and {second.name} overlap where they are of one height")
    for robot in scene.robots.values():
        for top in tops:
            if (np.abs(np.subtract(robot.position[:2], top.position)) < np.array(top.size) / 2.0).all():
                notes.append(f"{robot.name} stands in the table {top.name}")
    return notes


def _unreached(world: World, tops: Sequence[Table], agents: Mapping[str, set[str]]) -> list[str]:
    """Tables that an agent, given as name -> hands, does not reach at all of their heights."""
    notes = []
    reached = reachability(world, attempts=STARTS).any_reached().dropna(axis=1).astype(float)
    for agent, hands in agents.items():
        for top in tops:
            rows = [key for key in reached.index if key[0] in hands and key[1] == top.full]
            share = float(reached.loc[rows].max().mean())
            if share < FULL_SHARE:
                notes.append(f"{agent} reaches the table {top.name} at {100 * share:.0f} % of its heights")
    return notes
