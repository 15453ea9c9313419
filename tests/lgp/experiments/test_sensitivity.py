"""Sensitivity: every free choice of the scene by both factors, remarks on changed tasks, shares of feasible runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import lgp
from lgp.experiments.runs import CONDITIONS, NUMBERS, PATH_COLUMNS, RUN_COLUMNS, empty
from lgp.experiments.screwdriver import plan_run
from lgp.experiments.sensitivity import remarks, sensitivity_table
from lgp.experiments.variations import BASELINE, SceneVariation, values_of_weight, variations
from lgp.scene.model import Scene
from tests.support.lgp_worlds import needs_robots
from tests.support.says import says

pytestmark = needs_robots
SETTINGS = {"seed": 0, "cost": "convex", "collisions": True}


def test_every_free_choice_is_varied_both_ways() -> None:
    scene = lgp.load_scene("screwdriver")
    varied = variations(scene)
    assert varied[0] == BASELINE
    words = " ".join(one.choice for one in varied)
    for choice in scene.choices:
        for key in choice.keys:
            assert all(part in words for part in key.split("."))
    assert len({one.name for one in varied}) == len(varied)
    changed = next(one for one in varied if one.choice == "tables start: position" and one.setting == "x 1.2")
    position = changed.scene(scene).tables["table.start"].position
    assert position == pytest.approx(1.2 * np.array(scene.tables["table.start"].position))


def test_sweeps_leave_out_what_the_scene_has_already() -> None:
    scene = lgp.load_scene("screwdriver", {"cost.weight": 4.0, "phase_seconds": 5.0})
    varied = variations(scene)
    settings: dict[str, list[str]] = {}
    for one in varied:
        settings.setdefault(one.choice, []).append(one.setting)
    assert settings["phase [s]"] == ["1.0", "2.0", "3.0", "8.0"]
    assert scene.cost.model not in settings["cost model"]
    assert [one.scene(scene).human.legs for one in varied if one.choice == "legs"] == ["planted", "locked"]  # type: ignore[union-attr]
    weights = {one.setting: one.scene(scene).cost.weight for one in varied if "weight" in one.choice}
    assert values_of_weight(scene) == {"": 4.0, **weights}
    assert max(weights.values()) / min(weights.values()) > 1000


@pytest.mark.slow
def test_a_start_table_in_reach_is_remarked_and_taken_from() -> None:
    from lgp.kinematics.world import World

    near = lgp.load_scene("screwdriver", {"tables.start.position": [0.3, -0.5]})
    assert "the human reaches the screwdriver without help" in remarks(World(near))
    runs, _ = plan_run(0, slices=3, scene=near, collisions=False)
    assert set(runs["table"]) == {"start"}
    assert runs["actions"].str.startswith("grasp(1, human.right_hand").all()
    assert np.allclose(runs["chosen_height"], 0.9)


def test_a_start_table_far_away_is_remarked() -> None:
    from lgp.kinematics.world import World

    far = lgp.load_scene("screwdriver", {"tables.start.position": [2.9, 1.8]})
    assert "no robot hand reaches the screwdriver" in remarks(World(far))


def made(run: int, table: str | None) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return rows of a run whose two searched conditions chose a table, or found no plan."""
    numbers = dict.fromkeys(NUMBERS, 1.0)
    row = {"run": run, "seed": 0, "initial": "rest", "table": table, "feasible": table is not None, "seconds": 1.0}
    row |= {"actions": "", "reason": "", "faults": 0, "height_left": 1.0, "height_center": 1.0, "height_right": 1.0}
    row |= numbers if table else dict.fromkeys(numbers, np.nan)
    runs = pd.DataFrame([row | {"condition": condition} for condition in CONDITIONS])
    return runs[list(RUN_COLUMNS)].astype(RUN_COLUMNS), empty(PATH_COLUMNS)


@pytest.mark.slow
def test_rows_are_shares_of_feasible_runs_and_made_once(tmp_path: Path) -> None:
    planned: list[tuple[float, list[int]]] = []
    chosen = {0: "left", 1: "center", 2: None, 3: "start"}

    def plan(runs: list[int], scene: Scene) -> list[tuple[pd.DataFrame, pd.DataFrame]]:
        planned.append((scene.cost.weight, runs))
        return [made(run, chosen[run]) for run in runs]

    varied = (BASELINE, SceneVariation("weight", "x 0.8", '{"cost.weight": 0.8}'))
    scene = lgp.load_scene("screwdriver")
    sensitivity_table(tmp_path, scene, 2, SETTINGS, plan, varied=varied)
    table = sensitivity_table(tmp_path, scene, 4, SETTINGS, plan, varied=varied)
    assert planned == [(1.0, [0, 1]), (0.8, [0, 1]), (1.0, [2, 3]), (0.8, [2, 3])]
    assert list(table["condition"]) == [*CONDITIONS[:2], *CONDITIONS[:2]]
    first = table.iloc[0]
    assert (first["n"], first["of"]) == (3, 4)
    assert [first["left"], first["center"], first["right"]] == pytest.approx([100 / 3, 100 / 3, 0.0])
    fewer = sensitivity_table(tmp_path, scene, 1, SETTINGS, plan, varied=varied)
    assert list(fewer["left"]) == [100.0] * 4
    with pytest.raises(lgp.LgpError) as error:
        sensitivity_table(tmp_path, scene, 1, SETTINGS | {"seed": 1}, plan, varied=varied)
    says(error, "seed", "another folder")
