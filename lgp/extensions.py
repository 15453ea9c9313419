"""Python files of one's own that commands run first, to register actions and cost terms."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from lgp.errors import LgpError
from reba.errors import RebaError
from reba.open_file import read_settings

NAME: Final = "lgp_extension"
"""`__name__` in such a file: what stands below `if __name__ == "__main__":` does not run."""


def ask(what: str, function: Callable[[Any], Any], moment: Any) -> Any:
    """Return what a function of one's own says of a moment.

    Raises:
        LgpError: it fails with an error of its own; names `what` it is, and its line.
    """
    try:
        return function(moment)
    except RebaError:
        raise
    except Exception as error:
        own = traceback.extract_tb(error.__traceback__)[1:2]
        at = f" (line {own[0].lineno} of {own[0].filename})" if own else ""
        raise LgpError(
            f"{what} fails{at}: {type(error).__name__}: {' '.join(str(error).split())}; correct it"
        ) from error


def run_extension(file: str) -> None:
    """Run a Python file. It may do whatever its user may do: only files that somebody names are run, no scene's.

    Raises:
        LgpError: it cannot be read, or fails.
    """
    try:
        text = read_settings(file)
    except (OSError, UnicodeDecodeError) as error:
        raise LgpError(f"{file}: cannot be read ({error}); give a Python file that registers actions") from error
    names: dict[str, Any] = {"__name__": NAME, "__file__": str(Path(file).absolute())}
    try:
        exec(compile(text, file, "exec"), names)
    except (RebaError, SyntaxError) as error:
        raise LgpError(f"{file}: {' '.join(str(error).split())}") from error
    except Exception as error:
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
        at = f"line {lines[-1]}: " if lines else ""
        raise LgpError(f"{file}: {at}{type(error).__name__}: {' '.join(str(error).split())}; correct it") from error
