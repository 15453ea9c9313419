"""Summary and findings of runs with known answers."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy.stats import ttest_ind_from_stats

from lgp.experiments import published
from lgp.experiments.runs import PATH_COLUMNS, empty
from lgp.experiments.summary import summarise, write_summary
from tests.support.screwdriver_runs import RUNS, made


def test_summary_counts_choices_heights_and_infeasible_runs(both, summary):
    rest = summary["starts"]["rest"]
    assert rest["runs"] == RUNS
    assert {name: part["n"] for name, part in rest["infeasible"].items()} == {
        "non-ergonomic": 1, "ergonomic": 0, "re-optimized": 1,
    }  # fmt: skip
    assert rest["infeasible"]["non-ergonomic"]["runs"] == [{"run": 2, "reason": "<0.1 m> too far"}]
    assert rest["audit"]["ergonomic"] == {"plans": RUNS, "with_fault": 1, "faults": 2}
    assert rest["audit"]["non-ergonomic"]["plans"] == RUNS - 1
    choice = rest["table_choice"]["ergonomic"]
    assert choice["percent"] == {"left": 0.0, "center": 100.0, "right": 0.0}
    assert choice["published"] == {"left": 26, "center": 40, "right": 34}
    assert rest["table_choice"]["re-optimized"]["published"] is None
    low, high = choice["interval"]["center"]
    assert 70 < low < high <= 100.0 + 1e-9
    runs = both[0]
    mine = runs[(runs["initial"] == "rest") & (runs["condition"] == "ergonomic")]["chosen_height"]
    height = rest["chosen_height"]["conditions"]["ergonomic"]
    assert (height["mean"], height["sd"]) == pytest.approx((mine.mean(), mine.std()))
    assert height["published"] == {"mean": 0.95, "sd": 0.15}
    assert rest["table_change"]["n"] == RUNS - 1
    assert rest["table_change"]["excluded"] == 1


def test_summary_tests_scores_on_the_runs_that_have_them(summary):
    grasp = summary["starts"]["rest"]["reba_grasp"]
    assert grasp["order"] == list(published.EXPECTED_ORDER)
    assert (grasp["anova"]["n"], grasp["anova"]["excluded"]) == (RUNS - 1, 1)
    assert grasp["anova"]["p_corrected"] < 1e-4
    assert [pair["n"] for pair in grasp["pairs"]] == [RUNS - 1] * 3
    between = summary["between_starts"]["reba_grasp"]
    assert between["non-ergonomic"]["difference"] > 1
    assert between["ergonomic"]["n"] == RUNS


def test_phases_are_means_over_runs(summary):
    phases = summary["starts"]["rest"]["reba_phases"]["ergonomic"]
    assert [(one["phase"], one["n"]) for one in phases] == [(0, RUNS), (1, RUNS), (2, RUNS)]
    assert [one["mean"] for one in phases[:2]] == [1.0, 2.0]


def test_summary_is_strict_json(tmp_path, summary):
    write_summary(tmp_path / "summary.json", summary)
    assert json.loads((tmp_path / "summary.json").read_text()) == summary


def test_our_shares_equal_to_the_papers_do_not_differ():
    runs, _ = made("rest")
    shares = published.CHOICE_PERCENT["rest"]["non-ergonomic"]
    tables = np.repeat(list(shares), list(shares.values()))
    row = runs[runs["condition"] == "non-ergonomic"].iloc[[0]]
    many = pd.concat([row.assign(run=run, table=table) for run, table in enumerate(tables)])
    many["chosen_height"] = [row[f"height_{row['table']}"] for _, row in many.iterrows()]
    found = summarise(many, empty(PATH_COLUMNS))["starts"]["rest"]["table_choice"]["non-ergonomic"]
    assert found["against_published"]["p"] == pytest.approx(1.0)
    left = found["against_published"]["shares"]["left"]
    assert (left["difference"], -left["low"]) == (0.0, pytest.approx(left["high"]))
    assert 0.05 < left["high"] < 0.12  # two samples of 100 cannot say less


def test_our_height_is_compared_with_the_papers(summary):
    height = summary["starts"]["rest"]["chosen_height"]["conditions"]
    mine, against = height["ergonomic"], height["ergonomic"]["against_published"]
    expected = ttest_ind_from_stats(mine["mean"], mine["sd"], mine["n"], 0.95, 0.15, 100, equal_var=False)
    assert against["p"] == pytest.approx(expected.pvalue)
    assert against["low"] < against["difference"] < against["high"]
    assert (against["low"] > 0 or against["high"] < 0) == (against["p"] < 0.05)
    assert height["re-optimized"]["against_published"] is None
