"""Sphinx: the pages of this folder as HTML. `make docs` builds them with warnings as errors."""

from __future__ import annotations

from importlib.metadata import version as installed

project = "dREBA"
author = "the dREBA authors"
project_copyright = "the dREBA authors, Apache-2.0"
release = version = installed("dreba")
extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"dREBA {release}"
nitpicky = True
