"""Output, exit codes and options that the commands of all packages share.

Exit codes: 0 done, 1 some inputs of a batch failed, 2 bad input or usage (one line), 130 interrupted.
"""

from __future__ import annotations

import io
import math
import os
import shlex
import shutil
import sys
import textwrap
import traceback
import warnings
from collections.abc import Callable, Iterable
from typing import Any, Final

import click
from click.shell_completion import shell_complete

from reba.errors import RebaError
from reba.extras import EXTRAS, missing
from reba.file_names import word_without_folder
from reba.files import as_json
from reba.interrupts import discard_output, interrupted
from reba.outputs import FileOutput, FolderOutput, Output, check_outputs, existing
from reba.printable import joined, printable
from reba.provenance import with_provenance


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
    """A command group whose commands check their outputs; its help has the first sentence of each in full."""

    command_class = Command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands with their first sentences, wrapped and not cut."""
        commands = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        rows = [
            (name, one.get_short_help_str(limit=1000)) for name, one in commands if one is not None and not one.hidden
        ]
        if rows:
            with formatter.section("Commands"):
                formatter.write_dl(rows)


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


def echo_notes(*recordings: Any) -> None:
    """Print on standard error what the reader noticed of recordings, what several have in common once, but for radians:
    of these there is a warning.

    Args:
        recordings: posture tables.
    """
    print_notes(dict.fromkeys(note for one in recordings for note in one.quality.notes(radians=False)))


def print_notes(notes: Iterable[str]) -> None:
    """Print notes on standard error."""
    for note in notes:
        echo(f"note: {note}", err=True)


def page_command(program: str) -> str:
    """Return the command line as pages show it that name no recordings: paths are cut to their last part."""
    return shlex.join([program, *map(word_without_folder, sys.argv[1:])])


def report_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options for the report."""
    for option in (
        click.option("--date", default="", metavar="TEXT", help="Date on the first printed page."),
        click.option("--assessor", default="", metavar="TEXT", help="Assessor on the first printed page."),
        click.option("--task", default="", metavar="TEXT", help="Task on the first printed page."),
        click.option(
            "--camera", default="", metavar="TOPIC",
            help="Topic of the images; by default the one with the most.",
        ),
        click.option(
            "--images", type=click.Choice(["pixelated", "clear"]),
            help="Show in the report images of a camera in the recording: pixelated as a whole, or clear.",
        ),
        click.option(
            "--names", is_flag=True,
            help="Show in the report the names that recordings give to people, marker sets and streams, and paths.",
        ),
        click.option(
            "--report", type=output_file(), metavar="FILE.html|FILE.pdf",
            help="Write a self-contained report; a PDF is printed by a browser on this machine.",
        ),
    ):  # fmt: skip
        command = option(command)
    return command


def report_form(values: dict[str, Any]) -> tuple[str | None, dict[str, Any]]:
    """Return the report and the other values that click gives for `report_options`, and take them out.

    Raises:
        RebaError: images are asked for without a report, or a camera without images.
    """
    report = values.pop("report")
    if values["images"] and report is None:
        raise RebaError(f"--images {values['images']} shows them in the report; give --report FILE.html too")
    if values["camera"] and not values["images"]:
        raise RebaError(f"--camera {values['camera']} chooses among images; give --images pixelated or clear too")
    return report, {name: values.pop(name) for name in ("task", "assessor", "date", "names", "images", "camera")}


class Stop(Exception):
    """Ends a command with an exit code after all output was printed."""

    def __init__(self, code: int) -> None:
        self.code = code


def echo(text: str, err: bool = False, nl: bool = True, keep: str = "", data: bool = False) -> None:
    r"""Print a text with its hidden characters as escape codes, except those to `keep`; every line passes here.

    A message on a terminal ends its lines between words; in a pipe or a file it is one line.

    Args:
        err: on standard error.
        nl: end the line.
        keep: such as "\n" for a text of several lines.
        data: for programs, so one line on a terminal, too.
    """
    shown = printable(text, keep)
    stream = sys.stderr if err else sys.stdout
    if not keep and not data and stream is not None and stream.isatty():
        shown = _in_lines(shown, shutil.get_terminal_size().columns)
    click.echo(shown, err=err, nl=nl)


def _in_lines(text: str, width: int) -> str:
    """Return a message in lines of a width; the later ones are indented, so that none looks like a message of its own.

    >>> print(_in_lines("note: the first frame was left out at 2 s", 20))
    note: the first
      frame was left out
      at 2 s
    """
    space = "\ue000"  # where no line ends
    lines = textwrap.wrap(
        joined(text, space), width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
    )
    return "\n".join(lines).replace(space, " ")


def _refused(error: click.ClickException) -> str:
    """Return what click found wrong; what is missing or unknown is explained, or the help that does so is named."""
    text = error.format_message()
    if not isinstance(error, click.UsageError) or error.ctx is None:
        return text
    if isinstance(error, click.BadParameter) and not isinstance(error, click.MissingParameter):
        return text  # it names what is expected
    meaning = (
        error.param.help if isinstance(error, click.MissingParameter) and isinstance(error.param, click.Option) else ""
    )
    text = text.rstrip(".") + (f": {meaning}" if meaning else "")
    return f"{text.rstrip('.')}; see `{error.ctx.command_path} --help`"


def print_json(result: Any) -> None:
    """Print one JSON object on standard output, with its provenance."""
    echo(as_json(with_provenance(result), non_finite="refuse"), data=True)


def command_line(name: str) -> str:
    """Return the command as a shell reads it, so that a result can be reproduced by pasting it."""
    return shlex.join([name, *sys.argv[1:]])


def run(group: click.Group, name: str, fit: str = "fit") -> None:
    """Run a command group and exit; errors and warnings are one line each on standard error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A terminal of another encoding lacks some letters.
            stream.reconfigure(errors="backslashreplace")
    sys.excepthook = lambda *error: echo("".join(traceback.format_exception(*error)), err=True, nl=False, keep="\n")
    try:
        with warnings.catch_warnings():
            warnings.showwarning = lambda message, *_, **__: echo(f"{name}: warning: {message}", err=True)
            _call(group, name)
        code = 0
    except Stop as stop:
        code = stop.code
    except (RebaError, click.ClickException) as error:
        text = _refused(error) if isinstance(error, click.ClickException) else str(error)
        echo(f"{name}: {' '.join(text.split())}", err=True)
        code = 2
    except ModuleNotFoundError as error:
        extra = EXTRAS.get((error.name or "").split(".")[0])
        if extra is None:
            raise
        # The extra for planning holds that for fitting: a planner's user installs once.
        echo(f"{name}: {missing(error.name or '', 'this command', fit if extra == 'fit' else extra)}", err=True)
        code = 2
    except (KeyboardInterrupt, click.Abort):
        code = interrupted(name)
    except (BrokenPipeError, SystemExit):
        # The reader of the output closed the pipe (`reba score ... | head`); rich raises SystemExit for that.
        discard_output()
        code = 0
    except OSError as error:
        discard_output()
        path = f"{error.filename}: " if error.filename else ""
        echo(f"{name}: {path}{error.strerror or error}; the output is incomplete", err=True)
        code = 2
    raise SystemExit(code)


def _call(group: click.Group, name: str) -> None:
    """Call a command group as its `main` does, which however answers an interrupt with a blank line of its own."""
    variable = f"_{name.upper()}_COMPLETE"
    if variable in os.environ:
        raise SystemExit(shell_complete(group, {}, name, variable, os.environ[variable]))
    try:
        # A name alone asks what there is: it is no wrong usage.
        with group.make_context(
            name, sys.argv[1:] or (["--help"] if isinstance(group, click.Group) else [])
        ) as context:
            group.invoke(context)
    except click.exceptions.Exit:  # --help and --version have printed
        pass
