"""Findings of runs with known answers: shown, not shown, or too few runs to tell."""

import numpy as np
import pandas as pd
import pytest

from lgp.experiments.findings import FEWEST_EQUAL, findings
from lgp.experiments.runs import NUMBERS
from lgp.experiments.summary import summarise
from tests.support.screwdriver_runs import RUNS, made


def test_findings_follow_the_tests(summary):
    found = {one.claim: one.shown for one in findings(summary)}
    assert len(found) == 7
    assert found["rest start: REBA at the grasp ergonomic < re-optimized < non-ergonomic"] is True
    assert found["random start: with the ergonomic cost the choice moves from the left table to the center"] is True


def repeated(runs, times):
    """Return the runs of `made` several times over, under other numbers."""
    return pd.concat([runs.assign(run=runs["run"] + RUNS * number) for number in range(times)], ignore_index=True)


@pytest.mark.parametrize(("times", "shown"), [(1, None), (9, False)])
def test_no_effect_takes_enough_runs(times, shown):
    runs, paths = made("rest")
    runs = repeated(runs, times)
    runs["reba_grasp"] = runs["reba_grasp"].where(runs["reba_grasp"].isna(), 4.0)
    runs["table"] = runs["table"].where(runs["table"].isna(), "left")
    runs["chosen_height"] = runs["height_left"].where(runs["feasible"])
    assert [one.shown for one in findings(summarise(runs, paths))] == [shown] * 3


def test_a_few_runs_show_no_equality():
    """Three runs of nearly equal heights have a narrow interval, and are too few to tell."""
    runs, paths = made("rest")
    complete = runs.groupby("run")["feasible"].transform("all")
    runs = runs[runs["run"].isin(sorted(runs["run"][complete].unique())[:3])].copy()
    paths = paths[paths["run"].isin(runs["run"])]
    runs = runs.assign(height_left=1.0, height_center=1.002, table="left", chosen_height=1.0)
    one = (runs["run"] == runs["run"].min()) & (runs["condition"] == "ergonomic")
    runs.loc[one, ["table", "chosen_height"]] = ["center", 1.002]
    height = findings(summarise(runs, paths))[2]
    assert height.shown is None, height.evidence


def test_findings_say_where_nothing_can_be_said():
    runs, paths = made("rest")
    one = runs["run"] == 0
    found = findings(summarise(runs[one], paths[paths["run"] == 0]))
    assert {finding.shown for finding in found} == {None}
    assert "no test" in found[0].evidence


def test_a_few_runs_that_all_move_show_no_choice():
    """Four of four leave the left table: p = 0.046 by the asymptotic test, 0.125 by the exact one."""
    claim = "rest start: with the ergonomic cost the choice moves from the left table to the center"

    def moved(count):
        runs, paths = made("rest")
        runs = runs[runs["run"].isin(runs.loc[runs["feasible"], "run"].unique()[:count])].assign(feasible=True)
        runs["table"] = np.where(runs["condition"] == "ergonomic", "center", "left")
        heights = np.where(runs["table"] == "center", runs["height_center"], runs["height_left"])
        numbers = {name: runs[name].fillna(1.0) for name in NUMBERS}
        runs = runs.assign(**{**numbers, "chosen_height": heights})
        summary = summarise(runs, paths[:0])
        return {one.claim: one.shown for one in findings(summary)}[claim], summary

    shown, summary = moved(4)
    assert summary["starts"]["rest"]["table_change"]["p"] < 0.05
    assert shown is None
    assert moved(RUNS)[0] is True


@pytest.mark.slow
def test_a_random_start_changes_nothing_only_within_the_margin():
    claim = "A random start raises the score at the grasp of the non-ergonomic condition only"

    def shown(times, shift=0.0):
        runs, paths = made("rest", "random")
        runs = repeated(runs, times)
        moved = (runs["initial"] == "random") & (runs["condition"] == "ergonomic")
        runs.loc[moved, "reba_grasp"] += shift * (runs.loc[moved, "run"] % 2)
        return {one.claim: one.shown for one in findings(summarise(runs, paths))}[claim]

    assert RUNS < FEWEST_EQUAL < 9 * RUNS
    assert shown(1) is None  # equal in all runs, but these are few
    assert shown(9) is True
    assert shown(9, shift=4.0) is False
