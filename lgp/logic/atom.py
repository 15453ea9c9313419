"""Ground atoms, written as the paper prints them: `grasped(human.right_hand, screwdriver)`."""

from __future__ import annotations

import re
from typing import Final, NamedTuple

from lgp.errors import LogicError

_ATOM: Final = re.compile(r"\s*([A-Za-z_][\w.-]*)\s*\(([^()]*)\)\s*")


class Atom(NamedTuple):
    """A predicate with its arguments."""

    predicate: str
    arguments: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.predicate}({', '.join(self.arguments)})"


def parse_atom(text: str) -> Atom:
    """Return the atom that a text names.

    Raises:
        LogicError: the text is not of the form `predicate(argument, ...)`.

    Example:
        >>> parse_atom("placed(screwdriver, table.left)").arguments
        ('screwdriver', 'table.left')
    """
    found = _ATOM.fullmatch(text)
    if found is None:
        raise LogicError(f"{text!r} is no atom; write predicate(argument, ...), as in grasped(human.right_hand, box)")
    arguments = tuple(word.strip() for word in found[2].split(",")) if found[2].strip() else ()
    if not all(arguments):
        raise LogicError(f"{text!r} has an empty argument; write predicate(argument, ...)")
    return Atom(found[1], arguments)
