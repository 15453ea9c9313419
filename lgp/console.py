"""Terminal tables of the `lgp` commands."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.table import Table

from lgp.logic.task import numbered
from lgp.search.records import SearchProgress
from reba.method.tables import ACTION_LEVELS, LEVEL_OF
from reba.terminal import Console, ProgressLine, Text


@contextmanager
def shown_progress() -> Iterator[Callable[[SearchProgress], None] | None]:
    """Give a function that shows the progress of a search in one line on a terminal; elsewhere None."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield None
        return
    with ProgressLine("planning") as line:
        yield lambda progress: line.show(progress_text(progress))


def progress_text(progress: SearchProgress) -> str:
    """Return the progress of a search as one line.

    >>> progress_text(SearchProgress("searching", 77, 1, 11.274, 2.15))
    'searching: 77 sequences, 1 path; cost 11.27, bound 2.15, gap 81 %'
    >>> progress_text(SearchProgress("searching", 1, 0, float("inf"), 0.0))
    'searching: 1 sequence, 0 paths; no plan yet'
    """
    counts = f"{progress.step}: {_number(progress.sequences, 'sequence')}, {_number(progress.paths, 'path')}; "
    if math.isinf(progress.cost):
        return counts + "no plan yet"
    return counts + f"cost {progress.cost:.2f}, bound {progress.bound:.2f}, gap {100 * progress.gap:.0f} %"


def _number(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"


def show_plan(console: Console, summary: dict[str, Any]) -> None:
    """Print a plan: its result, actions with the mean REBA score of each phase, costs, residuals, search statistics."""
    if not summary["actions"]:
        console.print(f"{summary['scene']}: the goal holds already; no action is needed")
        show_audit(console, summary["audit"])
        return
    people, durations = summary["reba"]["people"], summary["durations"]
    audit = summary["audit"]
    faults = _counted(len(audit["faults"]), "fault")
    result = [f"{_counted(len(summary['actions']), 'action')} in {sum(durations):.1f} s"]
    for name, own in people.items():
        whose = f" of {name}" if len(people) > 1 else ""
        risk = ACTION_LEVELS[LEVEL_OF[own["max"]]][0]
        result.append(f"REBA{whose} at most {own['max']} ({risk} risk), {own['mean']:.2f} on average")
    result.append("the audit found no faults" if not audit["faults"] else f"the audit found {faults}")
    console.print(Text(f"{summary['scene']}: {'; '.join(result)}"))
    table = Table(title=f"Plan for {summary['scene']}", title_justify="left", header_style="bold")
    table.add_column("action")
    for name in people:
        table.add_column(Text(f"mean REBA {name if len(people) > 1 else ''}".rstrip()), justify="right")
    differ = max(durations) - min(durations) > 1e-6
    if differ:
        table.add_column("seconds", justify="right")
    scores = [one["per_phase"] for one in people.values()]
    phase = -1
    for action, (_, together) in zip(summary["actions"], numbered(summary["actions"]), strict=True):
        phase += not together
        own = [f"{durations[phase]:.2f}"] if differ else []
        table.add_row(Text(action), *(f"{score[phase]:.1f}" for score in scores), *own)
    console.print(table)
    cost, residuals, search = summary["cost"], summary["residuals"], summary["search"]
    satisfied = f"satisfied within {residuals['metres']:.1e} m and {residuals['radians']:.1e} rad"
    console.print(
        f"cost {cost['total']:.3f}: acceleration {cost['acceleration']:.3f}, ergonomics {cost['ergonomics']:.3f}, "
        f"time {cost['time']:.3f}{_others(cost)}; "
        + ("the constraints of the planner are " if audit["faults"] else "constraints are ")
        + satisfied
    )
    show_audit(console, audit)
    if residuals.get("start_penetration"):
        console.print(f"accepted: at the start two bodies are {residuals['start_penetration']:.3f} m in each other")
    best = {
        "optimal": "no other sequence within the depth was found to cost less",
        "given": "no other sequence was planned",
        "concurrent": "no other plan with concurrent actions was made",
    }.get(summary["status"], f"the optimum within the depth may cost up to {100 * search['gap']:.1f} % less")
    console.print(
        f"search: {', '.join(_counted(search[f'{name}s'], name) for name in ('pose', 'sequence', 'path'))} in "
        f"{search['seconds']:.1f} s; {best}"
    )
    if summary["concurrent"]:
        console.print(Text(_concurrent(summary["concurrent"])))
    starts = summary["starts"]
    if starts and starts["of"] > 1:
        agree = f"of which {starts['agreed']} {'agrees' if starts['agreed'] == 1 else 'agree'} within 1 %"
        console.print(f"motion: from the best of {starts['of']} starts of its keyframes, {agree}")


def _concurrent(concurrent: dict[str, Any]) -> str:
    """Return costs and times of the same actions one at a time and at the same time, and why one is not kept."""
    one, other = (concurrent[name] for name in ("one_at_a_time", "at_the_same_time"))
    compared = [f"one at a time cost {one['cost']:.3f} in {one['seconds']:.1f} s"]
    compared += [] if other is None else [f"at the same time {other['cost']:.3f} in {other['seconds']:.1f} s"]
    why = concurrent["reason"] and f"{'not all at once' if concurrent['kept'] else 'not kept'}: {concurrent['reason']}"
    return "concurrent actions: " + "; ".join([", ".join(compared), *([why] if why else [])])


def _others(cost: dict[str, float]) -> str:
    """Return what a cost has beside that of every plan: terms of one's own, costs of actions."""
    names = {"terms": "own terms", "actions": "actions"}
    return "".join(f", {name} {cost[key]:.3f}" for key, name in names.items() if cost.get(key))


def show_audit(console: Console, audit: dict[str, Any]) -> None:
    """Print what the audit of a plan found: nothing, or the deepest pair of each class and every other fault."""
    hands, speed, samples = audit["hands"], audit["speed"], audit["samples"]
    measures = [] if hands is None else [f"hands {1000 * hands:.1f} mm apart"]
    measures += [] if speed is None else [f"at most {100 * speed:.0f} % of joint speed limits"]
    looked = f"in {samples} samples" if samples > 1 else "at the start"
    result = "nothing deeper than 1 mm" if audit["clean"] else _counted(len(audit["faults"]), "fault")
    console.print(Text(", ".join([f"audit: {result} {looked}", *measures])))
    for one in audit["deepest"]:
        if one["depth"] > audit["touching"]:
            first, second = one["pair"]
            depth, time = 1000 * one["depth"], one["time"]
            more = f", and {one['pairs'] - 1} more" if one["pairs"] > 1 else ""
            console.print(Text(f"  {one['class']}: {first} is {depth:.1f} mm in {second} at {time:.2f} s{more}"))
    for fault in audit["faults"]:
        if fault["kind"] != "contact":
            console.print(Text(f"  {fault['what']} at {fault['time']:.2f} s"))
    for what in audit["unaudited"]:
        console.print(Text(f"  not judged: {what}"))


def _counted(number: int, name: str) -> str:
    return f"{number} {name}" if number == 1 else f"{number} {name}s"


def show_toolbox(console: Console, summary: dict[str, Any]) -> None:
    """Print both sequences of the toolbox experiment beside the paper's, the cost of each order and REBA scores."""
    for name, one in summary["conditions"].items():
        table = Table(title=f"{name}: {one['order']}", title_justify="left", header_style="bold")
        table.add_column("ours")
        table.add_column("the paper's")
        for ours, theirs in zip(one["actions"], one["published_actions"], strict=False):
            table.add_row(Text(ours.replace("toolbox/", "")), Text(theirs.replace("toolbox/", "")))
        console.print(table)
        for order, cost in one["orders"].items():
            kinds = (key for key in cost if key.startswith("acceleration of") or key in ("posture", "load"))
            console.print(
                f"  {order}: cost {cost['total']:.3f} (" + ", ".join(f"{k} {cost[k]:.3f}" for k in kinds) + ")"
            )
        mass = one["first_part"]["mass_for_place_first"]
        if mass is not None:
            first = one["first_part"]
            console.print(
                f"  placing {first['name']} first costs less from {mass:.2f} kg on; its mass is {first['mass']:.2f} kg"
            )
        parts = ", ".join(f"{part} {value:.2f}" for part, value in one["parts"].items())
        console.print(f"  true REBA: mean {one['reba']['mean']:.2f}, highest {one['reba']['max']:.0f}; {parts}")
