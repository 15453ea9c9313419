"""XML of robots and meshes that users give: bounded, without entities, and with finite numbers."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any, Final
from xml.parsers import expat

from lgp.errors import WorldError

DEEPEST: Final = 100
"""Most elements inside each other."""
MOST_ELEMENTS: Final = 500_000
LARGEST: Final = 1e6
"""Largest number of a robot or mesh [m, rad, kg, N, ...]; no real one is near."""
SHOWN: Final = 40
"""Characters of a value that a message repeats."""


def parse_xml(data: bytes, where: Path, root: str) -> ET.Element:
    """Return the root element of a file.

    Args:
        data: its bytes.
        where: the file, for messages.
        root: expected name of the root element, without namespace.

    Raises:
        WorldError: not XML, another root, entities or a document type, or nested too deep.
    """
    state = {"depth": 0, "count": 0}

    def begin(name: str, attributes: Any) -> None:
        state["depth"] += 1
        state["count"] += 1
        if state["depth"] > DEEPEST or state["count"] > MOST_ELEMENTS:
            raise WorldError(
                f"{where}: element <{name[:SHOWN]}>: more than {DEEPEST} levels or {MOST_ELEMENTS} elements; "
                "export the file again"
            )

    def end(name: str) -> None:
        state["depth"] -= 1

    def refuse(*_: Any) -> None:
        raise WorldError(f"{where}: has a document type, which may define entities; delete <!DOCTYPE ...>")

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(data, True)
        element = ET.fromstring(data)
    except (expat.ExpatError, ET.ParseError, ValueError, LookupError) as error:
        if isinstance(error, WorldError):
            raise
        raise WorldError(f"{where}: is not XML ({' '.join(str(error).split())}); export the file again") from error
    name = element.tag.rpartition("}")[2]
    if name != root:
        raise WorldError(f"{where}: its root element is <{name[:SHOWN]}>, expected <{root}>; give another file")
    return element


def numbers(text: str, count: int, where: str, low: float = -LARGEST, high: float = LARGEST) -> list[float]:
    """Return the numbers of an attribute.

    Args:
        text: the attribute.
        count: how many numbers are expected.
        where: file, element and attribute, for messages.
        low, high: smallest and largest number.

    Raises:
        WorldError: another count, or a word that is no finite number from `low` to `high`.

    >>> numbers("0 1.5 -2", 3, "x")
    [0.0, 1.5, -2.0]
    """
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(value) and low <= value <= high for value in values):
        what = "a number" if count == 1 else f"{count} numbers"
        raise WorldError(f"{where} is {text[:SHOWN]!r}, expected {what} from {low:g} to {high:g}")
    return values
