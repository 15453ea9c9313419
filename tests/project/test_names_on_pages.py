"""Names from inputs are text on every page and in every drawing: nothing runs, nothing is added, all of it is seen."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import dreba
import lgp
import reba
from dreba.domain import Domain
from lgp.execution.events import Event, Hub
from lgp.execution.server import PageServer
from lgp.experiments.comparison import write_comparison
from lgp.experiments.report import write_results
from lgp.experiments.runs import TABLES
from lgp.experiments.toolbox_orders import ORDERS
from lgp.experiments.toolbox_report import write_page as write_toolbox
from lgp.experiments.variants import variants
from lgp.kinematics.reachability import Reachability
from lgp.scene.model import FreeParameter
from lgp.search.tree_figure import draw
from lgp.study.study import run_study
from lgp.workplace.report import write_report as write_moved
from reba.batch.run import ScoringOptions
from reba.posture.skeleton import stick_figure
from reba.printable import printable
from reba.report.page import template
from tests.support import hostile_names as hostile
from tests.support.browser import chromium, complaints, needs_browser, until
from tests.support.hostile_names import MARKUP
from tests.support.page_packages import needs_page
from tests.support.paths import ROOT
from tests.support.screwdriver_runs import made

pytestmark = [pytest.mark.slow, needs_browser]

SHOWN = MARKUP.partition(" \u2028")[0]
"""The part of the name that a page shows as it is."""
FILE = MARKUP.replace("/", "") + "\udcff"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with chromium(
        tmp_path_factory.mktemp("profile"), "--use-angle=swiftshader", "--enable-unsafe-swiftshader"
    ) as found:
        yield found


def reba_report(folder: Path) -> Path:
    """Write the report of two recordings with hostile names wherever a recording or an option puts one."""
    time = np.arange(0, 20, 0.2)
    frames = pd.DataFrame({"time": time, "trunk_flexion": 40 + 30 * np.sin(time), "neck_flexion": 10.0})
    scores = reba.score(frames, rules=dataclasses.replace(reba.PRESETS["measured"], name=printable(MARKUP)))
    postures = scores.postures
    quality = dataclasses.replace(
        postures.quality, warnings=(MARKUP,), ended_abnormally=MARKUP, first_skipped=MARKUP, skipped=1, messages=9,
        time_source=MARKUP, sha256=MARKUP,
    )  # fmt: skip
    postures = dataclasses.replace(
        postures, source=FILE, topic=MARKUP, profile=MARKUP, recognised=MARKUP, quality=quality, assumed=(MARKUP,),
        why_unmeasured=dict.fromkeys(postures.unmeasured, MARKUP),
    )  # fmt: skip
    both = [dataclasses.replace(scores, postures=postures, assumed=(MARKUP,)), scores]
    path = folder / "report.html"
    reba.write_report(both, path, command=f"reba score {MARKUP}", names=True)
    return path


def dreba_report(folder: Path) -> Path:
    """Write the report of a model whose domain, provenance and file have hostile names."""
    model = dreba.QuadraticModel()
    dreba.fit_to(model, dreba.sample(600, rng=1), dreba.sample(400, rng=2), command=MARKUP)
    domain = dataclasses.replace(Domain.from_dict(model.about_.domain), name=MARKUP, title=MARKUP, source=MARKUP)
    provenance = {**model.about_.provenance, MARKUP: MARKUP, "more": {MARKUP: [MARKUP]}}
    model.about_ = dataclasses.replace(model.about_, domain=domain.to_dict(), provenance=provenance)
    path = folder / "model.html"
    dreba.write_report(model, dreba.sample(400, rng=3), path, name=FILE, command=MARKUP)
    return path


def moved_report(folder: Path) -> Path:
    """Write the page of a moved surface for a recording with a hostile name."""
    bent = {"time": [0.0], "trunk_flexion": [60.0], "upper_arm_flexion": [60.0], "lower_arm_flexion": [20.0]}
    scores = reba.score(pd.DataFrame(bent))
    scores = dataclasses.replace(scores, postures=dataclasses.replace(scores.postures, source=FILE))
    path = folder / "moved.html"
    moved = lgp.improve(scores, at=0.0, heights=(0.9, 0.9), distances=(0.3, 0.3), step=0.4)
    write_moved(moved, path, command=MARKUP)
    return path


def plan_page(folder: Path) -> Path:
    """Write the page of a plan."""
    return lgp.write_page(hostile.plan(MARKUP), folder, pictures=False)


def tree(folder: Path) -> Path:
    """Draw the tree of a search."""
    nodes = [dataclasses.replace(node, reason=MARKUP, costs={MARKUP: 1.0}) for node in hostile.plan(MARKUP).tree]
    path = folder / "tree.svg"
    path.write_text(draw(nodes), encoding="utf-8")
    return path


def study_report(folder: Path) -> Path:
    """Write the report of a study whose participants, conditions and files have hostile names."""
    manifest = hostile.study(folder, MARKUP)
    study = run_study((), manifest=str(manifest), options=ScoringOptions(missing="neutral"))
    study.summary["warnings"] = study.summary["assumed"] = [MARKUP]
    study.summary["failed"] = [{"input": FILE, "error": MARKUP, "label": MARKUP}]
    study.summary["notes"] = {FILE: [MARKUP]}
    path = folder / "study.html"
    study.write_report(path, command=MARKUP, names=True)
    return path


def screwdriver_report(folder: Path) -> Path:
    """Write the report of the screwdriver experiment for a scene with hostile names."""
    scene = lgp.load_scene("screwdriver")
    tables = {f"table.{MARKUP}": scene.tables["table.left"]}
    robots = {MARKUP: dataclasses.replace(scene.robots["baxter"], name=MARKUP)}
    scene = dataclasses.replace(
        scene, title=MARKUP, tables=tables, robots=robots, choices=(FreeParameter((MARKUP,), MARKUP),)
    )
    spot = {"table": f"table.{MARKUP}", "x": 0.5, "y": 0.1, "reached": True, "miss": 0.0}
    spots = [{**spot, "hand": hand, "height": height} for hand in (MARKUP, f"human.{MARKUP}") for height in (0.6, 1.6)]
    rows = [{"choice": MARKUP, "setting": MARKUP, "condition": MARKUP, "left": 20.0, "center": 50.0,
             "right": 30.0, "n": 9, "of": 10, "remark": MARKUP}]  # fmt: skip
    runs, paths = made("rest")
    runs = runs.assign(reason=runs["reason"].where(runs["feasible"], MARKUP))
    write_results(
        folder, runs, paths, scene, settings={MARKUP: MARKUP}, command=MARKUP, sensitivity=rows,
        reach=Reachability(pd.DataFrame(spots)), family=hostile_family(), fronts=hostile_fronts(),
    )  # fmt: skip
    return folder / "report.html"


def hostile_family() -> dict[str, Any]:
    """Return the summary of a family whose names and reasons are hostile."""
    mean = {"mean": 1.0}
    measures = {"reba_mean": mean, "reba_grasp": mean, "cost": mean}
    way = {"members": {MARKUP: {**measures, "worst": 1}}, "worst": measures, "percent": dict.fromkeys(TABLES, 1.0)}
    pair = {"first": MARKUP, "second": MARKUP, "n": 2, "difference": 0.1, "low": 0.0, "high": 0.2, "p_holm": 0.5}
    return {
        "title": MARKUP, "source": MARKUP, "members": [{"name": MARKUP, "stature": 1.7}], "runs": 2, "n": 1,
        "reasons": [MARKUP], "planned": {MARKUP: way}, "largest": {"cost": [pair]},
    }  # fmt: skip


def hostile_fronts() -> list[dict[str, Any]]:
    """Return a front whose titles are hostile."""
    score = {"mean": 2.0, "se": 0.1}
    points = [
        {"value": at, "n": 2, "of": 2, "on_front": True, "duration": {"mean": at, "se": 0.1}, "reba_mean": score,
         "reba_grasp": score} for at in (1.0, 2.0)
    ]  # fmt: skip
    return [{"name": "duration", "title": MARKUP, "axis": MARKUP, "weight": MARKUP, "points": points}]


def comparison_report(folder: Path) -> Path:
    """Write a comparison of variants whose names and results are hostile."""
    row = {"result": MARKUP, "paper": MARKUP, "variants": {MARKUP: MARKUP}}
    one = {
        "variant": MARKUP, "condition": MARKUP, "order": MARKUP, "published": MARKUP, "mass": None, "reba": 1.0,
        "costs": dict.fromkeys(ORDERS, 1.0), "without_load": dict.fromkeys(ORDERS),
    }  # fmt: skip
    compared = {
        "published": MARKUP, "screwdriver": {MARKUP: {"variants": [MARKUP], "rows": [row]}}, "toolbox": [one],
    }  # fmt: skip
    write_comparison(folder, compared, {MARKUP: MARKUP}, MARKUP)
    return folder / "report.html"


def toolbox_report(folder: Path) -> Path:
    """Write the report of the toolbox experiment with hostile actions, parts, verdicts and settings."""
    plan = hostile.plan(MARKUP)
    cost = {"total": 1.0, "posture": 1.0, "load": 1.0, "carried": 1.0, "acceleration of human": 1.0}
    row = {"actions": [MARKUP], "order": MARKUP, "sequence": 1.0, "path": 1.0, "reason": MARKUP}
    one = {
        "actions": [MARKUP], "published_actions": [MARKUP], "order": MARKUP, "orders": {MARKUP: cost, "b": cost},
        "cost": cost, "reba": {"mean": 1.0, "max": 2.0}, "load_points": 0.0, "rounds": [1.0], "status": MARKUP,
        "parts": dict.fromkeys(("trunk", "neck", "legs", "load_force", *(f"{part}_{side}" for part in
                               ("upper_arm", "lower_arm", "wrist") for side in ("left", "right"))), 1.0),
        "first_part": {
            "name": MARKUP, "mass": 1.0, "mass_for_place_first": 1.0,
            "sweep": [{"mass": mass, "costs": dict.fromkeys(ORDERS, 1.0), "order": MARKUP} for mass in (0.0, 1.0)],
        },
        "sequences": [{**row, "verdict": MARKUP}, {**row, "verdict": "infeasible"}],
        "search": {"gap": 0.0, "levels": {MARKUP: {"solved": 1, "infeasible": 0, "seconds": 1.0}}},
        "residuals": {"metres": 0.0, "radians": 0.0},
        "audit": {"faults": [{"what": MARKUP}], "deepest": [{"pair": [MARKUP, MARKUP], "depth": 0.01}]},
    }  # fmt: skip
    summary = {
        "conditions": {"non-ergonomic": one, "ergonomic": one}, "published": MARKUP,
        "settings": {MARKUP: MARKUP, "collisions": False}, "weights": [{"weight": 1.0, "order": MARKUP, **cost}],
    }  # fmt: skip
    scene = dataclasses.replace(plan.scene, choices=(FreeParameter((MARKUP,), MARKUP),))
    write_toolbox(folder, summary, {"non-ergonomic": plan, "ergonomic": plan}, scene, variants()["ours"], MARKUP)
    return folder / "report.html"


def stick_figures(folder: Path) -> Path:
    """Draw a posture whose text alternative is hostile."""
    path = folder / "posture.html"
    path.write_text(stick_figure(np.zeros(len(reba.COLUMNS)), {}, MARKUP), encoding="utf-8")
    return path


WRITERS: dict[str, tuple[Callable[[Path], Path], int]] = {
    "reba report": (reba_report, 20),
    "dreba report": (dreba_report, 8),
    "moved surface": (moved_report, 2),
    "page of a plan": (plan_page, 0),  # its sentences turn names into words
    "tree": (tree, 3),
    "study report": (study_report, 15),
    "screwdriver report": (screwdriver_report, 10),
    "toolbox report": (toolbox_report, 15),
    "comparison": (comparison_report, 10),
    "posture": (stick_figures, 0),
}
"""Writers of pages and drawings, and how often the name stands in the text at least."""
PAGES = {
    "reba/report/page.py", "dreba/report.py", "lgp/page/page.py", "lgp/study/report.py", "lgp/experiments/report.py",
    "lgp/experiments/toolbox_report.py", "lgp/experiments/comparison.py", "reba/app/server.py",
    "lgp/workplace/report.py",
}  # fmt: skip
DRAWINGS = {"reba/report/plots.py", "reba/report/body_map.py", "reba/posture/skeleton.py", "lgp/svg.py",
            "lgp/search/tree_figure.py", "lgp/experiments/figures.py"}  # fmt: skip
ADDED = """return [...document.querySelectorAll("*")].filter((element) => element.matches('img[src="x"], .hostile')
    || [...element.attributes].some((one) => /^on/i.test(one.name) || /^\\s*javascript:/i.test(one.value)))
    .map((element) => element.outerHTML.slice(0, 200))"""
TEXT = """const copy = document.documentElement.cloneNode(true);
    copy.querySelectorAll("script, style").forEach((one) => one.remove()); return copy.textContent"""


def check(browser: Any, times: int) -> None:
    """Assert that the page is whole, ran nothing, has nothing added, and shows the name as text."""
    check_nothing_ran(browser)
    assert browser.execute_script("return document.querySelectorAll('parsererror').length") == 0
    text = " ".join(browser.execute_script(TEXT).split())
    seen = text.count(SHOWN) + text.count(SHOWN.replace("/", ""))
    assert seen >= times, (seen, text[:3000])
    assert "\x1b" not in text
    assert "\u202e" not in text


@needs_page
@pytest.mark.parametrize("name", WRITERS)
def test_names_are_text(browser: Any, tmp_path: Path, name: str) -> None:
    write, times = WRITERS[name]
    path = write(tmp_path)
    for file in [path, *tmp_path.glob("*.svg")]:
        browser.get(file.as_uri())
        until(browser, "document.readyState === 'complete'")
        check(browser, times if file == path else 0)
    # What the content security policy stops is written to the console as an error.
    assert complaints(browser) == []


@needs_page
def test_events_of_a_run_are_text(browser: Any, tmp_path: Path) -> None:
    page = plan_page(tmp_path)
    event = Event(1, 0.5, 0, "running", "started", MARKUP)
    with PageServer(page.parent, Hub([event])) as server:
        browser.get(server.address)
        until(browser, "document.querySelector('.banner .words').textContent")
        assert browser.execute_script("return document.querySelector('.banner .words').textContent") == MARKUP
        check_nothing_ran(browser)
        browser.get("about:blank")
    assert complaints(browser) == []


def test_every_writer_is_tested() -> None:
    texts = {
        str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
        for package in ("reba", "dreba", "lgp")
        for path in (ROOT / package).rglob("*.py")
    }
    assert {name for name, text in texts.items() if re.search(r"\btemplate\(", text)} == PAGES
    assert {name for name, text in texts.items() if "<svg" in text} == DRAWINGS
    assert not [name for name, text in texts.items() if re.search(r"import .*\bescape\b", text)]


def check_nothing_ran(browser: Any) -> None:
    assert browser.execute_script("return window.bad") is None
    assert browser.execute_script(ADDED) == []


def test_a_page_runs_no_script_but_its_own(browser: Any, tmp_path: Path) -> None:
    text = template("reba.report", "base.html", scripts=("window.ours = 1",)).render()
    attack = "<script>window.bad = 1</script><img src=x onerror='window.bad = 2'>"
    path = tmp_path / "page.html"
    path.write_text(text.replace("</body>", f"{attack}</body>"), encoding="utf-8")
    browser.get(path.as_uri())
    until(browser, "document.readyState === 'complete'")
    assert browser.execute_script("return [window.ours, window.bad]") == [1, None]
    assert len(complaints(browser)) >= 2
