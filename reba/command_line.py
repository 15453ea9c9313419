"""Output, exit codes and options that the commands of all packages share.

Exit codes: 0 done, 1 some inputs of a batch failed, 2 bad input or usage (one line), 130 interrupted.
"""

from __future__ import annotations

import json
import math
import os
import sys
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

import click

from reba.errors import RebaError
from reba.extras import EXTRAS, missing

if TYPE_CHECKING:
    from rich.console import Console

GROUP: Final[dict[str, Any]] = {"help_option_names": ["-h", "--help"], "max_content_width": 110}
"""Settings of a command group."""
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output.")


class Number(click.FloatRange):
    """A finite number of an option, from `min` to `max`: click lets "nan" pass any range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number, or refuse it as click does."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{number} is not a number in the range {self._describe_range()}.", param, ctx)
        return number


SEED: Final = click.IntRange(0, 2**32 - 1)
"""Seeds of random numbers."""
SECONDS: Final = Number(-1e9, 1e9)
"""A time of a recording [s]."""
LOAD: Final = Number(0, 1e4)
"""[kg] Far above what a person moves."""
MOST_JOBS: Final = 1024
MOST: Final = 1_000_000
"""Largest count or duration [s] of an option."""


def parallel_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options for parallel work, see `reba.batch.parallel`."""
    for option in (
        click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler to run on, such as tcp://HOST:8786."),
        click.option(
            "--jobs", default=1, type=click.IntRange(1, MOST_JOBS), show_default=True, help="Processes on this machine."
        ),
    ):
        command = option(command)
    return command


class Stop(Exception):
    """Ends a command with an exit code after all output was printed."""

    def __init__(self, code: int) -> None:
        self.code = code


def console(stderr: bool = False) -> Console:
    """Return the console for tables: as wide as the terminal, 160 columns if the output is piped."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    on_terminal = stream is not None and stream.isatty()  # None: the caller closed the stream
    width = None if on_terminal or "COLUMNS" in os.environ else 160
    return Console(stderr=stderr, highlight=False, markup=False, width=width)


def print_json(result: Any) -> None:
    """Print one JSON object on standard output."""
    click.echo(json.dumps(result, allow_nan=False))


def command_line(name: str) -> str:
    """Return the command as it was typed, so that a result can be reproduced."""
    return " ".join([name, *sys.argv[1:]])


def _discard_output() -> None:
    """Redirect standard output to the null device: Python would write buffered text again at exit and fail again."""
    if sys.stdout is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def run(group: click.Group, name: str, fit: str = "fit") -> None:
    """Run a command group and exit; errors and warnings are one line each on standard error."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = lambda message, *_, **__: click.echo(f"{name}: warning: {message}", err=True)
            group.main(standalone_mode=False)
        code = 0
    except Stop as stop:
        code = stop.code
    except (RebaError, click.ClickException) as error:
        text = error.format_message() if isinstance(error, click.ClickException) else str(error)
        click.echo(f"{name}: {' '.join(text.split())}", err=True)
        code = 2
    except ModuleNotFoundError as error:
        extra = EXTRAS.get((error.name or "").split(".")[0])
        if extra is None:
            raise
        # The extra for planning holds that for fitting: a planner's user installs once.
        click.echo(f"{name}: {missing(error.name or '', 'this command', fit if extra == 'fit' else extra)}", err=True)
        code = 2
    except (KeyboardInterrupt, click.Abort):
        click.echo(f"{name}: interrupted", err=True)
        code = 130
    except (BrokenPipeError, SystemExit):
        # The reader of the output closed the pipe (`reba score ... | head`); rich raises SystemExit for that.
        _discard_output()
        code = 0
    except OSError as error:
        _discard_output()
        path = f"{error.filename}: " if error.filename else ""
        click.echo(f"{name}: {path}{error.strerror or error}; the output is incomplete", err=True)
        code = 2
    raise SystemExit(code)
