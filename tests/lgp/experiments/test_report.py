"""Summary, findings, figures and page of runs with known answers."""

import json
import re
from functools import cache
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

import lgp
from lgp.experiments import published
from lgp.experiments.figures import COMPARED, bars, example, profile
from lgp.experiments.report import write_results
from lgp.experiments.runs import CONDITIONS, PATH_COLUMNS, RUN_COLUMNS, TABLES, empty
from lgp.experiments.summary import findings, summarise, write_summary
from lgp.kinematics.reachability import Reachability
from lgp.statistics.formatting import p_value
from reba.posture.columns import COLUMNS

RUNS = 12
SCORE = {"non-ergonomic": 7.0, "ergonomic": 3.0, "re-optimized": 5.0}
"""Mean score at the grasp of the made-up runs."""
NO_PLAN = {("rest", 2): ("non-ergonomic", "re-optimized")}
VOID = {"area", "base", "br", "col", "hr", "img", "input", "link", "meta"}


@cache
def one_run(run, start, worse):
    """Return rows and paths of one run: left without ergonomics, the centre with, score `worse` up without."""
    rng = np.random.default_rng([run, worse])
    heights = np.random.default_rng(run).uniform(0.6, 1.6, 3)
    rows, paths = [], []
    for condition in CONDITIONS:
        ok = condition not in NO_PLAN.get((start, run), ())
        table = "center" if condition == "ergonomic" else TABLES[run % 4 % 3 % 2]
        grasp = SCORE[condition] + rng.integers(-1, 2) + (worse if condition == "non-ergonomic" else 0)
        key = {"run": run, "condition": condition, "initial": start}
        row = {**key, "seed": 0, "feasible": ok, "seconds": 0.5, "reason": "" if ok else "<0.1 m> too far"}
        row |= {f"height_{name}": height for name, height in zip(TABLES, heights, strict=True)}
        row |= {"actions": "grasp(1, baxter.left, screwdriver)", "table": table if ok else None}
        row |= {"chosen_height": heights[TABLES.index(table)], "reba_grasp": grasp, "reba_mean": grasp / 2, "cost": 1.0}
        rows.append(row if ok else row | dict.fromkeys(("chosen_height", "reba_grasp", "reba_mean", "cost"), np.nan))
        if ok:
            scores = [1.0, 1.0, 2.0, 2.0, 4.0, grasp]
            path = pd.DataFrame({"slice": range(6), "phase": np.repeat(range(3), 2), "reba": scores, "load": 0.0})
            angles = {name: np.linspace(0, 40, 6) if name == "trunk_flexion" else 0.0 for name in COLUMNS}
            paths.append(path.assign(**key, time=path["slice"] + 1.0, **angles))
    return pd.DataFrame(rows)[list(RUN_COLUMNS)], pd.concat(paths)[list(PATH_COLUMNS)]


def made(*starts):
    """Return runs and paths of some starts; the random one is two points worse without ergonomics."""
    parts = [one_run(run, start, 2 if start == "random" else 0) for start in starts for run in range(RUNS)]
    return tuple(pd.concat(tables, ignore_index=True) for tables in zip(*parts, strict=True))


@pytest.fixture(scope="module")
def both():
    return made("rest", "random")


@pytest.fixture(scope="module")
def summary(both):
    return summarise(*both, {"seed": 0})


def test_summary_counts_choices_heights_and_infeasible_runs(both, summary):
    rest = summary["starts"]["rest"]
    assert rest["runs"] == RUNS
    assert {name: part["n"] for name, part in rest["infeasible"].items()} == {
        "non-ergonomic": 1, "ergonomic": 0, "re-optimized": 1,
    }  # fmt: skip
    assert rest["infeasible"]["non-ergonomic"]["runs"] == [{"run": 2, "reason": "<0.1 m> too far"}]
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
    assert found["against_published"]["statistic"] == pytest.approx(0.0)
    assert found["against_published"]["p"] == pytest.approx(1.0)


def test_findings_follow_the_tests(summary):
    found = {one.claim: one.shown for one in findings(summary)}
    assert len(found) == 7
    assert found["rest start: REBA at the grasp ergonomic < re-optimized < non-ergonomic"] is True
    assert found["random start: with the ergonomic cost the choice moves from the left table to the centre"] is True


def test_findings_do_not_claim_what_is_not_there():
    runs, paths = made("rest")
    runs["reba_grasp"] = runs["reba_grasp"].where(runs["reba_grasp"].isna(), 4.0)
    runs["table"] = runs["table"].where(runs["table"].isna(), "left")
    runs["chosen_height"] = runs["height_left"].where(runs["feasible"])
    assert [one.shown for one in findings(summarise(runs, paths))] == [False, False, False]


def test_findings_say_where_nothing_can_be_said():
    runs, paths = made("rest")
    one = runs["run"] == 0
    found = findings(summarise(runs[one], paths[paths["run"] == 0]))
    assert {finding.shown for finding in found} <= {None, False}
    assert "no test" in found[0].evidence


def test_bars_mark_every_comparison(summary):
    drawn = bars(summary["starts"]["rest"]["reba_grasp"], "mean <score>")
    root = ElementTree.fromstring(drawn)
    texts = [node.text for node in root.iter("{http://www.w3.org/2000/svg}text")]
    assert texts.count("***") == 3
    assert len(list(root.iter("{http://www.w3.org/2000/svg}rect"))) == 3
    assert root.get("aria-label") == "mean <score>"


def test_bars_say_n_s_and_leave_out_what_has_no_runs():
    runs, paths = made("rest")
    runs["reba_grasp"] = runs["reba_grasp"].where(runs["reba_grasp"].isna(), 4.0)
    assert bars(summarise(runs, paths)["starts"]["rest"]["reba_grasp"], "").count("n.s.") == 3
    some = runs[runs["condition"] != "ergonomic"]
    drawn = bars(summarise(some, paths)["starts"]["rest"]["reba_grasp"], "")
    assert drawn.count("not tested") == 2
    assert drawn.count("<rect") == 2


def test_profile_draws_a_line_per_condition_and_start(both):
    root = ElementTree.fromstring(profile(both[1], ""))
    lines = list(root.iter("{http://www.w3.org/2000/svg}polyline"))
    assert len(lines) == 6
    assert [line.get("stroke-dasharray") for line in lines] == ["none"] * 3 + ["6 4"] * 3


def test_the_drawn_example_has_the_median_difference(both):
    found = example(*both)
    runs = both[0]
    table = runs[runs["initial"] == "random"].pivot(index="run", columns="condition", values="reba_grasp")
    differences = np.sort((table[COMPARED[0]] - table[COMPARED[1]]).to_numpy())
    assert found.start == "random"
    assert found.difference == differences[len(differences) // 2]
    assert [one.condition for one in found.postures] == list(COMPARED)
    assert found.postures[0].svg.startswith("<svg")


class Balance(HTMLParser):
    """Checks that elements close in the order they were opened."""

    def __init__(self):
        super().__init__()
        self.open = []

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.mark.parametrize("starts", [("rest",), ("random",), ("rest", "random")])
def test_page_is_whole_and_needs_no_network(tmp_path, starts):
    scene = lgp.load_scene("screwdriver")
    spots = pd.DataFrame(
        [
            {"hand": hand, "table": table, "height": height, "x": 0.5, "y": 0.1, "reached": hand < "c" or height < 1}
            for hand in ("baxter.left", "human.right_hand")
            for table, height in (("table.left", 0.6), ("table.left", 1.6), ("table.start", 0.9))
        ]
    )
    reach = Reachability(spots.assign(miss=0.0))
    sensitivity = pd.DataFrame(
        [{"choice": "robots.baxter.position", "factor": 0.8, "condition": "ergonomic", "left": 20.0, "center": 50.0,
          "right": 30.0, "n": 9, "of": 10, "remark": "the robot <stands> in a table"}]
    )  # fmt: skip
    write_results(
        tmp_path, *made(*starts), scene, settings={"cost": "<model>"}, command="lgp x", reach=reach,
        sensitivity=sensitivity,
    )  # fmt: skip
    html = (tmp_path / "report.html").read_text()
    parser = Balance()
    parser.feed(html)
    assert parser.open == []
    assert not re.search(r"(src|href)=.?http", html)
    assert "the robot &lt;stands&gt; in a table" in html
    assert html.count("<title>50 % of the heights</title>") == html.count("<title>100 % of the heights</title>") == 1
    assert json.loads((tmp_path / "summary.json").read_text())["sensitivity"][0]["center"] == 50.0
    assert ("Table II)" in html) == ("rest" in starts)
    assert ("Table III)" in html) == ("random" in starts)
    for choice in scene.choices:
        assert choice.reason.split("'")[0][:40] in html
    assert "&lt;model&gt;" in html
    assert ("&lt;0.1 m&gt; too far" in html) == ("rest" in starts)
    ids = re.findall(r' id="([^"]+)"', html)
    assert len(ids) == len(set(ids))
    names = {"rest": "figure_5.svg", "random": "figure_6.svg"}
    expected = {"report.html", "summary.json", "figure_7.svg", *(names[start] for start in starts)}
    assert {file.name for file in tmp_path.iterdir()} == expected


def test_page_of_runs_that_all_failed(tmp_path):
    runs, _ = made("rest")
    runs = runs.assign(feasible=False, table=None, chosen_height=np.nan, reba_grasp=np.nan, reba_mean=np.nan)
    summary = write_results(tmp_path, runs, empty(PATH_COLUMNS), lgp.load_scene("screwdriver"))
    assert summary["starts"]["rest"]["table_choice"]["ergonomic"]["percent"]["left"] is None
    assert "it cannot be computed" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    ("p", "text"), [(None, "–"), (1.0, "1.00"), (0.0996, "0.10"), (0.0994, "0.099"), (1.24e-9, "1.2e-09")]
)
def test_p_values_are_exact(p, text):
    assert p_value(p) == text
