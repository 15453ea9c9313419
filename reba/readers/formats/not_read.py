"""Formats that are not read: what they are and what to do instead, from the entries of `not_read.toml`."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from reba.errors import ReadError
from reba.open_file import read_settings


@dataclass(frozen=True)
class NotRead:
    """A format that is not read.

    Attributes:
        what: what a file of it is, in a sentence.
        hint: what to do with it.
        starts: first bytes of its files, as Latin-1.
        endings: of their names.
    """

    what: str
    hint: str
    starts: tuple[str, ...] = ()
    endings: tuple[str, ...] = ()


@cache
def not_read() -> tuple[NotRead, ...]:
    """Return the formats that are not read."""
    text = read_settings(Path(__file__).with_suffix(".toml"))
    return tuple(
        NotRead(entry["what"], entry["hint"], tuple(entry.get("starts", ())), tuple(entry["endings"]))
        for entry in tomllib.loads(text)["format"]
    )


def refuse_by_content(path: Path, head: bytes) -> None:
    """Refuse a file whose first bytes are those of a format that is not read."""
    text = head.lstrip().decode("latin-1")
    _refuse(path, lambda known: text.startswith(known.starts))


def refuse_by_name(path: Path) -> None:
    """Refuse a file whose name has the ending of a format that is not read."""
    name = path.name.lower()
    _refuse(path, lambda known: name.endswith(known.endings))


def _refuse(path: Path, is_one: Callable[[NotRead], bool]) -> None:
    for known in not_read():
        if is_one(known):
            raise ReadError(path, f"{known.what} is not read", hint=known.hint)
