"""The page in a real browser: every slide, keys, clicks that play, phone width, pictures without WebGL, a live run."""

from __future__ import annotations

import importlib
import io
import json
import queue
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import lgp
from lgp.scene.scene_file import read_scene
from tests.support.browser import (
    chromium,
    complaints,
    needs_browser,
    pages_on_paper,
    preferring,
    resize,
    until,
    weak_texts,
)
from tests.support.lgp_worlds import HUMAN_ONLY

PACKAGES = all(importlib.util.find_spec(name) for name in ("pyvista", "trimesh", "collada"))
pytestmark = [
    pytest.mark.slow,
    needs_browser,
    pytest.mark.skipif(not PACKAGES, reason="the extra `page` is not installed"),
]
SOFTWARE_GL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SCENE = HUMAN_ONLY | {"initial": ["on_table(box)", "free(human.right_hand)", "free(human.left_hand)"]}
ACTIONS = [
    "grasp(human.left_hand, box)",
    "place(human.left_hand, box, table.near)",
    "grasp(human.right_hand, box)",
]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from lgp.page.page import write_page

    plan = lgp.plan(read_scene(SCENE, "box"), cost=None, sequence=ACTIONS, slices=3, collisions=False)
    assert plan.feasible, plan.reason
    return write_page(plan, tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with chromium(tmp_path_factory.mktemp("profile"), *SOFTWARE_GL) as found:
        yield found


def show(browser: Any, address: str, width: int = 900, height: int = 700) -> None:
    resize(browser, width, height)
    browser.get("about:blank")
    browser.get_log("browser")
    browser.get(address)
    until(browser, "document.documentElement.dataset.ready")


def watch(browser: Any) -> None:
    """Note where each play begins: a slow browser may draw its first frame when the play is over."""
    browser.execute_script(
        "window.plays = []; const play = player.play;"
        "player.play = (...given) => { play(...given); plays.push(player.playing.from); };"
    )


def state(browser: Any) -> tuple[int, float, bool]:
    """Return the number of the slide, the moment shown [s], and whether it plays."""
    index, moment, playing = browser.execute_script(
        "return [Reveal.getIndices().h, player.time, player.playing !== null]"
    )
    return index, moment, playing


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (400, 800)])
def test_every_slide_offline_at_desk_and_phone(browser: Any, page: Path, width: int, height: int) -> None:
    show(browser, page.as_uri(), width, height)
    count = browser.execute_script("return Reveal.getTotalSlides()")
    assert count == len(ACTIONS) + 2
    for number in range(count):
        browser.execute_script("Reveal.slide(arguments[0])", number)
        assert state(browser)[0] == number
        sizes = browser.execute_script(
            """const box = (e) => { const r = e.getBoundingClientRect(); return [r.left, r.top, r.right, r.bottom]; };
            const slide = Reveal.getCurrentSlide();
            return [box(slide.querySelector("h1, h2")), box(slide.querySelector("canvas")),
                box(document.querySelector(".bar")), document.documentElement.scrollWidth - innerWidth]"""
        )
        words, canvas, bar, wide = sizes
        assert wide <= 0
        assert words[0] >= 0
        assert words[2] <= width
        assert words[3] <= canvas[1] + 1
        assert canvas[3] <= bar[1] + 1
        assert canvas[3] - canvas[1] > 0.3 * height
        assert bar[3] <= height
    addresses = browser.execute_script("return performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert all(address.startswith("file:") for address in addresses)
    assert complaints(browser) == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_slides_are_as_dark_as_the_reader_wants(browser: Any, page: Path, scheme: str) -> None:
    with preferring(browser, scheme):
        show(browser, page.as_uri(), 1280, 800)
        weak = []
        for number in range(len(ACTIONS) + 2):
            browser.execute_script("Reveal.slide(arguments[0])", number)
            weak += weak_texts(browser)
        picture = Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("L")
    light = np.asarray(picture) / 255.0
    assert weak == []
    assert (np.median(light[:80]) < 0.3) == (np.median(light[-80:]) < 0.3) == (scheme == "dark")  # words and bar
    assert (np.median(light[500:690, 640:]) < 0.5) == (scheme == "dark")  # floor


def test_keys_lead_through_the_plan(browser: Any, page: Path) -> None:
    from selenium.webdriver.common.keys import Keys

    show(browser, page.as_uri())
    body = browser.find_element("tag name", "body")
    body.send_keys(Keys.ARROW_RIGHT)
    assert state(browser)[0] == 1
    body.send_keys(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_LEFT)
    assert state(browser)[0] == 2
    rest = state(browser)[1]
    watch(browser)
    for count, key in enumerate((Keys.SPACE, Keys.ENTER), start=1):
        body.send_keys(key)
        until(browser, f"plays.length === {count} && plays.at(-1) < {rest} - 0.2")
        assert state(browser)[0] == 2
    body.send_keys(Keys.ARROW_RIGHT)
    assert not state(browser)[2]
    assert browser.execute_script("return document.querySelector('.previous').disabled") is False


def test_a_click_plays_the_action_in_three_dimensions(browser: Any, page: Path) -> None:
    show(browser, f"{page.as_uri()}#/1")
    hand = """player.stage.frames[player.stage.view.frames.indexOf("human.left_wrist_X")].position.toArray()"""
    last = browser.execute_script(f"return {hand}")
    rest = state(browser)[1]
    browser.find_element("css selector", "section.present canvas").click()
    until(browser, f"player.playing && player.time < {rest} - 0.5")
    moved = browser.execute_script(f"return {hand}")
    assert max(abs(a - b) for a, b in zip(last, moved, strict=True)) > 0.05
    until(browser, "player.playing === null")
    assert state(browser)[:2] == (1, pytest.approx(rest))
    assert browser.execute_script(f"return {hand}") == pytest.approx(last, abs=1e-5)


def test_a_drag_turns_the_view_and_does_not_play(browser: Any, page: Path) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    show(browser, f"{page.as_uri()}#/1")
    before = browser.execute_script("return player.stage.camera.position.toArray()")
    canvas = browser.find_element("css selector", "section.present canvas")
    ActionChains(browser, duration=50).click_and_hold(canvas).move_by_offset(120, 10).release().perform()
    after = browser.execute_script("return player.stage.camera.position.toArray()")
    assert max(abs(a - b) for a, b in zip(before, after, strict=True)) > 0.1
    assert not state(browser)[2]


def test_something_is_drawn(browser: Any, page: Path) -> None:
    show(browser, f"{page.as_uri()}#/1")
    colours = browser.execute_script(
        """const stage = player.stage; stage.renderer.render(stage.scene, stage.camera);
        const gl = stage.renderer.getContext(), pixels = new Uint8Array(4 * 200 * 200);
        gl.readPixels(stage.canvas.width / 2 - 100, stage.canvas.height / 2 - 100, 200, 200,
            gl.RGBA, gl.UNSIGNED_BYTE, pixels);
        const found = new Set();
        for (let at = 0; at < pixels.length; at += 4) found.add(pixels.slice(at, at + 3).join());
        return found.size"""
    )
    assert colours > 100


def test_the_ribbon_leads_to_a_moment(browser: Any, page: Path) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    show(browser, page.as_uri())
    ribbon = browser.find_element("css selector", ".ribbon")
    ActionChains(browser).move_to_element(ribbon).click().perform()
    index, moment, _ = state(browser)
    assert index == 2
    assert moment == pytest.approx(3.0, abs=0.1)
    assert browser.execute_script("return document.querySelector('.steps .current').textContent") == "2"
    assert int(browser.execute_script("return document.querySelector('.reba b').textContent")) >= 1


def test_pictures_and_films_stand_in_without_webgl(page: Path, tmp_path: Path) -> None:
    with chromium(tmp_path, "--disable-gpu", "--disable-3d-apis") as browser:
        show(browser, f"{page.as_uri()}#/2", 400, 800)
        assert browser.execute_script("return player.stage === null")
        image = "document.querySelector('section.present .still')"
        until(browser, f"{image}.complete && {image}.naturalWidth > 300")
        browser.execute_script(f"{image}.click()")
        assert "action-2-film.webp" in browser.execute_script(f"return {image}.src")
        until(browser, f"player.playing === null && {image}.src.endsWith('action-2.webp')")
        assert complaints(browser) == []


class Live(SimpleHTTPRequestHandler):
    """Serves a page, and events as long as there is a queue of them; None in it drops the connection."""

    events: queue.Queue[dict[str, Any] | None] | None = None

    def do_GET(self) -> None:
        if self.path != "/events":
            super().do_GET()
        elif Live.events is None:
            self.send_error(404)
        else:
            self.send_response(200)
            self.send_header("Content-Type", "text/event-stream")
            self.end_headers()
            self.wfile.write(b"retry: 150\n\n")
            events = Live.events
            while (message := events.get()) is not None:
                self.wfile.write(f"data: {json.dumps(message)}\n\n".encode())
                self.wfile.flush()

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture
def serve(page: Path) -> Iterator[Callable[[bool], str]]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Live, directory=str(page.parent)))
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, args=(0.05,))
    thread.start()

    def start(live: bool) -> str:
        Live.events = queue.Queue() if live else None
        return f"http://127.0.0.1:{server.server_address[1]}/index.html"

    yield start
    if Live.events is not None:
        Live.events.put(None)
    server.shutdown()
    thread.join()
    server.server_close()


def banner(browser: Any, words: str) -> None:
    until(browser, f"""document.querySelector(".banner").textContent.includes({json.dumps(words)})""")


def shown_instruction(browser: Any) -> bool:
    """Whether the text of an action is visible."""
    script = 'return getComputedStyle(document.querySelector("section.action .text")).visibility'
    return bool(browser.execute_script(script) == "visible")


def test_it_follows_a_run_and_comes_back_after_a_drop(browser: Any, serve: Callable[[bool], str]) -> None:
    address = serve(True)
    events = Live.events
    assert events is not None
    show(browser, address)
    events.put({"action": 0, "state": "running", "text": "Reaching for the box", "time": 0.1, "plan": 0})
    banner(browser, "Your turn")
    assert state(browser)[0] == 1
    # The reader looks elsewhere; the same action does not call back, the next one does.
    browser.execute_script("Reveal.slide(3)")
    events.put({"action": 0, "state": "waiting", "text": "The box is not in the hand yet", "time": 2.0})
    banner(browser, "Waiting for you")
    assert state(browser)[0] == 3
    assert shown_instruction(browser)
    resize(browser, 390, 800)  # a phone that is turned: the words of the banner take more lines
    until(
        browser,
        """document.querySelector(".banner").getBoundingClientRect().bottom
        <= Reveal.getCurrentSlide().getBoundingClientRect().top + 0.5""",
    )
    resize(browser, 900, 700)
    stopped = {"action": 0, "state": "waiting", "text": "Please wait. The box was moved.", "time": 2.2, "wait": True}
    events.put(stopped)
    banner(browser, "Please waitThe box was moved")
    assert not shown_instruction(browser)  # of a box that is gone
    events.put({"action": 0, "state": "running", "text": "Reach for the box", "time": 2.4, "wait": False})
    banner(browser, "Reach for the box")
    assert shown_instruction(browser)
    events.put({"action": 0, "state": "done", "text": "", "time": 2.5})
    events.put({"action": 1, "state": "waiting", "text": "Put it down", "time": 2.6})
    banner(browser, "Put it down")
    assert state(browser)[0] == 2
    # Each connection reads a queue of its own, as the former one may still wait.
    again = Live.events = queue.Queue()
    events.put(None)
    again.put({"action": 2, "state": "failed", "text": "The box was lost", "time": 9.0, "plan": 0})
    banner(browser, "Stopped")
    assert state(browser)[0] == 3
    # A plan that was made anew has a page of its own.
    browser.execute_script("window.former = true")
    anew = Live.events = queue.Queue()
    again.put({"action": 0, "state": "waiting", "text": "", "time": 9.5, "plan": 1})
    until(browser, "window.former === undefined && document.documentElement.dataset.ready")
    anew.put({"action": None, "state": "finished", "text": "", "time": 9.9, "plan": 1})
    banner(browser, "Finished")
    assert state(browser)[0] == len(ACTIONS) + 1
    again.put(None)


def test_a_plain_file_server_leaves_the_page_to_its_reader(browser: Any, serve: Callable[[bool], str]) -> None:
    show(browser, serve(False))
    time.sleep(0.5)
    assert browser.execute_script("return document.querySelector('.banner').hidden")
    assert [entry for entry in complaints(browser) if "events" not in entry["message"]] == []


def test_prints_a_page_for_each_slide_and_no_notes(browser: Any, page: Path) -> None:
    resize(browser, 1280)
    browser.get(page.as_uri())
    until(browser, "document.querySelectorAll('section').length")
    slides = browser.execute_script("return document.querySelectorAll('section').length")
    assert pages_on_paper(browser) == slides


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_slide_has_its_picture_on_paper(browser: Any, page: Path, scheme: str) -> None:
    with preferring(browser, scheme):
        show(browser, page.as_uri())
        browser.execute_script("Reveal.slide(2)")
        before = browser.execute_script("return [player.time, player.stage.camera.aspect, player.stage.marked]")
        browser.execute_script("dispatchEvent(new Event('beforeprint'))")
        pictures = browser.execute_script(
            """return [...document.querySelectorAll("section")].map((slide) => {
              const picture = slide.querySelector("canvas.paper");
              const { data } = picture.getContext("2d").getImageData(0, 0, picture.width, picture.height);
              let [drawn, sum] = [0, 0];
              for (let i = 0; i < data.length; i += 4)
                if (data[i + 3] > 250) [drawn, sum] = [drawn + 1, sum + data[i + 1]];
              return [drawn / (data.length / 4), sum / drawn];
            })"""
        )
        after = browser.execute_script("return [player.time, player.stage.camera.aspect, player.stage.marked]")
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
        heights = browser.execute_script(
            "return [...document.querySelectorAll('.paper')].map((one) => one.getBoundingClientRect().height)"
        )
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
        browser.execute_script("dispatchEvent(new Event('afterprint'))")
    assert len(pictures) == len(ACTIONS) + 2
    assert all(share > 0.1 and light > 120 for share, light in pictures), pictures  # light also where the page is dark
    assert min(heights) > 200
    assert after == before
    assert browser.execute_script("return document.querySelectorAll('.paper').length") == 0
