"""What `lgp study` prints for people: nothing is computed here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from lgp.experiments.page import number, p_value
from lgp.study.measures import PARTS, TOTAL


def show_study(console: Console, found: Mapping[str, Any]) -> None:
    """Print the decision, means and tests of the total and of the parts, and what is missing."""
    console.print(Text(("SIMULATED DATA. " if found["simulated"] else "") + found["verdict"], style="bold"))
    conditions = found["conditions"]
    table = Table(header_style="bold")
    for name in ("mean score", *conditions, "first - second", "95 % interval", "p (t)", "p (ranks)", "g"):
        table.add_column(Text(name), justify="left" if name == "mean score" else "right")
    rows = [("REBA", found[TOTAL]), *((PARTS[name], one) for name, one in found["parts"].items())]
    for title, one in rows:
        means = [_mean(one["conditions"][name]) for name in conditions]
        tests = [_test(pair, len(conditions) > 2) for pair in one["pairs"]] or [[""] * 5]
        tests = [["no difference", "", "", "", ""]] if one.get("constant") else tests
        for place, test in enumerate(tests):
            first = [title, *means] if not place else [""] * (len(means) + 1)
            table.add_row(*map(Text, [*first, *test]))
    console.print(table)
    if len(conditions) > 1:
        console.print("± standard error between people; p after Holm; g: Hedges' g of paired differences")
    for gap in found["missing"]:
        console.print(f"missing: {gap['participant']}, {gap['condition']}: {gap['why']}")
    for said in found["warnings"]:
        console.print(f"note: {said}")


def _mean(one: Mapping[str, Any]) -> str:
    return f"{number(one['mean'])} ± {number(one['se'])}" if one["n"] else "no recording"


def _test(pair: Mapping[str, Any], named: bool) -> list[str]:
    interval = f"{number(pair['low'])} to {number(pair['high'])}"
    values = (p_value(pair["p_holm"]), p_value(pair["wilcoxon_p_holm"]), number(pair["g"]))
    names = f"{pair['first']} - {pair['second']}: " if named else ""
    return [names + number(pair["difference"]), interval, *values]
