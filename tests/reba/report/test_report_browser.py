"""The report in a real browser: opened as a file, without a network, in narrow and wide windows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import reba
from reba.report import write_report
from reba.scores import Scores
from tests.support.browser import complaints, needs_browser, pages_on_paper, resize, too_wide, until, visible

pytestmark = [pytest.mark.slow, needs_browser]


def scored(n: int, seed: int) -> Scores:
    """Return a recording with a gap and a neck that is lost for a while."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) / 25
    wave = 0.5 - 0.5 * np.cos(2 * np.pi * time / 11)
    columns = {name: 90 * wave * rng.random() + rng.normal(0, 1, n) for name in reba.COLUMNS if "wrist" not in name}
    data = pd.DataFrame({"time": time, **columns})
    data.loc[(time > 4) & (time < 6), "neck_flexion"] = np.nan
    return reba.score(data[(time < 8) | (time > 10)].reset_index(drop=True), load=7.0, error="inertial")


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report([scored(1500, 1), scored(500, 2)], path, command="reba score a.csv b.csv --load 7")
    return path


def show(browser: Any, path: Path, width: int, *, scripts: bool = True) -> None:
    browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": not scripts})
    resize(browser, width)
    browser.get(path.as_uri())
    if scripts:
        until(browser, "document.documentElement.dataset.drawn")


@pytest.mark.parametrize("width", [390, 1280])
def test_drawn_without_errors_and_without_sideways_scrolling(browser: Any, report: Path, width: int) -> None:
    show(browser, report, width)
    assert visible(browser, ".drawing .main-svg") >= 4
    assert visible(browser, ".drawing .scatterlayer path.js-line") > 0
    assert visible(browser, ".still") == 0
    assert too_wide(browser) <= 0
    entries = browser.execute_script("return performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert entries == []
    assert complaints(browser) == []


def test_sides_and_angles_can_be_chosen(browser: Any, report: Path) -> None:
    show(browser, report, 1280)
    shown = """const drawing = document.querySelector(arguments[0]);
        return drawing.data.filter((trace) => trace.visible !== false).map((trace) => trace.meta.name || trace.meta)"""
    assert set(browser.execute_script(shown, ".drawing")) == {"reba", "activity"}
    browser.execute_script("document.querySelector('input[value=reba_left]').click()")
    assert set(browser.execute_script(shown, ".drawing")) == {"reba_left", "activity"}
    choose = """const select = document.querySelector('select'); select.value = '2';
        select.dispatchEvent(new Event('change')); return select.selectedOptions[0].textContent"""
    chosen = browser.execute_script(choose)
    assert browser.execute_script(shown, "figure:has(select) .drawing") == [chosen]


def test_no_button_sends_a_plot_away(browser: Any, report: Path) -> None:
    show(browser, report, 1280)
    titles = browser.execute_script("return [...document.querySelectorAll('[data-title]')].map((e) => e.dataset.title)")
    assert titles
    assert not [title for title in titles if any(word in title.lower() for word in ("cloud", "studio", "share"))]


def test_still_plots_and_tables_remain_without_scripts(browser: Any, report: Path) -> None:
    show(browser, report, 390, scripts=False)
    try:
        # Scripts of the page are off, so the driver reads what is laid out from a picture of the DOM.
        picture = browser.execute_cdp_cmd(
            "DOMSnapshot.captureSnapshot", {"computedStyles": ["display"], "includeDOMRects": True}
        )
        strings = picture["strings"]
        document = picture["documents"][0]
        laid_out = {strings[document["nodes"]["nodeName"][index]] for index in document["layout"]["nodeIndex"]}
        assert {"svg", "TABLE", "path"} <= laid_out
        assert "SELECT" not in laid_out
    finally:
        browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})


def test_prints_as_pages(browser: Any, report: Path) -> None:
    show(browser, report, 1280)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    assert visible(browser, ".still svg") == 4  # over time, and with measurement error
    assert visible(browser, ".drawing") == 0
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert 4 <= pages_on_paper(browser) <= 30
