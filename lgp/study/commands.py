"""The commands `lgp study` and `lgp simulate-study`: parse, call, print."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table
from rich.text import Text

from lgp.errors import LgpError
from lgp.statistics.formatting import number, p_value
from lgp.study.scoring import PARTS, TOTAL
from reba.cli import options_of, scoring_options
from reba.command_line import Stop, command_line, console, json_option, print_json


@click.command(
    epilog="Example: lgp study logs/ --manifest who.csv --conditions ergonomic,non-ergonomic -o results/",
    context_settings={"default_map": {"missing": "neutral"}},
)
@click.argument("logs", nargs=-1, metavar="[LOG]...")
@click.option("--manifest", metavar="FILE.csv", help="Table of file, participant, condition and, if several, trial.")
@click.option("--pattern", metavar="TEXT", help="Labels in file names: {participant}_{condition}_{trial}.")
@click.option("--conditions", metavar="A,B,...", help="Their order, and which count; differences are A minus B.")
@click.option("-o", "--output", metavar="DIR", help="Write summary.json, scores.parquet and report.html there.")
@click.option("--report", metavar="FILE.html", help="Write the HTML report to this file.")
@scoring_options
@json_option
def study(
    logs: tuple[str, ...],
    manifest: str | None,
    pattern: str | None,
    conditions: str | None,
    output: str | None,
    report: str | None,
    as_json: bool,
    **given: Any,
) -> None:
    """Score recordings of participants in several conditions, and compare the conditions.

    LOGs are files or folders; each holds a metadata record `study` with participant and condition, unless --manifest or
    --pattern names them. Angles that no recording holds count as neutral unless --missing says otherwise.
    """
    from lgp.study.study import study as make
    from reba.batch.run import check_report

    check_report(report, logs)
    if output is not None and Path(output).is_file():
        raise LgpError(f"{output}: this is a file; give a folder for the results")
    wanted = [name.strip() for name in (conditions or "").split(",") if name.strip()]
    found = make(
        logs, manifest=manifest, pattern=pattern, conditions=wanted, options=options_of(given), without=output
    )  # fmt: skip
    if output is not None:
        found.save(output, command_line("lgp"))
    if report is not None:
        found.write_report(report, command_line("lgp"))
    if as_json:
        print_json({**found.summary, "output": output, "report": report})
    else:
        show_study(console(), found.summary)
    for failure in found.summary["failed"]:
        click.echo(f"lgp: {failure['error']}", err=True)
    if found.summary["failed"]:
        raise Stop(1)


@click.command(epilog="Example: lgp simulate-study ergonomic=plan_a non-ergonomic=plan_b -o logs/; lgp study logs/")
@click.argument("plans", nargs=-1, required=True, metavar="CONDITION=PLAN_DIR...")
@click.option("-n", "--participants", default=10, type=click.IntRange(1, 500), show_default=True, help="People.")
@click.option("--seed", default=0, type=click.IntRange(min=0), show_default=True, help="Seed of all draws.")
@click.option("--rate", default=30.0, type=click.FloatRange(1, 1000), show_default=True, help="Frames a second.")
@click.option("-o", "--output", required=True, metavar="DIR", help="One MCAP log per participant and condition.")
@json_option
def simulate_study(
    plans: tuple[str, ...], participants: int, seed: int, rate: float, output: str, as_json: bool
) -> None:
    """Make a SIMULATED study from plans: people of varying stature, habits, speed and motor noise follow each.

    PLAN_DIRs are what `lgp plan -o` wrote; the same plan under two names gives a study without any effect. The logs
    are labelled as simulated, and so is every report on them.
    """
    from lgp.study.simulate import simulate

    folders: dict[str, str] = {}
    for text in plans:
        name, _, folder = text.partition("=")
        if not name.strip() or not folder or name.strip() in folders:
            raise LgpError(f"{text!r}: expected CONDITION=PLAN_DIR, each condition once, as in ergonomic=plan_a")
        folders[name.strip()] = folder
    made = simulate(folders, output, participants=participants, seed=seed, rate=rate)
    if as_json:
        print_json({"simulated": True, "seed": seed, "output": output, "logs": made})
    else:
        click.echo(f"{output}: {len(made)} simulated logs of {participants} people; next: lgp study {output}")


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
