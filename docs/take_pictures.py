"""Take the pictures of the documentation: the report of the demo, and a slide of a plan. Needs Chromium and Pillow.

python docs/take_pictures.py [--plan FOLDER]     # of `lgp plan examples/scenes/fetch_while_screwing.toml -o FOLDER`
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

import lgp
import reba

DOCS = Path(__file__).resolve().parent
RECORDING = DOCS.parent / "datasets" / "simulated_palletising.mcap"
SCENE = DOCS.parent / "examples" / "scenes" / "fetch_while_screwing.toml"
COLORS = 128
"""Colors of a picture: pages have few, and files stay small."""


def picture(page: str, name: str, width: int, height: int) -> None:
    """Save what Chromium shows of a page."""
    browser = shutil.which("chromium") or shutil.which("google-chrome") or "chromium"
    with TemporaryDirectory() as folder:
        shot = Path(folder) / "shot.png"
        flags = [f"--screenshot={shot}", f"--window-size={width},{height}", f"--user-data-dir={folder}/profile"]
        flags += ["--headless=new", "--no-sandbox", "--hide-scrollbars", "--virtual-time-budget=9000"]
        flags += ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        subprocess.run([browser, *flags, page], check=True, timeout=600)
        with Image.open(shot) as image:
            image.convert("RGB").quantize(COLORS).save(DOCS / name, optimize=True)


def main() -> None:
    """Take both pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plan", type=Path, help="folder with a plan; by default the scene is planned")
    plan = parser.parse_args().plan
    with TemporaryDirectory() as folder:
        report = Path(folder) / "report.html"
        scores = reba.score(reba.read(RECORDING), load=9.0, coupling="fair")
        reba.write_report(scores, report)
        picture(report.as_uri(), "report.png", 1100, 1240)
        planned = lgp.plan(SCENE) if plan is None else lgp.Plan.load(plan)
        page = lgp.write_page(planned, Path(folder) / "page", pictures=False)
        picture(f"{page.as_uri()}#/1", "slide.png", 1100, 720)


if __name__ == "__main__":
    main()
