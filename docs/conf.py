"""Sphinx: the pages of this folder as HTML. `make docs` builds them with warnings as errors."""

from __future__ import annotations

import ast
from importlib.metadata import version as installed
from itertools import pairwise
from pathlib import Path
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
autodoc_default_options = {"exclude-members": "set_fit_request, set_score_request"}  # scikit-learn's metadata routing
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


def constant_docs(package: str) -> dict[str, str]:
    """Return the string below each constant of a package, by its name."""
    docs: dict[str, str] = {}
    for path in (Path(__file__).parent.parent / package).rglob("*.py"):
        body = ast.parse(path.read_text(encoding="utf-8")).body
        for node, after in pairwise(body):
            target = node.target if isinstance(node, ast.AnnAssign) else getattr(node, "targets", [None])[0]
            if isinstance(target, ast.Name) and isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
                docs[target.id] = str(after.value.value)
    return docs


def describe_constant(app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    """Take the description of a constant from the module that defines it: autodoc sees its type's alone."""
    package, _, constant = name.partition(".")
    if what == "data":
        lines[:] = [*constant_docs(package)[constant].splitlines(), ""]


def setup(app: Any) -> None:
    """Add the writer of formulas and the descriptions of constants."""
    app.connect("autodoc-process-docstring", describe_constant, priority=1)
    app.add_html_math_renderer("mathml", (inline_math, None), (block_math, None))


html_math_renderer = "mathml"
