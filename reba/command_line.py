"""Output, exit codes and options that the commands of all packages share.

Exit codes: 0 done, 1 some inputs of a batch failed, 2 bad input or usage (one line), 130 interrupted.
"""

from __future__ import annotations

import json
import os
import sys
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

import click

from reba.errors import RebaError
from reba.extras import EXTRAS, missing
from reba.outputs import FileOutput, FolderOutput, Output, check_outputs, existing

if TYPE_CHECKING:
    from rich.console import Console


class OutputType(click.types.StringParamType):
    """Type of an option or argument that names what a command writes; `Command` checks it before the command works.

    Args:
        describe: returns the output of a name; None where the command itself must check it.
    """

    def __init__(self, describe: Callable[[str], Output | None]) -> None:
        self.describe = describe


def output_file(*suffixes: str) -> OutputType:
    """Return the type of an option for a file, see `reba.outputs.FileOutput`."""
    return OutputType(lambda name: FileOutput(name, suffixes))


def output_folder(*owns: str) -> OutputType:
    """Return the type of an option for a folder, see `reba.outputs.FolderOutput`."""
    return OutputType(lambda name: FolderOutput(name, owns))


class Command(click.Command):
    """A command that checks its outputs first; every name in its other values that exists counts as an input."""

    def invoke(self, ctx: click.Context) -> Any:
        """Check the outputs, then run the command."""
        outputs, inputs = [], []
        for param in self.params:
            kind, value = param.type, ctx.params.get(param.name or "")
            if isinstance(kind, OutputType):
                outputs += [kind.describe(value)] if value is not None else []
            elif isinstance(kind, click.types.StringParamType):
                inputs.append(value)
        check_outputs(*outputs, inputs=existing(inputs))
        return super().invoke(ctx)


class Group(click.Group):
    """A command group whose commands check their outputs."""

    command_class = Command


GROUP: Final[dict[str, Any]] = {"help_option_names": ["-h", "--help"], "max_content_width": 110}
"""Settings of a command group."""
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output.")


def parallel_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options for parallel work, see `reba.batch.parallel`."""
    for option in (
        click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler to run on, such as tcp://HOST:8786."),
        click.option(
            "--jobs", default=1, type=click.IntRange(min=1), show_default=True, help="Processes on this machine."
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
