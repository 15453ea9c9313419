"""`lgp run`: options, export of trajectories, and the printed summary."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from lgp.defaults import SCENE_COST
from lgp.errors import LgpError
from lgp.files import PLAN_FILES
from reba.command_line import (
    MOST,
    SEED,
    Command,
    Number,
    Stop,
    echo,
    json_option,
    output_file,
    print_json,
)
from reba.outputs import FileOutput, check_outputs

SAY_WHY = ("waiting", "moved", "lost", "dropped", "failed")
"""Kinds of events whose text has the reason."""


@click.command("run", cls=Command, epilog="Example: lgp plan screwdriver -o plan/ && lgp run plan/ --fault moved@1")
@click.argument("folder", metavar="DIR")
@click.option("--seed", default=0, type=SEED, show_default=True, help="Seed of the random numbers.")
@click.option("--speed", default=1.0, type=Number(0, MOST), show_default=True, help="0: as fast as possible.")
@click.option("--fault", "faults", multiple=True, metavar="KIND@ACTION[:AMOUNT]", help="Fault to inject: moved, "
              "away, dropped, lost, stuck, killed. Actions count from 1. May be repeated.")  # fmt: skip
@click.option("--human", default="natural", type=click.Choice(["natural", "exact"]), show_default=True,
              help="natural: simulated people deviate from the plan; exact: they move as planned.")  # fmt: skip
@click.option(
    "--noise",
    default=0.001,
    type=Number(0, 0.05),
    show_default=True,
    help="Standard deviation of tracked positions [m].",
)
@click.option(
    "--scatter",
    default=0.0,
    type=Number(0, 1),
    show_default=True,
    help="Standard deviation of initial object positions [m].",
)
@click.option("--replay", metavar="FILE.mcap", help="Follow this recording instead of a simulation.")
@click.option("--patience", default=15.0, type=Number(1, MOST), show_default=True, help="Time limit beyond plan [s].")
@click.option(
    "--cost", default=SCENE_COST, metavar="MODEL.json|NAME", help="dREBA model of new motions, the scene's by default."
)
@click.option("--no-compare", is_flag=True, help="Do not compare retargeted motions with new plans.")
@click.option("--strict", is_flag=True, help="Fail if a motion is too fast for the robot; do not slow it down.")
@click.option("--resume", is_flag=True, help="Continue the interrupted run.")
@click.option("--no-page", is_flag=True, help="Do not serve the page.")
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address that the page is served at, to everyone who can reach it.",
)
@click.option("--port", default=8642, type=click.IntRange(0, 65535), show_default=True, help="0: any free one.")
@click.option("--export", type=output_file(), metavar="FILE.mcap",
              help="Write the planned robot motion as JointTrajectory and exit.")  # fmt: skip
@json_option
def run_command(folder: str, export: str | None, as_json: bool, **options: Any) -> None:
    """Execute the plan in DIR: follow the tracked world, adapt to it, show the current action, log to DIR/run.mcap."""
    if export is not None:
        _export(folder, export, options["strict"], as_json)
        return
    from lgp.execution.server import Address, run_live

    def on_event(event: Any) -> None:
        why = f" ({event.details['why']})" if event.details.get("why") and event.kind not in SAY_WHY else ""
        echo(f"{event.time:7.2f} s  {event.text}{why}", err=True)

    def on_served(address: str) -> None:
        echo(f"page: {address}", err=True)

    address = None if options["no_page"] else Address(options["host"], options["port"])
    summary = run_live(Path(folder), _run(options), on_event, address, on_served)
    if as_json:
        print_json(summary)
    else:
        _show(summary)
    if summary["state"] == "failed":
        raise Stop(1)


def _run(options: dict[str, Any]) -> Any:
    """Return the options of the command as `RunOptions`."""
    from lgp.execution.executive import Settings
    from lgp.execution.faults import parse_fault
    from lgp.execution.session import RunOptions
    from lgp.execution.worker import EXACT, WorkerBehaviour

    replay = None if options["replay"] is None else Path(options["replay"])
    if replay is not None and not replay.exists():
        raise LgpError(f"{replay}: no such recording; expected an .mcap file with transforms of the objects")
    return RunOptions(
        seed=options["seed"],
        speed=options["speed"],
        settings=Settings(patience=options["patience"], slow_down=not options["strict"]),
        behaviour=EXACT if options["human"] == "exact" else WorkerBehaviour(),
        noise=options["noise"],
        scatter=options["scatter"],
        faults=tuple(parse_fault(text) for text in options["faults"]),
        replay=replay,
        cost=options["cost"],
        compare=not options["no_compare"],
        resume=options["resume"],
    )


def _export(folder: str, file: str, strict: bool, as_json: bool) -> None:
    from lgp.execution.retarget import load_plan
    from lgp.execution.trajectory_export import write_trajectories

    logs = (path for path in Path(folder).glob("run*.mcap") if re.fullmatch(r"run(-\d+)?", path.stem))
    check_outputs(FileOutput(file), inputs=[*logs, *(file for name in PLAN_FILES for file in Path(folder).glob(name))])
    exported = write_trajectories(load_plan(folder), file, slow_down=not strict)
    for text in exported["limits"]:
        echo(f"slowed down: {text}", err=True)
    if as_json:
        print_json(exported)
    else:
        for row in exported["actions"]:
            echo(f"{row['label']}: {row['seconds']:.2f} s")
        echo(f"trajectories are in {exported['output']}")


def _show(summary: dict[str, Any]) -> None:
    """Print the summary of a run."""
    from reba.terminal import console

    out = console()
    out.print(
        f"{summary['state']} after {summary['seconds']:.1f} s: {len(summary['actions'])} actions, "
        f"{summary['retargeted']} motions retargeted, {summary['replanned']} times replanned"
    )
    if summary["state"] == "failed":
        # In one line: a name in it must not begin another one.
        echo(f"why: {summary['why']}")
    for row in summary["comparison"]:
        if row["extra"] is None:
            out.print(f"{row['action']} retargeted: no comparison, one of the two plans is infeasible")
            continue
        other = "" if row["same_actions"] else f", which would be {', '.join(row['actions'])}"
        out.print(
            f"{row['action']} retargeted: cost {row['greedy']:.3f}, {row['extra']:+.3f} ({100 * row['share']:+.0f} %) "
            f"against a new plan{other}"
        )
    out.print(f"log: {summary['output']}")
