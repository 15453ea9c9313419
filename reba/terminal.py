"""The terminal as tables and progress bars see it: of texts from inputs every character is seen.

The commands use these classes instead of those of rich, which passes escape codes on and measures them as nothing.
"""

from __future__ import annotations

import os
import sys
from typing import Any

import rich.console
import rich.text
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from reba.printable import printable


class Text(rich.text.Text):
    r"""Text whose hidden characters are shown as escape codes, except those to `keep`: line ends of our own headings.

    >>> Text("left\x1b[2J hand").plain, Text("time\n[s]", keep="\n").plain
    ('left\\x1b[2J hand', 'time\n[s]')
    """

    def __init__(self, text: str = "", style: Any = "", *, keep: str = "", **options: Any) -> None:
        super().__init__(printable(text, keep), style, **options)

    def append(self, text: Any, style: Any = None) -> Text:
        """Append a text; `Text.assemble` does so too."""
        super().append(printable(text) if isinstance(text, str) else text, style)
        return self


class Console(rich.console.Console):
    """Console that reads no markup and no emoji in texts, and shows their hidden characters as `Text` does."""

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, markup=False, emoji=False, **options)

    def render_str(self, text: str, **options: Any) -> rich.text.Text:
        """Return a string to print, a cell or a heading as text to lay out."""
        return super().render_str(printable(text), **options)


def console(stderr: bool = False) -> Console:
    """Return the console for tables: as wide as the terminal, 160 columns if the output is piped."""
    stream = sys.stderr if stderr else sys.stdout
    on_terminal = stream is not None and stream.isatty()  # None: the caller closed the stream
    return Console(stderr=stderr, width=None if on_terminal or "COLUMNS" in os.environ else 160)


class ProgressBar:
    """A progress bar on standard error, where the name of what was done last stands before the bar."""

    def __init__(self, words: str, total: int) -> None:
        # The description of the default columns would be read as markup.
        name = TextColumn("{task.description}", style="progress.description", markup=False)
        columns = (name, BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
        self._progress = Progress(*columns, console=console(stderr=True), transient=True)
        self._task = self._progress.add_task(words, total=total)

    def __enter__(self) -> ProgressBar:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def advance(self, name: str) -> None:
        """Count one more, and show its name."""
        self._progress.update(self._task, advance=1, description=printable(name))
