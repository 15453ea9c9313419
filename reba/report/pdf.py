"""A page as PDF, printed by a browser of this machine without a window and without a network."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Final

from reba.errors import RebaError
from reba.files import write_text

BROWSERS: Final = ("chromium", "chromium-browser", "google-chrome", "chrome", "microsoft-edge", "msedge")
"""Browsers that print, by their commands."""
PLACES: Final = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    r"C:\Program Files\Google\Chrome\Application\chrome.exe",
    r"C:\Program Files (x86)\Microsoft\Edge\Application\msedge.exe",
)
"""Where browsers stand that have no command."""
SECONDS: Final = 120.0
"""[s] After this long without a PDF the browser is ended."""


def print_pdf(html: str, path: Path) -> None:
    """Print a page as PDF.

    Raises:
        RebaError: there is no browser that prints, or it wrote nothing.
    """
    browser = find_browser()
    if browser is None:
        raise RebaError(
            f"{path.name}: no browser was found to print the PDF (tried {', '.join(BROWSERS)}); install Chromium, or "
            "write the report as .html and print it"
        )
    with tempfile.TemporaryDirectory(prefix="reba-print-") as folder:
        page = Path(folder, "report.html")
        write_text(page, html)
        # As root browsers refuse their sandbox; the page is ours and loads nothing.
        root = ["--no-sandbox"] if getattr(os, "geteuid", lambda: 1)() == 0 else []
        flags = [
            "--headless",
            "--disable-gpu",
            "--no-first-run",
            "--no-pdf-header-footer",
            f"--user-data-dir={folder}/profile",
        ]
        command = [browser, *flags, *root, f"--print-to-pdf={path}", page.as_uri()]
        try:
            done = subprocess.run(command, capture_output=True, timeout=SECONDS, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise RebaError(f"{path.name}: {browser} could not print ({error}); write the report as .html") from error
        if not path.exists() or not path.stat().st_size:
            said = done.stderr.decode(errors="replace").strip().splitlines()[-1:] or ["it said nothing"]
            raise RebaError(f"{path.name}: {browser} printed nothing ({said[0]}); write the report as .html")


def find_browser() -> str | None:
    """Return the path of a browser that prints, None if there is none."""
    named = next((path for name in BROWSERS if os.path.isabs(path := shutil.which(name) or "")), None)
    return named or next((path for path in PLACES if Path(path).exists()), None)
