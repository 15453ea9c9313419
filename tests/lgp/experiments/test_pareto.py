"""Pareto fronts: points of common runs, domination, figures, and folders that are planned once."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import lgp
from lgp.experiments.pareto import fronts, pareto_figure, pareto_fronts, points_of
from lgp.experiments.report import render
from lgp.experiments.runs import CONDITIONS, NUMBERS, PATH_COLUMNS, RUN_COLUMNS, empty
from lgp.experiments.summary import summarise
from lgp.scene.model import Scene
from tests.support.screwdriver_runs import made

Tables = tuple[pd.DataFrame, pd.DataFrame]


def one_run(run: int, seconds: float, score: float, feasible: bool = True) -> Tables:
    """Return the tables of one run whose plans last some seconds with some score."""
    row = {"run": run, "seed": 0, "initial": "rest", "feasible": feasible, "seconds": 1.0, "actions": "", "reason": ""}
    row |= {"table": "left" if feasible else None, "faults": 0}
    row |= dict.fromkeys(("height_left", "height_center", "height_right"), 1.0)
    row |= dict.fromkeys(NUMBERS, 1.0 if feasible else np.nan)
    row |= {"duration": seconds, "reba_mean": score} if feasible else {}
    frame = pd.DataFrame([row | {"condition": condition} for condition in CONDITIONS])
    return frame[list(RUN_COLUMNS)].astype(RUN_COLUMNS), empty(PATH_COLUMNS)


def test_each_front_varies_one_weight_and_frees_durations_where_time_is_traded() -> None:
    scene = lgp.load_scene("screwdriver", {"cost.weight": 4.0})
    varied = fronts(scene)
    timed = [(value, one.scene(scene)) for value, one in varied["duration"]]
    assert all(one.durations == "free" and one.cost.time_weight == value for value, one in timed)
    weighted = [(value, one.scene(scene)) for value, one in varied["robot_effort"]]
    assert all(one.durations == "fixed" and one.cost.weight == value for value, one in weighted)
    assert 4.0 in [value for value, _ in weighted]
    for one in varied.values():
        assert one[-1][0] / one[0][0] >= 1000
        assert len({variation.name for _, variation in one}) == len(one)


def test_points_are_means_of_runs_that_every_weight_has_and_dominated_ones_are_marked() -> None:
    def table(*runs: Tables) -> pd.DataFrame:
        return pd.concat([one for one, _ in runs])

    points = points_of("duration", [
        (1.0, table(one_run(0, 10.0, 2.0), one_run(1, 12.0, 2.0), one_run(2, 99.0, 9.0))),
        (2.0, table(one_run(0, 8.0, 3.0), one_run(1, 8.0, 3.0), one_run(2, 99.0, 9.0, feasible=False))),
        (3.0, table(one_run(0, 9.0, 3.5), one_run(1, 9.0, 3.5), one_run(2, 1.0, 1.0))),
    ])  # fmt: skip
    assert [(one["n"], one["of"]) for one in points] == [(2, 3)] * 3
    assert [one["duration"]["mean"] for one in points] == [11.0, 8.0, 9.0]
    assert [one["on_front"] for one in points] == [True, True, False]


@pytest.mark.slow
def test_fronts_are_planned_once_and_drawn_on_the_page(tmp_path: Path) -> None:
    planned: list[list[int]] = []

    def plan(runs: list[int], scene: Scene) -> list[Tables]:
        planned.append(runs)
        free = scene.durations == "free"
        at = scene.cost.time_weight if free else scene.cost.weight
        return [one_run(run, 10.0 - np.log10(at), 2.0 + np.log10(at + 1.0)) for run in runs]

    scene = lgp.load_scene("screwdriver")
    settings = {"seed": 0}
    pareto_fronts(tmp_path, scene, 1, settings, plan)
    traced = pareto_fronts(tmp_path, scene, 2, settings, plan)
    assert planned == [[0]] * 14 + [[1]] * 14
    pareto_fronts(tmp_path, scene, 2, settings, plan)
    assert planned[28:] == [[]] * 14
    assert {file.name for file in tmp_path.iterdir()} == {"pareto"}
    runs, _ = made("rest")
    summary = summarise(runs, empty(PATH_COLUMNS), fronts=traced)
    figure = pareto_figure(traced[0])
    page = render(summary, runs, empty(PATH_COLUMNS), scene, {"figure_5": "", "figure_pareto_duration": figure})
    assert figure in page
    assert traced[1]["title"] in page
    shown = np.array(re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', figure), float)
    assert len(shown) == 7
    assert (np.diff(shown[:, 0]) < 0).all()  # a second that costs more: shorter plans
    assert (np.diff(shown[:, 1]) < 0).all()  # with higher scores, up on the page


@pytest.mark.parametrize("points", [[], [{"value": 1.0, "n": 0, "of": 2}]])
def test_a_front_without_runs_has_no_figure(points: list[dict[str, object]]) -> None:
    assert pareto_figure({"name": "duration", "title": "", "axis": "", "weight": "", "points": points}) == ""
