"""The terminal as tables and progress bars see it: of texts from inputs every character is seen.

The commands use these classes instead of those of rich, which passes escape codes on and measures them as nothing.
"""

from __future__ import annotations

import copy
import os
import sys
from typing import Any, Final, Self

import rich.console
import rich.containers
import rich.measure
import rich.text
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from reba.printable import joined, printable

_JOINED: Final = "\ue000"
"""Stands for a space at which no line ends while lines are laid out: a no-break space is one to rich, too."""
LARGE: Final = 10_000
"""Columns in which every table has room: the width that it needs is measured there."""


class Text(rich.text.Text):
    r"""Text whose numbers stay on one line with their units, and whose hidden characters are shown as escape codes,
    except those to `keep`: line ends of our own headings.

    >>> Text("left\x1b[2J hand").plain, Text("time\n[s]", keep="\n").plain
    ('left\\x1b[2J hand', 'time\n[s]')
    """

    def __init__(self, text: str = "", style: Any = "", *, keep: str = "", **options: Any) -> None:
        super().__init__(printable(text, keep), style, **options)

    def append(self, text: Any, style: Any = None) -> Text:
        """Append a text; `Text.assemble` does so too."""
        super().append(printable(text) if isinstance(text, str) else text, style)
        return self

    def wrap(self, console: rich.console.Console, width: int, **options: Any) -> rich.containers.Lines:
        """Return the text in lines of a width."""
        lines = self._joined().wrap(console, width, **options)
        for line in lines:
            line.plain = line.plain.replace(_JOINED, " ")
        return lines

    def __rich_measure__(
        self, console: rich.console.Console, options: rich.console.ConsoleOptions
    ) -> rich.measure.Measurement:
        return self._joined().__rich_measure__(console, options)

    def _joined(self) -> rich.text.Text:
        text = self.copy()  # of the class of rich
        text.plain = joined(self.plain, _JOINED)
        return text


class Console(rich.console.Console):
    """Console that reads no markup and no emoji in texts, and shows their hidden characters as `Text` does."""

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, markup=False, emoji=False, **options)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print; a table whose words and numbers do not fit side by side is printed row by row, so that none is cut."""
        if len(objects) == 1 and isinstance(objects[0], str | rich.text.Text) and not options:
            # Here, as rich would lay out a text of its own class instead.
            text = self.render_str(objects[0]) if isinstance(objects[0], str) else objects[0]
            for line in text.wrap(self, self.width):
                super().print(line)
            return
        if len(objects) != 1 or not isinstance(objects[0], Table) or not objects[0].show_header:
            super().print(*objects, **options)
            return
        table = copy.copy(objects[0])
        table.columns = [copy.copy(column) for column in table.columns]
        if table.title:
            # As a line of its own: within the table a title is folded to its width.
            super().print(table.title, style="" if isinstance(table.title, rich.text.Text) else "italic")
            table.title = None
        if self._fitted(table):
            super().print(table, **options)
            return
        cells = [list(column.cells) for column in table.columns]
        for row in zip(*cells, strict=True):
            grid = Table.grid(padding=(0, 2, 0, 0))
            grid.add_column(no_wrap=True)
            grid.add_column(overflow="fold")
            for column, cell in zip(table.columns, row, strict=True):
                if str(cell):
                    grid.add_row(self._heading(column.header), cell)
            super().print(grid)
            super().print()

    def _fitted(self, table: Table) -> bool:
        """Give the columns the room that their longest words need, and share the rest; return whether it is enough."""
        room = self.options.update(width=LARGE)
        needs = []
        for column in table.columns:
            need = rich.measure.measure_renderables(self, room, [column.header, *column.cells])
            needs.append((need.maximum if column.no_wrap else need.minimum, need.maximum))
        whole = rich.measure.Measurement.get(self, room, table)
        if whole.maximum <= self.width:
            return True
        left = self.width - whole.maximum + sum(most - least for least, most in needs)
        wanted = sum(most - least for least, most in needs)
        for column, (least, most) in zip(table.columns, needs, strict=True):
            column.width = least + (left * (most - least) // wanted if wanted else 0)
        return left >= 0

    def _heading(self, header: Any) -> rich.text.Text:
        """Return the heading of a column in one line."""
        text = header.plain if isinstance(header, rich.text.Text) else str(header)
        return Text(" ".join(text.split()), "bold")

    def render_str(self, text: str, **options: Any) -> rich.text.Text:
        """Return a string to print, a cell or a heading as text to lay out."""
        shown = super().render_str(printable(text), **options)
        return Text(shown.plain, shown.style, justify=shown.justify, overflow=shown.overflow)


def console(stderr: bool = False) -> Console:
    """Return the console for tables: as wide as the terminal, 160 columns if the output is piped."""
    stream = sys.stderr if stderr else sys.stdout
    on_terminal = stream is not None and stream.isatty()  # None: the caller closed the stream
    return Console(stderr=stderr, width=None if on_terminal or "COLUMNS" in os.environ else 160)


class ProgressLine:
    """A line on standard error that is rewritten, after the time since it began; it is gone at the end."""

    def __init__(self, words: str, total: int | None = None) -> None:
        # The description of the default columns would be read as markup.
        name = TextColumn("{task.description}", style="progress.description", markup=False)
        self._progress = Progress(*self._columns(name), console=console(stderr=True), transient=True)
        self._task = self._progress.add_task(words, total=total)

    def _columns(self, name: ProgressColumn) -> tuple[ProgressColumn, ...]:
        return TimeElapsedColumn(), name

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def show(self, words: str) -> None:
        """Show other words."""
        self._progress.update(self._task, description=printable(words))


class ProgressBar(ProgressLine):
    """A progress bar on standard error, where the name of what was done last stands before the bar."""

    def _columns(self, name: ProgressColumn) -> tuple[ProgressColumn, ...]:
        return name, BarColumn(), TaskProgressColumn(), TimeRemainingColumn()

    def advance(self, name: str) -> None:
        """Count one more, and show its name."""
        self._progress.update(self._task, advance=1, description=printable(name))
