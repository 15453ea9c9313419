"""Chromium without a window, for tests that open pages as their readers do."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")

needs_browser = pytest.mark.skipif(
    not (BROWSER and DRIVER and importlib.util.find_spec("selenium")),
    reason="Chromium, chromedriver and selenium are not all installed",
)

FLAGS = (
    "--headless=new", "--no-sandbox", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--hide-scrollbars",
)  # fmt: skip


@contextmanager
def chromium(profile: Path, *flags: str) -> Iterator[Any]:
    """Give a driver of a fresh browser, which logs what the console says."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for flag in (*FLAGS, *flags, f"--user-data-dir={profile}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    try:
        yield driver
    finally:
        driver.quit()


def offline(browser: Any) -> None:
    """Take the network away."""
    none = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}
    browser.execute_cdp_cmd("Network.enable", {})
    browser.execute_cdp_cmd("Network.emulateNetworkConditions", none)


def resize(browser: Any, width: int, height: int = 900) -> None:
    """Set the size of the window [px]; narrow ones are phones."""
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def until(browser: Any, code: str) -> Any:
    """Wait until a piece of JavaScript gives something true, and return it."""
    from selenium.webdriver.support.ui import WebDriverWait

    return WebDriverWait(browser, 60, poll_frequency=0.05).until(lambda one: one.execute_script(f"return {code}"))


def visible(browser: Any, selector: str) -> int:
    """Return how many elements of a selector are seen."""
    code = "return [...document.querySelectorAll(arguments[0])].filter((e) => e.getClientRects().length).length"
    return int(browser.execute_script(code, selector))


def too_wide(browser: Any) -> int:
    """Return how far the page reaches beyond the window [px]; 0 or less if it does not.

    A phone shows a page that is too wide smaller, and its `innerWidth` is that of the page then.
    """
    page = "document.documentElement"
    return int(browser.execute_script(f"return {page}.scrollWidth - {page}.clientWidth"))


def complaints(browser: Any) -> list[Any]:
    """Return what the console complains about; that software draws is no fault of the page."""
    return [
        entry
        for entry in browser.get_log("browser")
        if entry["level"] in ("SEVERE", "WARNING") and "GL Driver Message" not in entry["message"]
    ]


def pages_on_paper(browser: Any) -> int:
    """Print the page and return the number of its pages."""
    import base64

    pdf = base64.b64decode(browser.execute_cdp_cmd("Page.printToPDF", {"preferCSSPageSize": True})["data"])
    assert pdf.startswith(b"%PDF")
    return pdf.count(b"/Type /Page\n") + pdf.count(b"/Type /Page ")


CONTRASTS = """
const light = (rgb) => [0.2126, 0.7152, 0.0722].reduce((sum, share, k) => {
  const v = rgb[k] / 255;
  return sum + share * (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
}, 0);
const parse = (text) => text.match(/[\\d.]+/g).map(Number);
const ground = (element) => {
  for (let one = element; one; one = one.parentElement) {
    const style = getComputedStyle(one), color = parse(style.backgroundColor);
    if (style.backgroundImage !== "none") return null;
    if (color.length < 4 || color[3] > 0.5) return color;
  }
  return [255, 255, 255];
};
const weak = [], walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walk.nextNode()) {
  const element = walk.currentNode.parentElement, text = walk.currentNode.textContent.trim();
  if (!text || !element.getClientRects().length || element.closest("script, .badge, text.number")) continue;
  const drawing = element.closest("svg"), style = getComputedStyle(element), behind = ground(drawing || element);
  if (!behind) continue;
  const [a, b] = [light(parse(drawing ? style.fill : style.color)), light(behind)];
  const size = parseFloat(style.fontSize), large = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
  const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  if (ratio < (large ? 3 : 4.5)) weak.push(`${text.slice(0, 30)}: ${ratio.toFixed(2)}`);
}
return weak;
"""
"""Texts that stand out too little from what is behind them (WCAG 2.2, 1.4.3, level AA)."""


def weak_texts(browser: Any) -> list[str]:
    """Return the texts that stand out too little from what is behind them."""
    found: list[str] = browser.execute_script(CONTRASTS)
    return found


@contextmanager
def preferring(browser: Any, scheme: str) -> Iterator[None]:
    """Let the browser prefer `light` or `dark` pages."""
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    try:
        yield
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
