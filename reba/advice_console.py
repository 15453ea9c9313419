"""Changes in the terminal: those ranked over a recording, and the smallest ones of a frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from rich.table import Table

from reba.analysis.advice import SHOWN, Advice, time_text
from reba.analysis.improve import Improvement
from reba.analysis.wording import both, percent, seconds
from reba.terminal import Console, Text

NUMBERS: Final = {2: "two", 3: "three"}


def show_improvements(console: Console, title: str, improvements: Sequence[Improvement]) -> None:
    """Print the smallest changes for a frame or an interval."""
    console.print(Text(title, style="bold"))
    if not improvements:
        console.print("  at or below this action level already, or no change of measured angles reaches it")
    for improvement in improvements:
        _item(console, f"  {improvement.goal}:", improvement.text())


def show_advice(console: Console, advice: Advice, *, every: bool = False) -> None:
    """Print the changes that take most time out of a level of risk, the first three or `every` one of them."""
    share = both(*(percent(end / (advice.total or 1.0)) for end in advice.seconds))
    console.print(
        Text(
            f"REBA {advice.at_least} or more: {time_text(advice.seconds)} of {seconds(advice.total)} ({share})", "bold"
        )
    )
    if not advice.single and advice.pair is None:
        console.print("no change of a measured angle or a factor takes time out of it")
    for number, action in enumerate(advice.single[: None if every else SHOWN], 1):
        change = action.changes[0]
        _item(console, f"{number}.", f"{change.text}: {advice.effect(action)}")
        _item(console, "", f"{change.control} control; {change.source}", style="dim")
    for together in (advice.pair, advice.triple):
        if together is not None:
            label = f"best {NUMBERS[len(together.changes)]} together:"
            _item(console, label, f"{together.text}: {advice.effect(together)}")
    left = len(advice.single) - SHOWN
    if left > 0 and not every:
        tied = f"; {advice.tied} of them as good as number {SHOWN}" if advice.tied else ""
        console.print(f"{left} more: --all{tied}")


def _item(console: Console, label: str, text: str, style: str = "") -> None:
    """Print a text beside its label; further lines of the text stand below its first."""
    grid = Table.grid(padding=(0, 1, 0, 0))
    grid.add_column(no_wrap=True, min_width=2)
    grid.add_column()
    grid.add_row(Text(label), Text(text, style))
    console.print(grid)
