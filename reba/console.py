"""Tables in the terminal for the results of the commands."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

from reba.analysis.wording import both, percent, span
from reba.analysis.worksheet import Worksheet
from reba.batch.run import RecordingResult
from reba.method.tables import ACTION_LEVEL_FROM, ACTION_LEVELS
from reba.posture.columns import COLUMNS
from reba.readers.info import Info
from reba.readers.mapping import measurable_columns
from reba.readers.recording.profile import Profile
from reba.report.comparison import compared_figures, differing
from reba.report.summary import RecordingSummary
from reba.terminal import Console, Text

WIDE = 120
"""Columns of a terminal from which a table has room for the names of recordings."""
MAX_FAILURES = 20
"""Failures that are listed under the totals of many recordings."""
LEVEL_SCORES = tuple(
    str(low) if low + 1 == after else f"{low}-{after - 1}"
    for low, after in zip(ACTION_LEVEL_FROM, (*ACTION_LEVEL_FROM[1:], 16), strict=True)
)
"""Scores of each action level."""
LEVEL_STYLES = ("green", "green", "yellow", "dark_orange", "red")


def show_results(console: Console, results: Sequence[RecordingResult]) -> None:
    """Print one line per recording, then unmeasured angles, assumptions, warnings and rules."""
    scored = [result.summary for result in results if result.summary is not None]
    if scored:
        names = _names([summary["input"] for summary in scored])
        # The figures need 80 columns: in a narrow terminal a number stands in the table for the name.
        labels = [str(number) for number in range(1, len(scored) + 1)] if console.width < WIDE else names
        for number, summary in enumerate(scored):
            name = f"{names[number]}: "
            label = "" if len(scored) == 1 else f"{number + 1}: {name}" if console.width < WIDE else name
            verdict = summary["verdict"]["text"] if "verdict" in summary else ""  # missing in older datasets
            if label or verdict:
                console.print(Text(f"{label}{verdict}".removesuffix(": "), "bold"))
        if len(scored) == 1:
            console.print(_result_table(f"REBA of {scored[0]['input']}", scored, []))
        else:
            console.print(_result_table("REBA", scored, labels))
        risks = ", ".join(f"{scores} {risk}" for scores, (risk, _) in zip(LEVEL_SCORES, ACTION_LEVELS, strict=True))
        console.print(Text(f"for 1 s: highest score sustained for a second; share of time at REBA {risks} risk"))
        for line in _notes(scored, labels):
            console.print(Text(line))
    for result in results:
        if result.error is not None:
            console.print(Text(f"failed: {result.error}", style="red"))


def _names(inputs: Sequence[str]) -> list[str]:
    """Return the paths of recordings without the folder that is common to all.

    >>> _names(["data/a/1.csv", "data/2.csv"])
    ['a/1.csv', '2.csv']
    >>> _names(["data/1.csv"])
    ['data/1.csv']
    """
    places = [Path(name).absolute() for name in inputs]
    if len(places) == 1:
        return list(inputs)
    common = os.path.commonpath([place.parent for place in places])
    return [str(place.relative_to(common)) for place in places]


def show_totals(console: Console, results: Iterable[RecordingResult]) -> None:
    """Print the time at each action level summed over all recordings, and the first failures."""
    recordings, seconds, undetermined = 0, 0.0, 0.0
    levels = dict.fromkeys((str(level) for level in range(len(ACTION_LEVELS))), 0.0)
    failed: list[str] = []
    for result in results:
        if result.summary is None:
            failed.append(str(result.error))
            continue
        recordings += 1
        seconds += result.summary["seconds"]
        undetermined += result.summary["seconds"] * result.summary["action_level_undetermined"]
        for level, share in result.summary["action_levels"].items():
            levels[level] += result.summary["seconds"] * share
    console.print(f"{recordings} recordings, {seconds / 3600:.1f} h")
    for level, (risk, action) in enumerate(ACTION_LEVELS):
        share = levels[str(level)] / seconds if seconds else 0.0
        console.print(Text(f"{percent(share):>6} of the time at {risk} risk (action {action})", LEVEL_STYLES[level]))
    if undetermined:
        console.print(f"{percent(undetermined / seconds):>6} of the time undetermined: not everything was measured")
    for text in failed[:MAX_FAILURES]:
        console.print(Text(f"failed: {text}", style="red"))
    if len(failed) > MAX_FAILURES:
        console.print(Text(f"failed: {len(failed) - MAX_FAILURES} more", style="red"))


def _result_table(title: str, scored: Sequence[dict[str, Any]], labels: Sequence[str]) -> Table:
    table = Table(
        title=Text(title),
        title_justify="left",
        header_style="bold",
        box=SIMPLE_HEAD,
        padding=0,
        pad_edge=False,
    )
    if labels:
        table.add_column("recording" if len(labels[0]) > 3 else "", overflow="fold")
    for name in ("time\n[s]", "mean", "median", "p90", "for\n1 s", "max"):
        table.add_column(Text(name, keep="\n"), justify="right", no_wrap=True)
    for level, scores in enumerate(LEVEL_SCORES):
        heading = Text(f"REBA\n{scores}", keep="\n")
        table.add_column(heading, justify="right", style=LEVEL_STYLES[level], no_wrap=True)
    open_share = any(summary["action_level_undetermined"] > 0 for summary in scored)
    if open_share:
        table.add_column("open", justify="right", no_wrap=True)
    for number, summary in enumerate(scored):
        label = [Text(labels[number])] if labels else []
        shares = [percent(share) for share in summary["action_levels"].values()]
        shares += [percent(summary["action_level_undetermined"])] if open_share else []
        figures = [_span(summary, key) for key in ("mean", "median", "p90")]
        held = summary["held"]
        # Earlier versions wrote datasets without the high end.
        sustained = _ends(held["reba"], held.get("reba_high", held["reba"]))
        table.add_row(*label, f"{summary['seconds']:.1f}", *figures, sustained, _span(summary, "max"), *shares)
    return table


def _span(summary: dict[str, Any], key: str) -> str:
    return _ends(summary["range"][f"{key}_low"], summary["range"][f"{key}_high"], 1 if key == "mean" else 0)


def _ends(low: float | None, high: float | None, digits: int = 0) -> str:
    if low is None or high is None:
        return "-"
    first, second = f"{low:.{digits}f}", f"{high:.{digits}f}"
    return first if first == second else f"{first}-{second}"


def _notes(scored: Sequence[dict[str, Any]], labels: Sequence[str]) -> list[str]:
    """Return unmeasured angles, assumptions, warnings and rules; a note that applies to all recordings stands once."""
    lines: dict[str, list[str]] = {}
    for label, summary in zip(labels, scored, strict=True):
        notes = []
        if summary["unmeasured"]:
            notes.append(
                f"not measured: {', '.join(short_columns(summary['unmeasured']))} (ranges cover every possible value)"
            )
        if summary["assumed"]:
            notes.append(f"assumed: {'; '.join(summary['assumed'])}")
        notes += [f"note: {text}" for text in summary["warnings"]]
        notes += _with_error(summary)
        notes.append(f"rules: {summary['rules']['name']}; profile: {summary['profile']}")
        for note in notes:
            lines.setdefault(note, []).append(label)
    return [note if len(of) == len(scored) else f"{', '.join(of)}: {note}" for note, of in lines.items()]


def _with_error(summary: dict[str, Any]) -> list[str]:
    """Return what the measurement error implies, as one line; none without one."""
    if "distribution" not in summary:
        return []
    expected = summary["distribution"]
    reached = {level: both(percent(ends["low"]), percent(ends["high"])) for level, ends in expected["at_least"].items()}
    mean = span(expected["mean_low"], expected["mean_high"], 1)
    approximate = f"; approximate: {expected['approximate']}" if expected["approximate"] else ""
    return [
        f"with measurement error ({expected['error']['name']}): mean {mean}; probability of medium risk or above "
        f"{reached['2']}, of high risk or above {reached['3']}; the 95 % range of a frame is "
        f"{expected['mean_width']:.1f} points wide on average{approximate}"
    ]


def short_columns(columns: Sequence[str]) -> list[str]:
    """Return column names, one name for a pair of left and right.

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
    """Print the worksheet of one frame, its result first."""
    known = {**sheet.scores, **sheet.tables}
    s = {name: "-".join(dict.fromkeys(map(str, ends))) for name, ends in sheet.ranges.items()}
    s |= {name: str(value) for name, value in known.items() if value is not None}
    if sheet.scores["reba"] is None:
        total = f"REBA {s['reba_low']} to {s['reba_high']} at {sheet.time:.2f} s: not everything was measured"
    else:
        total = f"REBA {s['reba']} at {sheet.time:.2f} s: {sheet.risk} risk, action {sheet.action}"
    console.print(Text(total, style="bold"))
    table = Table(title="REBA worksheet", title_justify="left", header_style="bold")
    for name in ("part", "points", "quantity", "value", "rule"):
        table.add_column(name, justify="right" if name == "points" else "left")
    shown = ""
    for line in sheet.lines:
        part = "" if line.part == shown else line.part.replace("_", " ")
        if part and shown:
            table.add_section()
        shown = line.part
        points = f"{line.points:+d}" if line.possible is None else "{}-{}".format(*line.possible)
        table.add_row(part, points, line.what, line.value, line.rule)
    console.print(table)
    console.print(
        f"Table A (trunk {s['trunk']}, neck {s['neck']}, legs {s['legs']}): {s['table_a']} + load and force "
        f"{s['load_force']} = Score A {s['score_a']}"
    )
    for side in ("left", "right"):
        upper, lower, wrist, coupling, score_b = (
            s[f"{name}_{side}"] for name in ("upper_arm", "lower_arm", "wrist", "coupling", "score_b")
        )
        console.print(
            f"{side}: Table B (upper arm {upper}, lower arm {lower}, wrist {wrist}): {s[f'table_b_{side}']} + "
            f"coupling {coupling} = Score B {score_b}; Table C (A {s['score_a']}, B {score_b}): {s[f'table_c_{side}']} "
            f"+ activity {s['activity']} = REBA {s[f'reba_{side}']}"
        )
    if sheet.distribution:
        console.print(Text(f"with measurement error ({sheet.error}): {_chances(sheet.distribution)}"))
    console.print(f"rules: {sheet.rules}")


def _chances(implied: dict[str, float | None]) -> str:
    """Return the distribution of one frame as text."""
    likely = implied["reba_likely"]
    first = "most likely score undetermined" if likely is None else f"most likely {likely:g}"
    reached = [
        both(*(percent(implied[f"p_level_{level}_{end}"] or 0.0) for end in ("low", "high"))) + f" {risk} risk or above"
        for level, risk in ((2, "medium"), (3, "high"))
    ]
    likely_range = span(implied["reba_95_low"], implied["reba_95_high"])
    return "; ".join([f"{first}, with a probability of 95 % {likely_range}", *reached])


def show_comparison(console: Console, a: RecordingSummary, b: RecordingSummary, names: tuple[str, str]) -> None:
    """Print two recordings side by side."""
    for letter, name, one in zip("AB", names, (a, b), strict=True):
        console.print(Text(f"{letter}: {name}: {one.summary['verdict']['text']}"))
    table = Table(title="REBA, side by side", title_justify="left", header_style="bold")
    for name in ("", "A", "B", "difference"):
        table.add_column(name, justify="right" if name else "left", overflow="fold")
    for row in compared_figures(a, b):
        table.add_row(row.name, row.first, row.second, row.change)
    console.print(table)
    for text in differing(a, b):
        console.print(Text(text))


MAX_NAMES = 12
"""Names and gaps that a line lists; of more, their number is printed."""
MAX_TOPICS = 500
"""Topics that the table lists, those that can be read first; `--json` has all."""


def show_info(console: Console, info: Info) -> None:
    """Print the contents of a recording, the recognised profile with the reason, and the angles that REBA can use."""
    console.print(Text(f"{info.input} ({info.format})", style="bold"))
    if info.topics:
        table = Table(header_style="bold")
        for name in ("topic", "type", "count", "used for"):
            table.add_column(name, justify="right" if name == "count" else "left", overflow="fold")
        listed = list(info.topics)
        if len(listed) > MAX_TOPICS:
            listed = sorted(listed, key=lambda topic: not topic["usable"])[:MAX_TOPICS]
        for topic in listed:
            count = "?" if topic["count"] is None else str(topic["count"])
            style = "" if topic["usable"] else "dim"
            table.add_row(
                *(Text(str(cell)) for cell in (topic["name"], topic["type"], count, topic["why"])), style=style
            )
        console.print(table)
        if more := len(info.topics) - len(listed):
            console.print(f"and {more} more topics (--json lists all)")
    for label, text in _lines(info):
        console.print(Text.assemble((f"{label}: ", "bold"), text))
    if info.usable:
        console.print(_columns(info))
        console.print("Next: reba score FILE (give factors such as --load)")


def _lines(info: Info) -> list[tuple[str, str]]:
    lines = []
    if info.ended_abnormally:
        lines.append(("ends abnormally", info.ended_abnormally))
    lines.append(("recognised" if info.usable else "not usable", info.recognised))
    if info.usable:
        lines.append(("profile", f"{info.profile} ({info.title})" if info.title else info.profile))
        rate = "?" if info.rate != info.rate else f"{info.rate:g}"
        clock = f"{info.time_source} ({info.time_why})" if info.time_why else info.time_source
        lines.append(("time", f"{info.frames} frames, {info.seconds:.2f} s at {rate} Hz, from {clock}"))
        gaps = ", ".join(f"{start:.2f}-{end:.2f} s" for start, end in info.gaps[:MAX_NAMES])
        lines.append(("gaps", f"{len(info.gaps)}: {gaps}" if info.gaps else "none"))
    for account in info.accounts:
        unused = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in account["not_used"].items())
        seconds = account["seconds"]
        lines.append(
            (
                f"account of {account['stream']}",
                f"{account['used']} of {account['read']} messages used{', not used: ' if unused else ''}{unused}; "
                f"{seconds['used']:.2f} of {seconds['read']:.2f} s",
            )
        )
    if info.skipped:
        lines.append(("skipped", f"{info.skipped} of {info.messages} messages, the first: {info.first_skipped}"))
    for label, names in (("found", info.present), ("missing", info.missing), ("also fits", info.alternatives)):
        if names:
            more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
            lines.append((label, ", ".join(names[:MAX_NAMES]) + more))
    lines += [("assumed", text) for text in info.assumed]
    lines += [("warning", text) for text in info.warnings]
    return lines


def _columns(info: Info) -> Table:
    table = Table(header_style="bold", title="Angles for REBA [deg]", title_justify="left")
    for name in ("angle", "lowest", "median", "highest"):
        table.add_column(name, justify="left" if name == "angle" else "right", overflow="fold")
    if info.unmeasured:
        table.add_column("not measured", overflow="fold")
    for name in COLUMNS:
        if name in info.ranges:
            table.add_row(name, *(f"{value:z.1f}" for value in info.ranges[name]))
        else:
            table.add_row(name, "", "", "", Text(info.unmeasured.get(name, "absent")), style="dim")
    return table


def describe_profile(profile: Profile) -> dict[str, Any]:
    """Return a profile as plain data: source, measured columns, which need a neutral posture, why not the others."""
    measures = measurable_columns(profile)
    return {
        "name": profile.name,
        "title": profile.title,
        "kind": profile.kind,
        "formats": list(profile.formats),
        "source": profile.source,
        "measures": list(measures),
        "needs_neutral": [name for name in profile.needs_neutral if name in measures],
        "cannot": {name: profile.cannot.get(name, "no such signal") for name in COLUMNS if name not in measures},
    }


def show_profiles(console: Console, profiles: list[dict[str, Any]]) -> None:
    """Print the known sources with the angles each cannot measure."""
    table = Table(header_style="bold", show_lines=True)
    for name in ("profile", "source", "from", "cannot measure"):
        table.add_column(name, overflow="fold")
    for profile in profiles:
        reasons: dict[str, list[str]] = {}
        for column, why in [
            *profile["cannot"].items(),
            *((column, "only with --neutral") for column in profile["needs_neutral"]),
        ]:
            reasons.setdefault(why, []).append(column)
        cannot = "; ".join(f"{', '.join(short_columns(columns))}: {why}" for why, columns in reasons.items())
        origin = f"{profile['kind']} in {', '.join(profile['formats'])}" if profile["formats"] else profile["kind"]
        table.add_row(profile["name"], Text(profile["title"]), origin, Text(cannot or "all angles are measured"))
    console.print(table)
    console.print("For other names: reba profiles NAME > mylab.toml, edit it, and use it with --profile mylab.toml")
