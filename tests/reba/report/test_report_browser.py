"""The report in a real browser: opened as a file, without a network, in narrow and wide windows."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import reba
from reba.analysis.exposure import durations
from reba.analysis.wording import span
from reba.posture.skeleton import joints
from reba.printable import WITH_UNIT, joined
from reba.report import write_report
from reba.report.what_if import what_if
from reba.scores import Scores
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
    assert visible(browser, ".explorer canvas") == 8
    for name in ("scores", "parts", "angles", "figure"):
        assert inked(browser, f"canvas.{name}") > 200, name
    assert visible(browser, ".still") == 0
    assert visible(browser, "canvas.shared") == 2, "the comparison fits the screen"
    assert inked(browser, "canvas.shared") > 200
    assert too_wide(browser) <= 0
    cut = "(e) => e.getClientRects().length && e.scrollWidth > e.clientWidth + 1"
    code = f"return [...document.querySelectorAll('.bar i')].filter({cut}).map((e) => e.textContent)"
    assert browser.execute_script(code) == [], "labels of spans too narrow for them"
    entries = browser.execute_script("return performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert entries == []
    assert complaints(browser) == []


def inked(browser: Any, selector: str) -> int:
    """Return how many pixels of a canvas are drawn on."""
    code = """const canvas = document.querySelector(arguments[0]);
        const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
        let number = 0; for (let i = 3; i < data.length; i += 4) number += data[i] > 0; return number"""
    return int(browser.execute_script(code, selector))


def press(browser: Any, key: str, shift: bool = False) -> None:
    browser.execute_script(
        "document.querySelector('.cursor').dispatchEvent(new KeyboardEvent('keydown', "
        "{ key: arguments[0], shiftKey: arguments[1], bubbles: true, cancelable: true }))", key, shift
    )  # fmt: skip


def readout(browser: Any) -> str:
    browser.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
    return str(browser.execute_script("return document.querySelector('.readout').textContent"))


def said_of(scores: Scores, frame: int) -> str:
    """Return the beginning of what the page says of a frame."""
    row = scores.data.iloc[frame]
    low, high = int(row["reba_low"]), int(row["reba_high"])
    return joined(f"{row['time']:.2f} s: REBA {span(low, high)} (")


def test_the_cursor_follows_keys_mouse_and_links(browser: Any, report: Path) -> None:
    scores = scored(1500, 1)
    show(browser, report, 1280)
    press(browser, "Home")
    assert readout(browser).startswith(said_of(scores, 0))
    press(browser, "ArrowRight")
    assert readout(browser).startswith(said_of(scores, 1))
    press(browser, "ArrowRight", shift=True)
    assert readout(browser).startswith(said_of(scores, 11))
    press(browser, "End")
    assert readout(browser).startswith(said_of(scores, len(scores.data) - 1))
    worst = scores.summary()["worst"][1]
    browser.execute_script("document.querySelectorAll('#r1 a.moment')[1].click()")
    assert readout(browser).startswith(said_of(scores, scores.frame_at(worst["time"])))
    shown = browser.execute_script("return window.explorers.r1.shown")
    assert shown[0] <= worst["start"] < worst["end"] <= shown[1]
    press(browser, "Escape")
    readout(browser)
    browser.execute_script(
        """const canvas = document.querySelector('canvas.parts'), box = canvas.getBoundingClientRect();
        const x = box.left + window.explorers.r1.x(20, box.width);
        const event = { clientX: x, clientY: box.top + 5, pointerType: 'mouse' };
        canvas.dispatchEvent(new PointerEvent('pointermove', event))"""
    )
    assert readout(browser).startswith(said_of(scores, int(np.searchsorted(scores.time, 20.0 + 1e-6)) - 1))


def test_zoom_is_shared_and_keeps_the_cursor(browser: Any, report: Path) -> None:
    show(browser, report, 1280)
    whole = browser.execute_script("return [...window.explorers.r1.shown]")
    browser.execute_script("document.querySelector('[data-zoom=\"0.5\"]').click()")
    shown, now = browser.execute_script("const e = window.explorers.r1; return [e.shown, e.time[e.at]]")
    assert (shown[1] - shown[0]) == pytest.approx((whole[1] - whole[0]) / 2)
    assert shown[0] <= now <= shown[1]
    browser.execute_script("document.querySelector('[data-zoom=all]').click()")
    assert browser.execute_script("return window.explorers.r1.shown") == whole


def test_parts_can_be_picked(browser: Any, report: Path) -> None:
    show(browser, report, 1280)
    browser.execute_script("document.querySelector('[data-part=upper_arm_left]').click()")
    readout(browser)
    legend = browser.execute_script("return document.querySelector('.angle-legend').textContent")
    assert legend.startswith("left upper arm flexion ")
    assert browser.execute_script("return document.querySelectorAll('#r1 [aria-pressed=true]').length") == 1


def test_the_figure_has_the_joints_of_the_posture(browser: Any, report: Path) -> None:
    show(browser, report, 1280)
    rng = np.random.default_rng(5)
    for sitting in (False, True):
        angles = rng.uniform(-60, 120, len(reba.COLUMNS))
        angles[rng.random(len(angles)) < 0.2] = np.nan
        drawn = browser.execute_script(
            "return Person.joints(explorers.r1.model, arguments[0].map((v) => v === null ? NaN : v), arguments[1])",
            [None if np.isnan(value) else float(value) for value in angles], sitting,
        )  # fmt: skip
        expected = joints(angles, sitting)
        assert set(drawn) == set(expected)
        for name, place in expected.items():
            np.testing.assert_allclose(drawn[name], place, atol=1e-9, err_msg=name)


def test_the_figure_is_turned_by_dragging(browser: Any, report: Path) -> None:
    show(browser, report, 1280)
    browser.execute_script("document.querySelector('[data-turn=\"90\"]').click()")
    browser.execute_script(
        "document.querySelector('canvas.figure').dispatchEvent("
        "new PointerEvent('pointermove', { buttons: 1, movementX: 25, pointerType: 'mouse' }))"
    )
    assert browser.execute_script("return window.explorers.r1.degrees") == 65


def test_assumptions_change_the_shares(browser: Any, report: Path) -> None:
    scores = scored(1500, 1)
    show(browser, report, 1280)
    table = what_if(scores, durations(scores.time))
    choice = [1, 2, 1, 3, 2]
    browser.execute_script(
        """const inputs = [...document.querySelectorAll('#r1 .sliders input')];
        inputs.forEach((input, k) => { input.value = arguments[0][k]; });
        inputs[0].dispatchEvent(new Event('input'))""", choice
    )  # fmt: skip
    row = np.ravel_multi_index(choice, [len(values) for values in table.settings.values()])
    low, high = (f"{share * durations(scores.time).sum():.1f} s (" for share in table.shares[row, 6:])
    said = browser.execute_script("return document.querySelector('#r1 .outcome').textContent")
    assert said.startswith(joined(f"REBA 8 or more: {low}"))
    assert joined(high) in said
    spans = "return [...document.querySelectorAll(arguments[0])].map((e) => e.className).filter((e) => e !== 'open')"
    for bar in ("#r1 .what-if .bar i", "#r1 .levelbars:not(.errorbars) .bar:first-of-type i"):
        names = browser.execute_script(spans, bar)
        assert names == sorted(names), "the lowest level comes first in every bar"


TEXTS = """const [head, ...rest] = document.querySelectorAll('#r1 .what-if tbody tr');
    return [head, ...rest].map((row) => row.children[1].textContent)"""


def test_without_a_change_the_assumptions_read_as_the_report(browser: Any, report: Path, tmp_path: Path) -> None:
    """Seconds and shares of every length, with ties and noise in the last digit, are rounded alike."""
    for seconds in (19.0, 19.15, 700.0, 7300.0):
        time = np.linspace(0.0, seconds, 800, endpoint=False)
        data = pd.DataFrame(dict.fromkeys(reba.COLUMNS, np.zeros(800)))
        data["trunk_flexion"] = np.repeat([0.0, 70.0, 0.0, 30.0], [100, 40, 659, 1])
        data["time"] = time
        path = tmp_path / f"{seconds}.html"
        write_report(reba.score(data, load=12.0, activity="none"), path)
        show(browser, path, 1280)
        rows = "return [...document.querySelectorAll('#r1 .levels tbody tr')].map((row) => row.children[2].textContent)"
        levels = [text.split() for text in browser.execute_script(rows)]
        spoken = [text.replace("(", "").replace(")", "").split() for text in browser.execute_script(TEXTS)]
        assert spoken == levels, seconds


def test_nothing_is_cut_or_leaves_its_frame(browser: Any, tmp_path: Path) -> None:
    """Ranges are wider than single numbers: in the names of parts, and in the differences on a phone."""
    recordings = []
    for without in ("^$", "left|neck|shoulder"):
        columns = {name: np.full(250, 40.0) for name in reba.COLUMNS if not re.search(without, name)}
        recordings.append(reba.score(pd.DataFrame({"time": np.arange(250) / 25, **columns}), load=7.0))
    path = tmp_path / "two.html"
    write_report(recordings, path)
    for width in (390, 1280):
        show(browser, path, width)
        readout(browser)
        for selector in (".compared td", ".compared", ".part-names button", ".part-names button b"):
            code = """const right = (e) => e.getBoundingClientRect().right;
                const out = (e) => right(e) - 0.5 > right(e.parentElement);
                return [...document.querySelectorAll(arguments[0])].filter((e) => e.getClientRects().length &&
                (out(e) || e.scrollWidth > e.clientWidth + 1)).map((e) => e.textContent)"""
            assert browser.execute_script(code, selector) == [], (width, selector)
        shadows = "return getComputedStyle(document.querySelector('.scroll')).backgroundAttachment"
        assert ("local" in browser.execute_script(shadows)) == (width < 700), "what goes on behind an edge has a shadow"


def test_numbers_of_worst_intervals_are_whole_where_they_crowd(browser: Any, tmp_path: Path) -> None:
    def at(*peaks: float, seconds: float) -> Scores:
        time = np.arange(0, seconds, 0.04)
        trunk = np.where(np.min([np.abs(time - peak) for peak in peaks], axis=0) < 0.3, 80.0, 5.0)
        return reba.score(pd.DataFrame({"time": time, "trunk_flexion": trunk}), load=12.0)

    path = tmp_path / "crowded.html"
    write_report([at(0.1, 2.0, seconds=3.0), at(55.0, 57.5, 59.9, seconds=60.0)], path)
    resize(browser, 390)
    browser.get("about:blank")
    noting = """addEventListener('DOMContentLoaded', () => {
        const pens = CanvasRenderingContext2D.prototype, { rect, fillRect } = pens;
        window.numbers = [];
        pens.rect = function (...box) { this.frame = box; rect.apply(this, box); };
        pens.fillRect = function (...box) {
          if (box[2] === 16 && box[3] === 16) numbers.push([box[0], this.frame[0], this.frame[0] + this.frame[2]]);
          fillRect.apply(this, box);
        };
      })"""
    script = browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": noting})
    try:
        show(browser, path, 390)
        readout(browser)
        numbers = browser.execute_script("return numbers")
    finally:
        browser.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", script)
    assert len(numbers) >= 5
    assert all(left <= number and number + 16 <= right for number, left, right in numbers)


def test_a_number_stays_with_its_unit(browser: Any, report: Path) -> None:
    show(browser, report, 390)
    readout(browser)
    said = browser.execute_script("return document.querySelector('#r1 .card .verdict').textContent")
    assert re.search(r"\d\xa0s \(\d+\xa0%", said)
    apart = browser.execute_script(
        """const apart = new RegExp(arguments[0]), texts = [];
        const all = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
        while (all.nextNode()) if (!all.currentNode.parentElement.closest('pre, script, style, svg')) {
          const text = all.currentNode.textContent; if (apart.test(text)) texts.push(text); }
        return texts""",
        WITH_UNIT,
    )
    assert apart == []
    assert "--load 7" in browser.execute_script("return document.querySelector('pre').textContent")


@pytest.fixture(scope="module")
def hour(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scores, Path]:
    """An hour whose score changes every second, with ranges that are long as text."""
    rng = np.random.default_rng(4)
    time = np.arange(36_000) / 10
    columns = {name: np.repeat(rng.uniform(0, 80, 3600), 10) for name in reba.COLUMNS if "wrist" not in name}
    scores = reba.score(pd.DataFrame({"time": time, **columns}), load=7.0, activity="none")
    path = tmp_path_factory.mktemp("hour") / "hour.html"
    write_report([scores], path)
    return scores, path


@pytest.mark.parametrize("width", [390, 1280])
def test_an_hour_fits_and_shows_means_until_it_is_zoomed(browser: Any, hour: tuple[Scores, Path], width: int) -> None:
    scores, path = hour
    show(browser, path, width)
    readout(browser)
    assert too_wide(browser) <= 0
    browser.execute_script("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    assert too_wide(browser) <= 0
    code = (
        "return [...document.querySelectorAll('.levels, .what-if table')].map((e) => e.getBoundingClientRect().right)"
    )
    assert max(browser.execute_script(code)) <= width, "tables of long times"
    assert visible(browser, ".busy") == 1
    k, parts = 17, 150
    inside = (scores.time >= 3600 / parts * k) & (scores.time < 3600 / parts * (k + 1))
    for end in ("low", "high"):
        mean = scores.data[f"reba_{end}"][inside].mean()
        shown = browser.execute_script(f"return window.explorers.r1.means.reba.{end}[{k}] / 10")
        assert shown == pytest.approx(mean, abs=0.0501)
    browser.execute_script("const e = window.explorers.r1; e.zoomTo(100, 130); e.draw()")
    readout(browser)
    assert visible(browser, ".busy") == 0


def test_an_hour_is_printed_with_its_means(hour: tuple[Scores, Path]) -> None:
    page = hour[1].read_text(encoding="utf-8")
    assert page.count('class="spread"') == 1
    assert "time [min]; line: mean over 24.0 s, grey: lowest to highest score" in page


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
        assert not {"CANVAS", "INPUT"} & laid_out
    finally:
        browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})


def test_prints_as_pages(browser: Any, report: Path) -> None:
    show(browser, report, 1280)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    assert visible(browser, ".over-time .still svg") == 2
    assert visible(browser, ".comparison svg") == 2
    assert visible(browser, "canvas") == 0
    assert visible(browser, ".explorer, .what-if") == 0
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert 4 <= pages_on_paper(browser) <= 30


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_text_stands_out(browser: Any, report: Path, scheme: str) -> None:
    with preferring(browser, scheme):
        show(browser, report, 1280)
        weak = weak_texts(browser)
        dark = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
    assert weak == []
    assert (dark == "rgb(20, 24, 30)") == (scheme == "dark")


def test_the_first_printed_page_stands_alone(browser: Any, tmp_path: Path) -> None:
    path = tmp_path / "one.html"
    write_report(scored(1500, 1), path, task="Palletising boxes", assessor="A. Example")
    show(browser, path, 703)  # A4 without its margins
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    code = """const sheet = document.querySelector('.sheet');
        return [sheet.getBoundingClientRect().bottom + scrollY,
        sheet.textContent, sheet.querySelectorAll('.postures svg').length,
        sheet.querySelectorAll('.actions li').length]"""
    bottom, text, postures, actions = browser.execute_script(code)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert bottom < 273 / 25.4 * 96, "it ends on the page on which it begins"
    assert (postures, actions) == (3, 3)
    for words in ("Palletising boxes", "A. Example", "90th percentile", "Load [kg]: 7 (given)", "Rules: measured"):
        assert words in text


def test_a_comparison_is_printed_on_one_page(browser: Any, report: Path) -> None:
    show(browser, report, 703)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    bottom = browser.execute_script(
        "return document.querySelector('.comparison').getBoundingClientRect().bottom + scrollY"
    )
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert bottom < 273 / 25.4 * 96


def test_a_report_is_printed_as_pdf(tmp_path: Path) -> None:
    path = tmp_path / "report.pdf"
    write_report(scored(300, 1), path)
    content = path.read_bytes()
    assert content.startswith(b"%PDF")
    assert content.count(b"/Type /Page\n") + content.count(b"/Type /Page ") >= 4
    assert [file.name for file in tmp_path.iterdir()] == ["report.pdf"]


def test_the_overview_is_sorted_by_a_click(browser: Any, tmp_path: Path) -> None:
    recordings = []
    for number, trunk in enumerate((30.0, 70.0, 10.0)):
        frames = pd.DataFrame({"time": np.arange(10.0 * (number + 1)), "trunk_flexion": trunk})
        scores = reba.score(frames, missing="neutral")
        source = dataclasses.replace(scores.postures, source=f"recording_{'bca'[number]}.csv")
        recordings.append(dataclasses.replace(scores, postures=source))
    path = tmp_path / "several.html"
    reba.write_report(recordings, path)
    show(browser, path, 1200)
    rows = "return [...document.querySelectorAll('.overview tbody tr')].map((row) => row.cells[0].innerText.at(-5))"
    heads = browser.find_elements("css selector", ".overview thead th button")
    order = {"as given": browser.execute_script(rows)}
    for column, name in ((0, "by name"), (0, "by name, back"), (1, "by p90"), (7, "by seconds")):
        heads[column].click()
        order[name] = browser.execute_script(rows)
    assert order == {
        "as given": ["b", "c", "a"],
        "by name": ["a", "b", "c"],
        "by name, back": ["c", "b", "a"],
        "by p90": ["c", "b", "a"],
        "by seconds": ["a", "c", "b"],
    }
    sorts = (
        "return [...document.querySelectorAll('.overview th[aria-sort]')].map((one) => one.getAttribute('aria-sort'))"
    )
    assert browser.execute_script(sorts) == ["descending"]
    # Links still lead to the sections.
    browser.find_element("css selector", ".overview tbody tr a").click()
    assert browser.execute_script("return location.hash") == "#r3"
    assert complaints(browser) == []


def at(browser: Any, selector: str) -> tuple[float, float, float, float]:
    """Scroll to an element, and return its box in the window."""
    code = """const e = document.querySelector(arguments[0]); e.scrollIntoView({ block: 'center' });
        const box = e.getBoundingClientRect(); return [box.left, box.top, box.width, box.height]"""
    left, top, width, height = browser.execute_script(code, selector)
    return left, top, width, height


def test_real_keys_mouse_and_fingers_move_cursor_and_figure(browser: Any, report: Path) -> None:
    """Events as the browser makes them from devices, not ones that a script sends to an element."""

    def state() -> tuple[int, list[float], float]:
        readout(browser)
        code = "const e = window.explorers.r1; return [e.at, e.shown, e.degrees]"
        now, shown, degrees = browser.execute_script(code)
        return now, shown, degrees

    def mouse(kind: str, x: float, y: float, buttons: int = 0) -> None:
        event = {"type": kind, "x": x, "y": y, "button": "left" if buttons or kind == "mouseReleased" else "none"}
        browser.execute_cdp_cmd("Input.dispatchMouseEvent", {**event, "buttons": buttons, "clickCount": 1})

    def fingers(kind: str, *places: tuple[float, float]) -> None:
        points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(places)]
        browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    def key(name: str) -> None:
        for kind in ("rawKeyDown", "keyUp"):
            code = {"ArrowRight": 39, "Home": 36, "Tab": 9}[name]
            event = {"type": kind, "key": name, "code": name, "windowsVirtualKeyCode": code}
            browser.execute_cdp_cmd("Input.dispatchKeyEvent", event)

    show(browser, report, 1280)
    left, top, width, height = at(browser, "#r1 canvas.scores")
    mouse("mouseMoved", left + 0.5 * width, top + 0.5 * height)
    middle = state()[0]
    mouse("mouseMoved", left + 0.8 * width, top + 0.5 * height)
    assert state()[0] > middle > 0
    mouse("mousePressed", left + 0.5 * width, top + 0.5 * height, 1)
    mouse("mouseReleased", left + 0.5 * width, top + 0.5 * height)
    focused = "return document.activeElement.getAttribute('role')"
    assert browser.execute_script(focused) == "slider"
    key("Home")
    assert state()[0] == 0
    key("ArrowRight")
    assert state()[0] == 1
    key("Tab")
    assert browser.execute_script("return document.activeElement.dataset.part") == "trunk"
    left, top, width, height = at(browser, "#r1 canvas.figure")
    before = state()[2]
    mouse("mousePressed", left + 0.5 * width, top + 0.5 * height, 1)
    mouse("mouseMoved", left + 0.5 * width + 40, top + 0.5 * height, 1)
    mouse("mouseReleased", left + 0.5 * width + 40, top + 0.5 * height)
    assert state()[2] != before
    show(browser, report, 390)
    browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True, "maxTouchPoints": 2})
    try:
        left, top, width, height = at(browser, "#r1 canvas.parts")
        y = top + 0.5 * height
        fingers("touchStart", (left + 0.6 * width, y))
        fingers("touchMove", (left + 0.8 * width, y))
        fingers("touchEnd")
        assert state()[0] > middle
        whole = state()[1]
        fingers("touchStart", (left + 0.6 * width, y), (left + 0.7 * width, y))
        for k in range(1, 5):
            fingers("touchMove", (left + (0.6 - 0.03 * k) * width, y), (left + (0.7 + 0.04 * k) * width, y))
        fingers("touchEnd")
        shown = state()[1]
        assert shown[1] - shown[0] < whole[1] - whole[0], "two fingers zoom"
        left, top, width, height = at(browser, "#r1 canvas.figure")
        before = state()[2]
        fingers("touchStart", (left + 0.3 * width, top + 0.5 * height))
        for k in range(1, 4):
            fingers("touchMove", (left + (0.3 + 0.1 * k) * width, top + 0.5 * height))
        fingers("touchEnd")
        assert state()[2] != before, "a finger turns the figure"
    finally:
        browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})
