"""Figures of runs with known answers."""

from xml.etree import ElementTree

import numpy as np

from lgp.experiments.figures import COMPARED, bars, example, profile
from lgp.experiments.summary import summarise
from tests.support.screwdriver_runs import made


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
