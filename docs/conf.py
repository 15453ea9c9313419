"""Sphinx: the pages of this folder as HTML. `make docs` builds them with warnings as errors."""

from __future__ import annotations

import ast
from importlib.metadata import version as installed
from importlib.util import find_spec
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
html_static_path = ["formulas.css"]
html_css_files = ["formulas.css"]
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
    writer.body.append(f'<div class="formula">{tex2mathml(node.astext(), as_block=True)}</div>')
    raise nodes.SkipNode


def constant_doc(module: str, name: str) -> str:
    """Return the string below a constant in the module that defines it, which others import it from."""
    path = Path(find_spec(module).origin)  # type: ignore[union-attr, arg-type]
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node, after in pairwise(tree.body):
        target = node.target if isinstance(node, ast.AnnAssign) else getattr(node, "targets", [None])[0]
        if isinstance(target, ast.Name) and target.id == name:
            return str(after.value.value)  # type: ignore[attr-defined]
    imports = (node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module)
    source = next(node.module for node in imports if name in [alias.name for alias in node.names])
    return constant_doc(str(source), name)


def describe_constant(app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    """Describe a constant by the string below it; autodoc finds the description of its type alone."""
    if what == "data":
        lines[:] = [*constant_doc(*name.rsplit(".", 1)).splitlines(), ""]


def setup(app: Any) -> None:
    """Add the writer of formulas and the descriptions of constants."""
    app.connect("autodoc-process-docstring", describe_constant, priority=900)
    app.add_html_math_renderer("mathml", (inline_math, None), (block_math, None))


html_math_renderer = "mathml"
