"""Runs for a family: who is served worst, what sharing costs, and runs that are infeasible for a member."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from lgp.experiments.family_runs import ALONE, MEAN, PLANNED, WORST, conditions, summarise_family
from lgp.experiments.manikins import family
from lgp.experiments.report import render
from lgp.experiments.runs import NUMBERS, PATH_COLUMNS, RUN_COLUMNS, check_runs, empty
from lgp.experiments.summary import summarise
from lgp.scene.body_measures import STATURE
from lgp.scene.scene_file import load_scene
from reba.files import plain_data
from tests.support.screwdriver_runs import made

NAMES = [one.name for one in family().members]


def runs_of(run: int, feasible: bool = True) -> pd.DataFrame:
    """Return rows in which costs grow with the number of the member, least of all where the largest is minimised."""
    rows = []
    for condition in conditions():
        name, how = condition.rsplit(", ", 1)
        at = NAMES.index(name)
        cost = {ALONE: 1.0, MEAN: 1.5, WORST: 1.25}[how] * (1.0 + at)
        ok = feasible or at > 0
        row = {"run": run, "seed": 0, "initial": "rest", "condition": condition, "feasible": ok, "seconds": 1.0}
        row |= {"table": "center" if ok else None, "actions": "", "reason": "" if ok else "too far", "faults": 0}
        row |= {"height_left": 1.0, "height_center": 1.0, "height_right": 1.0}
        row |= dict.fromkeys(NUMBERS, 1.0 if ok else np.nan)
        row |= {"cost": cost, "reba_mean": 1.0 + (at == 0)} if ok else {}
        rows.append(row)
    return pd.DataFrame(rows)[list(RUN_COLUMNS)].astype(RUN_COLUMNS)


def test_the_family_has_three_percentiles_of_both_sexes_with_a_source() -> None:
    people = family()
    assert len(people.members) == 6
    assert "ANSUR" in people.source
    for sex in ("female", "male"):
        statures = [one.stature for one in people.members if one.sex == sex]
        assert len(statures) == 3
        assert statures == sorted(statures)
        assert STATURE[0] < statures[0] < statures[-1] < STATURE[1]
    person = people.members[0].scene(load_scene("screwdriver")).human
    assert person is not None
    assert (person.sex, person.stature) == ("female", people.members[0].stature)


def test_who_is_served_worst_has_the_highest_score() -> None:
    runs = check_runs(pd.concat([runs_of(0), runs_of(1), runs_of(2, feasible=False)]), conditions())
    summary = summarise_family(runs)
    assert (summary["runs"], summary["n"], summary["reasons"]) == (3, 2, ["too far"])
    for how in PLANNED:
        assert [summary["planned"][how]["members"][name]["worst"] for name in NAMES] == [2, 0, 0, 0, 0, 0]
        assert summary["planned"][how]["percent"]["center"] == 100.0
    # The largest cost is that of the last member, whoever has the highest score.
    assert summary["planned"][WORST]["worst"]["cost"]["mean"] == pytest.approx(7.5)
    differences = {(one["first"], one["second"]): one["difference"] for one in summary["largest"]["cost"]}
    assert differences == {(WORST, MEAN): pytest.approx(-1.5), (MEAN, ALONE): pytest.approx(3.0)}


def test_equal_scores_are_told_apart_by_their_cost() -> None:
    runs = runs_of(0).assign(reba_mean=2.0)
    worst = summarise_family(runs)["planned"][MEAN]["members"]
    assert [worst[name]["worst"] for name in NAMES] == [0, 0, 0, 0, 0, 1]


def test_the_page_shows_the_family_also_where_all_runs_failed() -> None:
    runs, _ = made("rest")
    scene = load_scene("screwdriver")
    for chosen in (runs_of(0), runs_of(0, feasible=False)):
        summary = summarise(runs, empty(PATH_COLUMNS)) | {"family": plain_data(summarise_family(chosen))}
        page = render(summary, runs, empty(PATH_COLUMNS), scene, {"figure_5": ""})
        for one in family().members:
            assert one.name in page
            assert f"{one.stature:.3f} m" in page
        assert "Gordon et al. 2014" in page
