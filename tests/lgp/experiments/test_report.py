"""Report of runs with known answers."""

import json
import re
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest

import lgp
from lgp.experiments.report import write_results
from lgp.experiments.runs import NUMBERS, PATH_COLUMNS, empty
from lgp.kinematics.reachability import Reachability
from tests.support.screwdriver_runs import made

VOID = {"area", "base", "br", "col", "hr", "img", "input", "link", "meta"}


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
    sensitivity = [
        {"choice": "robots.baxter.position", "setting": "x 0.8", "condition": "ergonomic", "left": 20.0,
         "center": 50.0, "right": 30.0, "n": 9, "of": 10, "remark": "the robot <stands> in a table"},
    ]  # fmt: skip
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
    runs = runs.assign(feasible=False, table=None, **dict.fromkeys(NUMBERS, np.nan))
    summary = write_results(tmp_path, runs, empty(PATH_COLUMNS), lgp.load_scene("screwdriver"))
    assert summary["starts"]["rest"]["table_choice"]["ergonomic"]["percent"]["left"] is None
    assert "it cannot be computed" in (tmp_path / "report.html").read_text()
