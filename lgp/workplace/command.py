"""The command `lgp improve`: options, call, terminal tables."""

from __future__ import annotations

from typing import Any

import click
from rich.table import Table

from lgp.defaults import COST
from reba.analysis.wording import moment as time_of
from reba.command_line import SECONDS, Command, Number, command_line, echo_notes, json_option, output_file, print_json
from reba.scoring_options import options_of, scoring_options
from reba.terminal import Console, Text, console

METRES = Number(-2, 3)
"""Type of a height or distance."""


@click.command(cls=Command, epilog="Example: lgp improve shift.mcap --load 8 --at 28.8 --report moved.html")
@click.argument("path", metavar="RECORDING")
@click.option("--at", "time", type=SECONDS, metavar="SECONDS", help="Time of the posture; by default the worst ones.")
@click.option(
    "--hands", default="both", type=click.Choice(["both", "left", "right"]), show_default=True,
    help="Hands that stay on the surface; the other one is free.",
)  # fmt: skip
@click.option("--stature", default=1.75, type=Number(1.4, 2.1), show_default=True, metavar="M", help="Of the person.")
@click.option("--sex", default="male", type=click.Choice(["male", "female"]), show_default=True, help="Of the body.")
@click.option("--heights", nargs=2, type=METRES, metavar="LOW HIGH", help="Hand heights that the surface allows [m].")
@click.option(
    "--distances", nargs=2, type=METRES, metavar="NEAR FAR", help="Distances of the hands in front of the ankles [m]."
)
@click.option("--step", default=0.1, type=Number(0.02, 0.5), show_default=True, metavar="M", help="Between two places.")
@click.option("--cost", default=COST, show_default=True, metavar="MODEL.json|NAME", help="dREBA model of the cost.")
@click.option("--report", type=output_file(), metavar="FILE.html", help="Write a page with the postures drawn.")
@scoring_options
@json_option
def improve(
    path: str,
    time: float | None,
    hands: str,
    stature: float,
    sex: str,
    heights: tuple[float, float] | None,
    distances: tuple[float, float] | None,
    step: float,
    cost: str,
    report: str | None,
    as_json: bool,
    **scoring: Any,
) -> None:
    """Move the surface that the hands work at, and show REBA at each height and distance.

    The person of a recorded posture is given the planner's body. The hands stay on the surface, the soles on the floor
    and the body in balance, and the rest takes the posture of the lowest score that is found. `reba improve` names
    changes of angles and factors instead.
    """
    from lgp.workplace import improvement

    scores = options_of(scoring, recorded=True).read_and_score(path)
    echo_notes(scores.postures)
    surface: dict[str, Any] = {"heights": heights, "distances": distances, "step": step}
    moved = improvement.improve(scores, at=time, hands=hands, stature=stature, sex=sex, cost=cost, **surface)
    if report is not None:
        from lgp.workplace.report import write_report
        from reba.report.privacy import command_without_names

        write_report(moved, report, command=command_without_names(command_line("lgp"), [scores]))
    if as_json:
        print_json({"input": path, **moved.to_dict(), "report": report})
    else:
        show_workplace(console(), moved)


def show_workplace(to: Console, moved: Any) -> None:
    """Print for each posture the result, and REBA over height and distance."""
    from lgp.workplace import wording

    for moment in moved.moments:
        to.print(Text(f"at {time_of(moment.time)}: {wording.result(moment, moved)}", "bold"))
        to.print(Text(f"hands now: {wording.where(moment.here)}"))
        table = Table(title="REBA by height and distance of the hands [cm]; * now, ! best", title_justify="left")
        for title in ("height", *(f"{100 * place.distance:.0f}" for place in moment.grid[0])):
            table.add_column(title, justify="right")
        for row in reversed(moment.grid):
            table.add_row(f"{100 * row[0].height:.0f}", *(_cell(place, moment) for place in row))
        to.print(table)
        to.print(Text(wording.nearness(moment)))
    for note in wording.assumptions(moved):
        to.print(Text(f"- {note}"))


def _cell(place: Any, moment: Any) -> str:
    from lgp.workplace.wording import mark

    sign = {"best": "!", "now": "*", "": ""}[mark(place, moment, in_grid=True)]
    return "-" if place.posture is None else f"{place.posture.reba}{sign}"
