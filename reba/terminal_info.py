"""What `reba info` and `reba profiles` print for people."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from reba.posture import COLUMNS
from reba.terminal import short_columns

if TYPE_CHECKING:
    from reba.readers.info import Info
    from reba.readers.profile import Profile

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
    for label, names in (("found", info.found), ("missing", info.missing), ("also fits", info.alternatives)):
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
    measures = profile.measures()
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
