"""The commands `lgp study` and `lgp simulate-study`: options, calls, terminal tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import click
from rich.table import Table

from lgp.errors import LgpError
from lgp.files import STUDY_FILES
from lgp.statistics.formatting import number, p_value
from lgp.study.scoring import PARTS, TOTAL
from reba.command_line import (
    SEED,
    Command,
    Number,
    Stop,
    command_line,
    echo,
    json_option,
    output_file,
    output_folder,
    print_json,
)
from reba.outputs import FileOutput, FolderOutput
from reba.scoring_options import options_of, scoring_options
from reba.terminal import Console, Text, console


@click.command(
    cls=Command,
    epilog="Example: lgp study logs/ --manifest who.csv -o results/",
    context_settings={"default_map": {"missing": "neutral"}},
)
@click.argument("logs", nargs=-1, metavar="[LOG]...")
@click.option("--manifest", metavar="FILE.csv", help="Table with columns file, participant, condition, [trial].")
@click.option("--pattern", metavar="TEXT", help="Labels in file names: {participant}_{condition}_{trial}.")
@click.option("--conditions", metavar="A,B,...", help="Conditions to compare, in order; differences are A minus B.")
@click.option(
    "-o", "--output", type=output_folder(*STUDY_FILES), metavar="DIR",
    help="Write summary.json, scores.parquet and report.html there.",
)  # fmt: skip
@click.option("--report", type=output_file(), metavar="FILE.html", help="Write the HTML report to this file.")
@click.option(
    "--names", is_flag=True, help="Show in the report the labels of participants, folders, and names in file names.",
)  # fmt: skip
@scoring_options
@json_option
def study(
    logs: tuple[str, ...],
    manifest: str | None,
    pattern: str | None,
    conditions: str | None,
    output: str | None,
    report: str | None,
    names: bool,
    as_json: bool,
    **scoring: Any,
) -> None:
    """Score recordings of participants in several conditions, and compare the conditions.

    LOGs are files or folders. Participant and condition are read from the metadata record `study` of each recording, or
    given by --manifest or --pattern. Unmeasured angles count as neutral; --missing changes this.
    """
    from lgp.study.study import run_study

    outputs = [FolderOutput(output, STUDY_FILES)] if output is not None else []
    chosen = [name.strip() for name in (conditions or "").split(",") if name.strip()]
    options = options_of(scoring)
    scored = run_study(
        logs,
        manifest=manifest,
        pattern=pattern,
        conditions=chosen,
        options=options,
        exclude=output,
        outputs=[*outputs, *([FileOutput(report)] if report is not None else [])],
    )
    if output is not None:
        scored.save(output, command=command_line("lgp"), names=names)
    if report is not None:
        scored.write_report(report, command=command_line("lgp"), names=names)
    if as_json:
        print_json({**scored.summary, "output": output, "report": report})
    else:
        show_study(console(), scored.summary)
    for failure in scored.summary["failed"]:
        echo(f"lgp: {failure['error']}", err=True)
    if scored.summary["failed"]:
        raise Stop(1)


@click.command(
    cls=Command, epilog="Example: lgp simulate-study ergonomic=plan_a non-ergonomic=plan_b -o logs/; lgp study logs/"
)
@click.argument("plans", nargs=-1, required=True, metavar="CONDITION=PLAN_DIR...")
@click.option("-n", "--participants", default=10, type=click.IntRange(1, 500), show_default=True, help="Persons.")
@click.option("--seed", default=0, type=SEED, show_default=True, help="Seed of all random draws.")
@click.option("--rate", default=30.0, type=Number(1, 1000), show_default=True, help="Frames per second.")
@click.option(
    "-o", "--output", required=True, type=output_folder(), metavar="DIR",
    help="One MCAP log per participant and condition.",
)  # fmt: skip
@json_option
def simulate_study(
    plans: tuple[str, ...], participants: int, seed: int, rate: float, output: str, as_json: bool
) -> None:
    """Make a SIMULATED study from plans: persons of varying stature, habits, speed and motor noise follow each.

    PLAN_DIRs are folders of `lgp plan -o`; the same plan under two names gives a study without an effect. The logs and
    every report on them are marked as simulated.
    """
    from lgp.study.simulate import simulate

    folders: dict[str, str] = {}
    for text in plans:
        name, _, folder = text.partition("=")
        if not name.strip() or not folder or name.strip() in folders:
            raise LgpError(f"{text!r}: expected CONDITION=PLAN_DIR, each condition once, as in ergonomic=plan_a")
        folders[name.strip()] = folder
    rows = simulate(folders, output, participants=participants, seed=seed, rate=rate)
    if as_json:
        print_json({"simulated": True, "seed": seed, "output": output, "logs": rows})
    else:
        echo(f"{output}: {len(rows)} simulated logs of {participants} persons; next: lgp study {output}")


def show_study(console: Console, summary: Mapping[str, Any]) -> None:
    """Print the conclusion, means and tests of the total and of the parts, and missing recordings."""
    console.print(Text(("SIMULATED DATA. " if summary["simulated"] else "") + summary["verdict"], style="bold"))
    conditions = summary["conditions"]
    table = Table(header_style="bold")
    for name in ("mean score", *conditions, "first - second", "95 % interval", "p (t)", "p (ranks)", "g"):
        table.add_column(Text(name), justify="left" if name == "mean score" else "right")
    rows = [("REBA", summary[TOTAL]), *((PARTS[name], one) for name, one in summary["parts"].items())]
    for title, one in rows:
        means = [_mean(one["conditions"][name]) for name in conditions]
        tests = [_test(pair, len(conditions) > 2) for pair in one["pairs"]] or [[""] * 5]
        tests = [["no difference", "", "", "", ""]] if one.get("constant") else tests
        for index, test in enumerate(tests):
            first = [title, *means] if not index else [""] * (len(means) + 1)
            table.add_row(*map(Text, [*first, *test]))
    console.print(table)
    if len(conditions) > 1:
        console.print("± standard error between participants; p after Holm; g: Hedges' g of paired differences")
    for cell in summary["missing"]:
        console.print(f"missing: {cell['participant']}, {cell['condition']}: {cell['why']}")
    for warning in summary["warnings"]:
        console.print(f"note: {warning}")


def _mean(one: Mapping[str, Any]) -> str:
    return f"{number(one['mean'])} ± {number(one['se'])}" if one["n"] else "no recording"


def _test(pair: Mapping[str, Any], named: bool) -> list[str]:
    interval = f"{number(pair['low'])} to {number(pair['high'])}"
    values = (p_value(pair["p_holm"]), p_value(pair["wilcoxon_p_holm"]), number(pair["g"]))
    names = f"{pair['first']} - {pair['second']}: " if named else ""
    return [names + number(pair["difference"]), interval, *values]
