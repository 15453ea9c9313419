"""Where commands find their modules: not in the current folder, which may hold recordings of others and a `numpy.py`.

Python puts it first on the path for `python -m`, and for each empty entry of `PYTHONPATH`, which
`PYTHONPATH=$PYTHONPATH:/opt/robot` leaves where there was none before. Both come before the standard library, so this
is called before anything large is imported; the installed commands do without the first.
"""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager

TYPE_CHECKING = False  # that of typing takes long to import, and no signal is handled yet
if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Final

SAFE_PATH: Final[dict[str, str]] = {"PYTHONSAFEPATH": "1"}
"""Has a Python process do without the folders that Python adds by itself; an empty value says no."""


def leave_out_current_folder() -> None:
    """Find no module in the current folder, in this process and in those that it starts.

    A folder that `PYTHONPATH` names stays, and so does the one that holds these packages.
    """
    named = [place for place in os.environ.get("PYTHONPATH", "").split(os.pathsep) if place]
    if "PYTHONPATH" in os.environ:
        os.environ["PYTHONPATH"] = os.pathsep.join(named)
    os.environ.update(SAFE_PATH)
    packages = os.path.dirname(os.path.dirname(__file__))
    try:
        here = os.path.realpath(os.curdir)
    except OSError:  # it was removed, and so holds nothing
        return
    if here in map(os.path.realpath, (packages, *named)):
        return
    library = os.path.dirname(os.__file__)
    front = sys.path.index(library) if library in sys.path else len(sys.path)
    sys.path[:front] = [place for place in sys.path[:front] if os.path.realpath(place or os.curdir) != here]


@contextmanager
def left_out_for_started() -> Iterator[None]:
    """Have Python processes that are started in here do without them; a caller's environment is as before after it."""
    before = {name: os.environ.get(name) for name in SAFE_PATH}
    os.environ.update(SAFE_PATH)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
