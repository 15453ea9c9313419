"""The report of a model in a real browser: opened as a file, without a network, on a phone, on a desk, on paper."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import dreba
from tests.support.browser import (
    complaints,
    needs_browser,
    pages_on_paper,
    preferring,
    resize,
    too_wide,
    until,
    visible,
    weak_texts,
)

pytestmark = [pytest.mark.slow, needs_browser]

ANGLES = 14
"""Of the posture table, of two sides one: each has a small plot of its polynomial, and one of the whole model."""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "model.html"
    dreba.write_report(dreba.load("quadratic"), dreba.sample(800, rng=1), path, command="dreba evaluate quadratic")
    return path


def show(browser: Any, report: Path, width: int) -> None:
    resize(browser, width)
    browser.get(report.as_uri())
    until(browser, "document.documentElement.dataset.drawn")


@pytest.mark.parametrize("width", [390, 1280])
def test_all_is_drawn_without_errors_and_without_sideways_scrolling(browser: Any, report: Path, width: int) -> None:
    show(browser, report, width)
    assert visible(browser, ".plots .js-plotly-plot") == 3 + 2 * ANGLES
    # Every plot holds a line, a bar or a box and stays inside its card.
    empty, wide = browser.execute_script(
        """const plots = [...document.querySelectorAll(".js-plotly-plot")];
        const right = (element) => element.getBoundingClientRect().right;
        return [plots.filter((plot) => !plot.querySelector(".js-line, .bars path, path.box")).length,
            plots.filter((plot) => right(plot) > right(plot.closest(".card"))).length]"""
    )
    assert (empty, wide) == (0, 0)
    spans = browser.execute_script(
        "return [...document.querySelectorAll('.small .js-plotly-plot')].map((plot) => plot.layout.yaxis.range)"
    )
    assert min(high - low for low, high in spans) > 1  # less than a point is not drawn as if it were much
    assert visible(browser, ".poses svg") == 6
    assert too_wide(browser) <= 0
    assert browser.execute_script("return performance.getEntriesByType('resource').length") == 0
    assert complaints(browser) == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_text_stands_out(browser: Any, report: Path, scheme: str) -> None:
    with preferring(browser, scheme):
        show(browser, report, 1280)
        assert weak_texts(browser) == []


def test_the_legend_lies_above_the_bars(browser: Any, report: Path) -> None:
    show(browser, report, 390)
    low, top = browser.execute_script(
        """const box = (name) => document.querySelector(`#errors ${name}`).getBoundingClientRect();
        return [box(".legend").bottom, box(".bars path").top]"""
    )
    assert low <= top + 1


def test_prints_as_wide_as_the_paper(browser: Any, report: Path) -> None:
    show(browser, report, 1280)
    browser.execute_script(
        """window.widths = [];
        addEventListener("beforeprint", () => { for (const plot of document.querySelectorAll(".js-plotly-plot"))
            widths.push(plot.querySelector(".main-svg").getBoundingClientRect().width); });"""
    )
    screen = browser.execute_script("return document.querySelector('#errors .main-svg').getBoundingClientRect().width")
    assert 3 <= pages_on_paper(browser) <= 10
    widths = browser.execute_script("return widths")
    assert len(widths) == 3 + 2 * ANGLES
    assert max(widths) < 704  # [px] between the margins of A4
    # The window gets its own widths back.
    code = f"Math.abs(document.querySelector('#errors .main-svg').getBoundingClientRect().width - {screen}) < 1"
    until(browser, code)
    assert complaints(browser) == []
