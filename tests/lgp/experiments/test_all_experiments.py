"""All experiments by one call: every variant in its folder, the comparison before the sweeps, and wrong options."""

from __future__ import annotations

import json
import re
from html import unescape
from pathlib import Path
from typing import Any

import pytest

import lgp
from lgp.cli import cli
from lgp.experiments import all_experiments, published
from lgp.experiments.all_experiments import PARTS, experiment_all
from lgp.experiments.comparison import comparison, screwdriver_rows, toolbox_rows
from lgp.experiments.summary import finished_summary, summarise, write_summary
from lgp.experiments.toolbox_orders import GRASP_FIRST, PLACE_FIRST
from lgp.experiments.variants import variants
from reba.provenance import provenance
from tests.support.invoke import invoke
from tests.support.says import says
from tests.support.screwdriver_runs import made


def toolbox_summary() -> dict[str, Any]:
    orders = {PLACE_FIRST: {"total": 3.0, "load": 1.0}, GRASP_FIRST: {"total": 3.5, "load": 2.0}}
    one = {"order": PLACE_FIRST, "orders": orders, "first_part": {"mass_for_place_first": 0.4}, "reba": {"mean": 1.0}}
    plain = {**one, "orders": {GRASP_FIRST: {"total": 0.3, "load": 0.0}}, "order": GRASP_FIRST}
    return {"conditions": {"non-ergonomic": plain, "ergonomic": one}}


def test_every_variant_is_planned_and_compared_before_its_sweeps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[str, str, str, int]] = []
    summaries = {"screwdriver": summarise(*made("rest", "random")), "toolbox": toolbox_summary()}

    def planned(folder: Path, *, initial: str = "", sensitivity: int = 0, **options: Any) -> None:
        kind = folder.parent.name
        calls.append((kind, folder.name, initial, sensitivity))
        folder.mkdir(parents=True, exist_ok=True)
        if sensitivity:
            assert (tmp_path / "report.html").is_file()
        write_summary(folder / "summary.json", summaries[kind])

    for name in ("experiment_screwdriver", "experiment_toolbox"):
        monkeypatch.setattr(all_experiments, name, planned)
    summary = experiment_all(tmp_path, runs=12, sensitivity=2, command="lgp experiment all")
    assert {(kind, name) for kind, name, *_ in calls} == {(one.experiment, one.name) for one in PARTS}
    assert {name for kind, name, *_ in calls if kind == "screwdriver"} == {*variants(), "paper-collision-free"}
    screwdriver = [call[1:] for call in calls if call[0] == "screwdriver"]
    assert screwdriver[:2] == [("paper", "rest", 0), ("paper", "random", 0)]
    assert [call for call in screwdriver if call[2]] == [
        (name, "random", 2) for name in [*variants(), "paper-collision-free"]
    ]
    page = unescape((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert 'href="screwdriver/paper-rigid/report.html"' in page
    assert "lgp experiment all" in page
    for title in (one.title for one in variants().values()):
        assert title in page
    stored = json.loads((tmp_path / "summary.json").read_text())
    assert stored == summary
    assert stored["provenance"] == provenance()
    assert list(summary["screwdriver"]["rest"]["variants"]) == [*variants(), "paper-collision-free"]


def test_rows_are_the_papers_results_beside_ours() -> None:
    results = summarise(*made("rest", "random"))["starts"]
    rows = {row["result"]: row for row in screwdriver_rows({"mine": results["rest"]}, "rest")}
    assert rows["tables, ergonomic"]["paper"] == "26 / 40 / 34"
    assert rows["tables, ergonomic"]["variants"]["mine"] == "0 / 100 / 0"
    assert rows["height, non-ergonomic"]["paper"] == "1.08 ± 0.22"
    grasp = results["rest"]["reba_grasp"]
    assert rows["REBA at the grasp, ergonomic"]["variants"]["mine"].startswith(
        f"{grasp['conditions']['ergonomic']['mean']:.2f} ± "
    )
    assert rows["order of REBA at the grasp"]["paper"] == " < ".join(published.EXPECTED_ORDER)
    interval = r"-?[\d.]+ \(-?[\d.]+ to -?[\d.]+\)"
    for name, pattern in (
        ("REBA at the grasp, non-ergonomic − ergonomic", f"{interval}, p = .+"),
        ("height, ergonomic, minus the paper's", f"{interval}, p = .+"),
        ("tables, ergonomic, minus the paper's", " / ".join([interval] * 3) + ", p = .+"),
    ):
        assert re.fullmatch(pattern, rows[name]["variants"]["mine"].replace("−", "-")), name
    random = {row["result"]: row for row in screwdriver_rows({"mine": results["random"]}, "random")}
    assert random["tables, non-ergonomic"]["paper"] == "66 / 23 / 11"


def test_the_toolbox_has_costs_with_and_without_load() -> None:
    plain, ergonomic = toolbox_rows("paper", toolbox_summary())
    assert (plain["order"], plain["published"]) == (GRASP_FIRST, GRASP_FIRST)
    assert plain["costs"][PLACE_FIRST] is plain["without_load"][PLACE_FIRST] is None
    assert ergonomic["without_load"] == {PLACE_FIRST: 2.0, GRASP_FIRST: 1.5}
    assert ergonomic["mass"] == 0.4


def test_a_damaged_summary_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "toolbox" / "ours"
    folder.mkdir(parents=True)
    (folder / "summary.json").write_text("{", encoding="utf-8")
    with pytest.raises(lgp.LgpError) as error:
        comparison(tmp_path, {"screwdriver": [], "toolbox": ["ours"]})
    says(error, "summary.json", "delete")


def test_a_finished_toolbox_is_known_by_its_settings_and_version(tmp_path: Path) -> None:
    settings = {"variant": "ours", "weights": (2.0, 4.0)}
    assert finished_summary(tmp_path, settings) is None
    summary = {"settings": {"variant": "ours", "weights": [2.0, 4.0]}, "provenance": provenance()}
    write_summary(tmp_path / "summary.json", summary)
    assert finished_summary(tmp_path, settings) == summary
    assert finished_summary(tmp_path, settings | {"variant": "paper"}) is None
    write_summary(tmp_path / "summary.json", summary | {"provenance": {"version": "0.0.1"}})
    assert finished_summary(tmp_path, settings) is None


@pytest.mark.parametrize("options", [("--as", "ours"), ("--phase-seconds", "3"), ("--plans",), ("--no-collisions",)])
def test_options_of_one_variant_are_refused(tmp_path: Path, options: tuple[str, ...]) -> None:
    result = invoke(cli, ["experiment", "all", *options, "-o", str(tmp_path)])
    says(result.exception, options[0].removeprefix("--no-").removeprefix("--"), "all", "leave it out")
