"""A command in this process, with standard output and standard error apart in every version of click."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import Any, NamedTuple

import click
from click.testing import CliRunner  # noqa: TID251

# Before click 8.2 both streams are one unless told otherwise, and `Result.stderr` is an error.
_APART: dict[str, Any] = {"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}


class Invoked(NamedTuple):
    """A command that has ended."""

    exit_code: int
    stdout: str
    stderr: str
    exception: BaseException | None

    @property
    def output(self) -> str:
        """Standard output, then standard error."""
        return self.stdout + self.stderr


def invoke(command: click.Command, words: Sequence[str], *, catch_exceptions: bool = True) -> Invoked:
    """Run a command with the words after its name."""
    done = CliRunner(**_APART).invoke(command, list(words), catch_exceptions=catch_exceptions)
    return Invoked(done.exit_code, done.stdout, done.stderr, done.exception)
