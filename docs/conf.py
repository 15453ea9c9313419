"""Sphinx: the pages of this folder as HTML. `make docs` builds them with warnings as errors."""

from __future__ import annotations

from importlib.metadata import version as installed
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml

project = "dREBA"
author = "the dREBA authors"
project_copyright = "the dREBA authors, Apache-2.0"
release = version = installed("dreba")
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"dREBA {release}"
nitpicky = True
autodoc_typehints = "description"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_use_rtype = False
nitpick_ignore_regex = [("py:.*", ".*")]
"""Types of NumPy, pandas and scikit-learn are named in signatures; their own pages are not at hand offline."""


def inline_math(writer: Any, node: nodes.math) -> None:
    """Write a formula in a line as MathML, which browsers set without a script or a network."""
    writer.body.append(tex2mathml(node.astext(), as_block=False))
    raise nodes.SkipNode


def block_math(writer: Any, node: nodes.math_block) -> None:
    """Write a formula of its own as MathML."""
    writer.body.append(tex2mathml(node.astext(), as_block=True))
    raise nodes.SkipNode


def setup(app: Any) -> None:
    """Enter the formulas' writer."""
    app.add_html_math_renderer("mathml", (inline_math, None), (block_math, None))


html_math_renderer = "mathml"
