"""The HTML templates of all pages: one environment, strict and escaping, and one base with the shared style."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import resources
from typing import TYPE_CHECKING, Any

from reba.report.words import LEVEL_COLOURS, PART_COLOURS, TEXT_ON

if TYPE_CHECKING:
    from jinja2 import Template

BASE = "base.html"
"""What pages extend: head, shared style, and the blocks `title`, `style` and `body`."""


def template(
    package: str, name: str, filters: Mapping[str, Callable[..., Any]] | None = None, scripted: bool = False
) -> Template:
    """Return a template of a package; every name that it uses must be given to `render`.

    Args:
        package: where it is, `lgp.study`; its first part is named as the program that made the page.
        name: file name in the package.
        filters: name -> function.
        scripted: whether the page runs scripts of its own; others forbid all.

    Example:
        >>> print(template("reba.report", "base.html").render()[:15])
        <!DOCTYPE html>
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined
    from markupsafe import Markup

    from reba import __version__

    environment = Environment(
        loader=FunctionLoader(lambda wanted: read("reba.report" if wanted == BASE else package, wanted)),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= dict(filters or {})
    environment.globals |= {
        "program": package.partition(".")[0],
        "version": __version__,
        "style": Markup(_colours() + read("reba.report", "style.css")),
        "scripted": scripted,
    }
    return environment.get_template(name)


def read(package: str, name: str) -> str:
    """Return the text of a file in a package."""
    return (resources.files(package) / name).read_text(encoding="utf-8")


def _colours() -> str:
    """Return the classes l0 to l4 and p0 to p6 as CSS: a colour and a text colour that stands out from it."""
    named = {f"l{i}": colour for i, colour in enumerate(LEVEL_COLOURS)}
    named |= {f"p{i}": colour for i, colour in enumerate(PART_COLOURS)}
    fills = [f".{name} {{ background: {colour}; color: {TEXT_ON.get(colour, '#1b2430')}; }}\n" for name, colour in
             named.items()]  # fmt: skip
    edges = [f".l{i}-edge {{ border-left-color: {colour} !important; }}\n" for i, colour in enumerate(LEVEL_COLOURS)]
    return "".join((*fills, *edges))
