"""The errors of all packages: each message has the input, the expected value and the next step.

Every error the package raises on purpose is a `RebaError`, which is also a `ValueError`; its text is one line that
the command line prints as it is.
"""

from __future__ import annotations

import difflib
import re
import sys
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from reba.printable import printable

PACKAGES: Final = frozenset({"reba", "dreba", "lgp"})
LONGEST: Final = 2000
"""Characters of a message; what is longer came from the input and loses its middle."""


class RebaError(ValueError):
    r"""Base of every error that this package raises on purpose; its text is one line of printable characters.

    >>> str(RebaError("row 3\n is \x1b[31mred"))
    'row 3 is \\x1b[31mred'
    """

    def __init__(self, text: str = "") -> None:
        super().__init__(_one_line(text))


class RulesError(RebaError):
    """A `Rules` record or its TOML file cannot be used."""


class PostureError(RebaError):
    """A posture table or one of its factors cannot be scored."""


class ProfileError(RebaError):
    """No profile fits a recording, two fit equally well, or a profile file is wrong."""


class ReadError(RebaError):
    """A recording cannot be read: which file, where in it, what is wrong, what to do.

    >>> str(ReadError("walk.mcap", "chunk CRC differs", hint="record it again", offset=4096))
    'walk.mcap: at byte 4096: chunk CRC differs; record it again'
    """

    def __init__(self, path: str | Path, what: str, *, hint: str = "", offset: int | None = None) -> None:
        self.path = str(path)
        self.what = what
        self.hint = hint
        self.offset = offset
        where = f"at byte {offset}: " if offset is not None else ""
        super().__init__(f"{self.path}: {where}{what}" + (f"; {hint}" if hint else ""))

    def __reduce__(self) -> tuple[object, ...]:
        # Errors cross process borders when files are scored in parallel.
        return (_read_error, (self.path, self.what, self.hint, self.offset))


class RadiansWarning(UserWarning):
    """Angles look like radians where degrees are expected."""


def warn_user(text: str, category: type[Warning] = UserWarning) -> None:
    """Warn at the line of the caller's code: the nearest one outside our packages."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and str(frame.f_globals.get("__name__")).partition(".")[0] in PACKAGES:
        level, frame = level + 1, frame.f_back
    warnings.warn(text, category, stacklevel=level)


def _read_error(path: str, what: str, hint: str, offset: int | None) -> ReadError:
    return ReadError(path, what, hint=hint, offset=offset)


def _one_line(text: str) -> str:
    # Names and values of damaged files end up in messages, control characters included.
    if len(text) > LONGEST:
        text = f"{text[: LONGEST - 600]} ... {text[-500:]}"
    return printable(re.sub(r"\s*[\r\n]+\s*", " ", text))


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Return "; did you mean 'x'?" for the nearest known name, or an empty string.

    >>> did_you_mean("trunk_flexoin", ["trunk_flexion", "neck_flexion"])
    "; did you mean 'trunk_flexion'?"
    """
    near = difflib.get_close_matches(str(name), list(known), n=1, cutoff=0.75)
    return f"; did you mean '{near[0]}'?" if near else ""


def join_names(names: Sequence[str], most: int = 0) -> str:
    """Return names as a list in a sentence; of more than `most` (0: any number) the first and how many more.

    >>> join_names(["a", "b", "c"]), join_names(["a", "b", "c"], most=2)
    ('a, b and c', 'a, b and 1 more')
    """
    shown = [*names[:most], f"{len(names) - most} more"] if 0 < most < len(names) else [*names]
    return " and ".join([", ".join(shown[:-1]), *shown[-1:]] if len(shown) > 1 else shown)
