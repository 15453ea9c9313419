"""What commands print for people: tables in the terminal, nothing computed here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from reba.analysis.improve import Improvement
from reba.analysis.worksheet import Worksheet
from reba.batch.run import RecordingResult
from reba.method.tables import ACTION_LEVELS
from reba.posture.columns import COLUMNS
from reba.readers.info import Info
from reba.readers.mapping import measurable_columns
from reba.readers.recording.profile import Profile

WIDE = 120
"""Characters from which the names of recordings fit beside their figures."""
FIRST_FAILED = 20
"""Failures that are listed where recordings are not."""
LEVEL_STYLES = ("green", "green", "yellow", "dark_orange", "red")


def show_outcomes(console: Console, outcomes: Sequence[RecordingResult]) -> None:
    """Print one line a recording, then what every reader of the numbers must know."""
    scored = [outcome.summary for outcome in outcomes if outcome.summary is not None]
    if scored:
        # The figures need 80 characters: in a narrow terminal names stand above the table, numbered if they are many.
        if len(scored) == 1:
            console.print(_outcome_table(f"REBA of {scored[0]['input']}", scored, []))
        elif console.width < WIDE:
            for number, summary in enumerate(scored, 1):
                console.print(Text(f"{number}: {summary['input']}"))
            console.print(_outcome_table("REBA", scored, [str(number + 1) for number in range(len(scored))]))
        else:
            console.print(_outcome_table("REBA", scored, [summary["input"] for summary in scored]))
    for line in _notes(scored):
        console.print(Text(line))
    for outcome in outcomes:
        if outcome.error is not None:
            console.print(Text(f"failed: {outcome.error}", style="red"))


def show_totals(console: Console, outcomes: Iterable[RecordingResult]) -> None:
    """Print many recordings as one: time at each action level over all of them, and the first that failed."""
    recordings, seconds, undetermined = 0, 0.0, 0.0
    levels = dict.fromkeys((str(level) for level in range(len(ACTION_LEVELS))), 0.0)
    failed: list[str] = []
    for outcome in outcomes:
        if outcome.summary is None:
            failed.append(str(outcome.error))
            continue
        recordings += 1
        seconds += outcome.summary["seconds"]
        undetermined += outcome.summary["seconds"] * outcome.summary["action_level_undetermined"]
        for level, share in outcome.summary["action_levels"].items():
            levels[level] += outcome.summary["seconds"] * share
    console.print(f"{recordings} recordings, {seconds / 3600:.1f} h")
    for level, (risk, action) in enumerate(ACTION_LEVELS):
        share = levels[str(level)] / seconds if seconds else 0.0
        console.print(Text(f"{_percent(share):>5} of the time at {risk} risk (action {action})", LEVEL_STYLES[level]))
    if undetermined:
        console.print(f"{_percent(undetermined / seconds):>5} of the time undetermined: not everything was measured")
    for text in failed[:FIRST_FAILED]:
        console.print(Text(f"failed: {text}", style="red"))
    if len(failed) > FIRST_FAILED:
        console.print(Text(f"failed: {len(failed) - FIRST_FAILED} more", style="red"))


def _outcome_table(title: str, scored: Sequence[dict[str, Any]], labels: Sequence[str]) -> Table:
    table = Table(
        title=Text(title),
        title_justify="left",
        header_style="bold",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    if labels:
        table.add_column("recording" if len(labels[0]) > 3 else "", overflow="fold")
    for name in ("time\n[s]", "mean", "med-\nian", "p90", "held\n1 s", "max"):
        table.add_column(name, justify="right", no_wrap=True)
    for level, (risk, _) in enumerate(ACTION_LEVELS):
        heading = risk.replace(" ", "\n").replace("negligible", "negli-\ngible").replace("medium", "me-\ndium")
        table.add_column(heading, justify="right", style=LEVEL_STYLES[level], no_wrap=True)
    open_share = any(summary["action_level_undetermined"] > 0 for summary in scored)
    if open_share:
        table.add_column("open", justify="right", no_wrap=True)
    for number, summary in enumerate(scored):
        label = [Text(labels[number])] if labels else []
        shares = [_percent(share) for share in summary["action_levels"].values()]
        shares += [_percent(summary["action_level_undetermined"])] if open_share else []
        figures = [_span(summary, key) for key in ("mean", "median", "p90")]
        low = summary["held"]["reba"]
        held = "-" if low is None else str(low) if _known(summary) else f"{low}+"
        table.add_row(*label, f"{summary['seconds']:.1f}", *figures, held, _span(summary, "max"), *shares)
    return table


def _known(summary: dict[str, Any]) -> bool:
    ends = summary["range"]
    return all(ends[f"{key}_low"] == ends[f"{key}_high"] for key in ("mean", "median", "p90", "max"))


def _span(summary: dict[str, Any], key: str) -> str:
    low, high = summary["range"][f"{key}_low"], summary["range"][f"{key}_high"]
    if low is None:
        return "-"
    words = (f"{low:.1f}", f"{high:.1f}") if key == "mean" else (str(low), str(high))
    return words[0] if words[0] == words[1] else f"{words[0]}-{words[1]}"


def _percent(share: float) -> str:
    return f"{share * 100:.0f}%" if share >= 0.005 or share == 0 else "<1%"


def _notes(scored: Iterable[dict[str, Any]]) -> list[str]:
    """Return what was not measured, assumed and noticed; said once where it holds for every recording."""
    summaries = list(scored)
    lines: dict[str, list[str]] = {}
    for summary in summaries:
        notes = []
        if summary["unmeasured"]:
            notes.append(
                f"not measured: {', '.join(short_columns(summary['unmeasured']))} (ranges hold every possibility)"
            )
        if summary["assumed"]:
            notes.append(f"assumed: {'; '.join(summary['assumed'])}")
        notes += [f"note: {text}" for text in summary["warnings"]]
        notes.append(f"rules: {summary['rules']['name']}; profile: {summary['profile']}")
        for note in notes:
            lines.setdefault(note, []).append(summary["input"])
    return [note if len(inputs) == len(summaries) else f"{', '.join(inputs)}: {note}" for note, inputs in lines.items()]


def short_columns(columns: Sequence[str]) -> list[str]:
    """Return column names with both sides of a pair written as one.

    >>> short_columns(["wrist_flexion_left", "wrist_flexion_right", "neck_twist"])
    ['wrist_flexion', 'neck_twist']
    """
    names: dict[str, None] = {}
    for column in columns:
        base, _, side = column.rpartition("_")
        other = {"left": "right", "right": "left"}.get(side)
        names[base if other and f"{base}_{other}" in columns else column] = None
    return list(names)


def show_worksheet(console: Console, sheet: Worksheet) -> None:
    """Print the worksheet of one frame."""
    table = Table(title=f"REBA worksheet at {sheet.time:.2f} s", title_justify="left", header_style="bold")
    for name in ("part", "points", "what", "value", "rule"):
        table.add_column(name, justify="right" if name == "points" else "left")
    shown = ""
    for line in sheet.lines:
        part = "" if line.part == shown else line.part.replace("_", " ")
        if part and shown:
            table.add_section()
        shown = line.part
        table.add_row(part, "?" if line.points is None else f"{line.points:+d}", line.what, line.value, line.rule)
    console.print(table)
    s = {name: "?" if value is None else str(value) for name, value in sheet.scores.items()}
    for side in ("left", "right"):
        console.print(
            f"{side}: Score A {s['score_a']} (Table A + load {s['load_force']}), "
            f"Score B {s[f'score_b_{side}']} (Table B + coupling {s[f'coupling_{side}']}), "
            f"Table C + activity {s['activity']} = {s[f'reba_{side}']}"
        )
    if sheet.scores["reba"] is None:
        total = f"REBA {s['reba_low']} to {s['reba_high']}: not everything was measured"
    else:
        total = f"REBA {s['reba']}: {sheet.risk} risk, action {sheet.action}"
    console.print(Text(total, style="bold"))
    console.print(f"rules: {sheet.rules}")


def show_improvements(console: Console, title: str, found: Sequence[Improvement]) -> None:
    """Print the smallest changes for a frame or a stretch."""
    console.print(Text(title, style="bold"))
    if not found:
        console.print("  at or below this action level already, or no change of what was measured reaches it")
    for improvement in found:
        console.print(Text(f"  {improvement.goal}: {improvement.text()}"))


def show_comparison(console: Console, result: dict[str, Any]) -> None:
    """Print two recordings side by side."""
    a, b = result["a"], result["b"]
    table = Table(title="REBA, side by side", title_justify="left", header_style="bold")
    for name in ("", str(a["input"]), str(b["input"]), "change"):
        table.add_column(Text(name), justify="left" if not name else "right", overflow="fold")
    for key in ("mean", "median", "p90", "max"):
        low, high = result["difference"]["range"][f"{key}_low"], result["difference"]["range"][f"{key}_high"]
        table.add_row(key, _span(a, key), _span(b, key), _change(low, high))
    for level, (risk, _) in enumerate(ACTION_LEVELS):
        shares = (a["action_levels"][str(level)], b["action_levels"][str(level)])
        table.add_row(
            f"time at {risk}", _percent(shares[0]), _percent(shares[1]), f"{(shares[1] - shares[0]) * 100:+.0f} %"
        )
    for part, change in result["difference"]["parts"].items():
        means = (a["parts"][part]["mean"], b["parts"][part]["mean"])
        if any(mean is not None for mean in means):
            words = ["open" if mean is None else f"{mean:.2f}" for mean in means]
            table.add_row(part.replace("_", " "), *words, "" if change is None else f"{change:+.2f}")
    console.print(table)
    for side in ("a", "b"):
        columns = result[f"only_{side}_unmeasured"]
        if columns:
            name = result[side]["input"]
            console.print(Text(f"only {name} lacks: {', '.join(short_columns(columns))}; compare the ranges with care"))


def _change(low: float | None, high: float | None) -> str:
    if low is None or high is None:
        return ""
    words = (f"{low:+.1f}", f"{high:+.1f}")
    return words[0] if words[0] == words[1] else f"{words[0]} / {words[1]}"


MOST_NAMES = 12


def show_info(console: Console, info: Info) -> None:
    """Print what a recording holds, what was recognised and why, and what REBA can get from it."""
    console.print(Text(f"{info.input} ({info.format})", style="bold"))
    if info.topics:
        table = Table(header_style="bold")
        for name in ("topic", "type", "count", "used for"):
            table.add_column(name, justify="right" if name == "count" else "left", overflow="fold")
        for topic in info.topics:
            count = "?" if topic["count"] is None else str(topic["count"])
            style = "" if topic["usable"] else "dim"
            table.add_row(
                *(Text(str(cell)) for cell in (topic["name"], topic["type"], count, topic["why"])), style=style
            )
        console.print(table)
    for label, text in _lines(info):
        console.print(Text.assemble((f"{label}: ", "bold"), text))
    if info.usable:
        console.print(_columns(info))
        console.print("Next: reba score FILE (factors such as --load are yours to give)")


def _lines(info: Info) -> list[tuple[str, str]]:
    lines = []
    if info.ended_abnormally:
        lines.append(("ends abnormally", info.ended_abnormally))
    lines.append(("recognised" if info.usable else "not usable", info.recognised))
    if info.usable:
        lines.append(("profile", f"{info.profile} ({info.title})" if info.title else info.profile))
        rate = "?" if info.rate != info.rate else f"{info.rate:g}"
        lines.append(("time", f"{info.frames} frames, {info.seconds:.2f} s at {rate} Hz, from {info.time_source}"))
        gaps = ", ".join(f"{start:.2f}-{end:.2f} s" for start, end in info.gaps[:MOST_NAMES])
        lines.append(("gaps", f"{len(info.gaps)}: {gaps}" if info.gaps else "none"))
    if info.skipped:
        lines.append(("skipped", f"{info.skipped} of {info.messages} messages, the first: {info.first_skipped}"))
    for label, names in (("found", info.present), ("missing", info.missing), ("also fits", info.alternatives)):
        if names:
            more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
            lines.append((label, ", ".join(names[:MOST_NAMES]) + more))
    lines += [("assumed", text) for text in info.assumed]
    lines += [("warning", text) for text in info.warnings]
    return lines


def _columns(info: Info) -> Table:
    table = Table(header_style="bold", title="What REBA gets [deg]", title_justify="left")
    for name in ("angle", "lowest", "median", "highest", ""):
        table.add_column(name, justify="left" if name in ("angle", "") else "right", overflow="fold")
    for name in COLUMNS:
        if name in info.ranges:
            table.add_row(name, *(f"{value:.1f}" for value in info.ranges[name]), "")
        else:
            table.add_row(name, "", "", "", Text(f"not measured: {info.unmeasured.get(name, 'absent')}"), style="dim")
    return table


def describe_profile(profile: Profile) -> dict[str, Any]:
    """Return a profile as plain data: what it is for, what it measures and what it cannot measure and why."""
    measures = measurable_columns(profile)
    return {
        "name": profile.name,
        "title": profile.title,
        "kind": profile.kind,
        "formats": list(profile.formats),
        "source": profile.source,
        "measures": list(measures),
        "cannot": {name: profile.cannot.get(name, "no such signal") for name in COLUMNS if name not in measures},
    }


def show_profiles(console: Console, profiles: list[dict[str, Any]]) -> None:
    """Print the known sources."""
    table = Table(header_style="bold", show_lines=True)
    for name in ("profile", "source", "from", "cannot measure"):
        table.add_column(name, overflow="fold")
    for profile in profiles:
        reasons: dict[str, list[str]] = {}
        for column, why in profile["cannot"].items():
            reasons.setdefault(why, []).append(column)
        cannot = "; ".join(f"{', '.join(short_columns(columns))}: {why}" for why, columns in reasons.items())
        origin = f"{profile['kind']} in {', '.join(profile['formats'])}" if profile["formats"] else profile["kind"]
        table.add_row(profile["name"], Text(profile["title"]), origin, Text(cannot or "nothing is missing"))
    console.print(table)
    console.print("Your own names: reba profiles NAME > mylab.toml, change it, and give it with --profile mylab.toml")
