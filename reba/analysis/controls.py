"""The table of workplace controls: what changes a workplace so that an angle or a factor stays within a limit."""

from __future__ import annotations

import functools
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from reba.open_file import read_settings
from reba.toml_table import TomlTable

HIERARCHY: Final = ("elimination", "substitution", "engineering", "administrative")
"""The steps of the hierarchy of controls, most effective first (ISO 45001:2018, 8.1.2)."""


@dataclass(frozen=True)
class Control:
    """A change of the workplace.

    Attributes:
        text: what to do, with the fields `{low}`, `{high}`, `{grip}` ... of the limit.
        control: its step in `HIERARCHY`.
        source: the documents that ask for it.
    """

    text: str
    control: str
    source: str


@functools.cache
def controls() -> dict[str, Control]:
    """Return the control of each angle and factor, by its name without a side.

    Example:
        >>> controls()["load"].control
        'substitution'
    """
    path = Path(__file__).parent / "controls.toml"
    file = TomlTable(path.name, tomllib.loads(read_settings(path)))
    known = {}
    for name in file.keys(file.values):
        one = file.table(name)
        known[name] = Control(one.text("text"), one.text("control", choices=HIERARCHY), one.text("source"))
        one.done()
    return known
