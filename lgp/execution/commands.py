"""`lgp run`: what the command line asks for, and what it prints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from lgp.errors import LgpError
from lgp.execution.log import Recorder, RunLog
from lgp.execution.retarget import Planner
from lgp.execution.trajectory import time_scaled, violations
from lgp.plan_record import Plan
from lgp.planner import COST
from reba.command_line import Stop, console, json_option, print_json


@click.command("run", epilog="Example: lgp plan screwdriver -o plan/ && lgp run plan/ --fault moved@1")
@click.argument("folder", metavar="DIR")
@click.option("--seed", default=0, type=click.IntRange(min=0), show_default=True, help="Seed of everything random.")
@click.option("--speed", default=1.0, type=click.FloatRange(0), show_default=True, help="0: as fast as possible.")
@click.option("--fault", "faults", multiple=True, metavar="KIND@ACTION[:AMOUNT]", help="Let something go wrong: moved, "
              "away, dropped, lost, stuck, killed. Actions count from 1. May be repeated.")  # fmt: skip
@click.option("--human", default="natural", type=click.Choice(["natural", "exact"]), show_default=True,
              help="Whether the simulated human has delays, sway and places of their own.")  # fmt: skip
@click.option("--noise", default=0.001, type=click.FloatRange(0, 0.05), show_default=True, help="Of the tracker [m].")
@click.option("--scatter", default=0.0, type=click.FloatRange(0, 1), show_default=True, help="Of the objects at first.")
@click.option("--replay", metavar="FILE.mcap", help="Watch this recording instead of a simulation.")
@click.option(
    "--patience", default=15.0, type=click.FloatRange(1), show_default=True, help="Time limit beyond plan [s]."
)
@click.option("--cost", default=COST, metavar="MODEL.json|NAME", show_default=True, help="dREBA model of new motions.")
@click.option("--no-compare", is_flag=True, help="Do not compare moved motions with new plans at the end.")
@click.option("--strict", is_flag=True, help="Fail where a motion is too fast for the robot, do not slow it down.")
@click.option("--resume", is_flag=True, help="Go on with the run that was interrupted.")
@click.option("--no-page", is_flag=True, help="Serve no page.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address that the page is served at.")
@click.option("--port", default=8642, type=click.IntRange(0, 65535), show_default=True, help="0: any free one.")
@click.option("--export", metavar="FILE.mcap", help="Write the planned robot motion as JointTrajectory; run nothing.")
@json_option
def run_command(folder: str, export: str | None, as_json: bool, **given: Any) -> None:
    """Execute the plan in DIR: watch, wait, adapt, show the current action, log everything to DIR/run.mcap."""
    if export is not None:
        _export(folder, export, given["strict"], as_json)
        return
    from lgp.execution.server import Address, run_live

    def told(event: Any) -> None:
        why = f" ({event.details['why']})" if event.details.get("why") and event.state != "failed" else ""
        click.echo(f"{event.time:7.2f} s  {event.text}{why}", err=True)

    def served(address: str) -> None:
        click.echo(f"page: {address}", err=True)

    address = None if given["no_page"] else Address(given["host"], given["port"])
    summary = run_live(Path(folder), _run(given), told, address, served)
    if as_json:
        print_json(summary)
    else:
        _show(summary)
    if summary["state"] == "failed":
        raise Stop(1)


def _run(given: dict[str, Any]) -> Any:
    """Return the record of a run for the options."""
    from lgp.execution.executive import Settings
    from lgp.execution.faults import parse_fault
    from lgp.execution.session import RunOptions
    from lgp.execution.worker import EXACT, WorkerBehaviour

    replay = None if given["replay"] is None else Path(given["replay"])
    if replay is not None and not replay.exists():
        raise LgpError(f"{replay}: no such recording; give an .mcap file with transforms of the objects")
    return RunOptions(
        seed=given["seed"],
        speed=given["speed"],
        settings=Settings(patience=given["patience"], slow_down=not given["strict"]),
        habits=EXACT if given["human"] == "exact" else WorkerBehaviour(),
        noise=given["noise"],
        scatter=given["scatter"],
        faults=tuple(parse_fault(text) for text in given["faults"]),
        replay=replay,
        cost=given["cost"],
        compare=not given["no_compare"],
        resume=given["resume"],
    )


def _export(folder: str, file: str, strict: bool, as_json: bool) -> None:
    from lgp.execution.retarget import load_plan

    found = export(load_plan(folder), Path(file), slow_down=not strict)
    for text in found["limits"]:
        click.echo(f"slowed down: {text}", err=True)
    if as_json:
        print_json(found)
    else:
        for row in found["actions"]:
            click.echo(f"{row['label']}: {row['seconds']:.2f} s")
        click.echo(f"trajectories are in {found['output']}")


def _show(summary: dict[str, Any]) -> None:
    """Print what happened."""
    out = console()
    out.print(
        f"{summary['state']} after {summary['seconds']:.1f} s: {len(summary['actions'])} actions, "
        f"{summary['retargeted']} motions moved, {summary['replanned']} times planned anew"
    )
    for row in summary["comparison"]:
        if row["extra"] is None:
            out.print(f"{row['action']} moved: cannot be compared, one of both ways has no path")
            continue
        other = "" if row["same_actions"] else f", which would be {', '.join(row['actions'])}"
        out.print(
            f"{row['action']} moved: cost {row['greedy']:.3f}, {row['extra']:+.3f} ({row['share']:+.0%}) against a new "
            f"plan{other}"
        )
    out.print(f"log: {summary['output']}")


PAUSE = 1.0
"""[s] Between the time stamps of two actions; how long a real pause takes, predicates decide."""


def export(plan: Plan, file: Path, *, slow_down: bool = False) -> dict[str, Any]:
    """Write each action's motion of each robot as one trajectory that begins and ends at rest.

    Args:
        plan: what is exported.
        file: where.
        slow_down: stretch motions that are too fast for a joint instead of refusing them.

    Returns:
        actions: label, seconds, factor by which each was slowed; limits: violations found, in words.

    Raises:
        LgpError: there is no robot, a motion breaks a limit, or the file cannot be written.

    Example:
        >>> export(lgp.Plan.load("plan"), Path("robot.mcap"))           # doctest: +SKIP
    """
    planner = Planner(plan, None)
    world = planner.motion.world
    if not world.scene.robots:
        raise LgpError(f"{plan.scene.name}: there is no robot whose motion could be exported")
    rows: list[dict[str, Any]] = []
    segments, limits = [], []
    for number, action in enumerate(planner.actions):
        segment, label, factor = planner.planned(number).segment, action.at(number + 1), 1.0
        for name in world.scene.robots:
            broken = violations(world, segment, world.columns(name))
            limits += [f"{label}: {one}" for one in broken]
            if any(one.kind == "position" for one in broken) or (broken and not slow_down):
                hint = "plan again" if broken[0].kind == "position" else "leave out --strict to slow it down"
                raise LgpError(f"{limits[-len(broken)]}; {hint}")
            segment, more = time_scaled(world, segment, world.columns(name))
            factor *= more
        segments.append(segment)
        rows.append({"label": label, "seconds": segment.duration, "factor": factor})
    about = {"scene": plan.scene.name, "what": "planned motion of the robots"}
    with RunLog(file, 0.0, about, "ros2") as log:
        recorder, time = Recorder(log, world), 0.0
        for segment in segments:
            recorder.command(time, segment)
            time += segment.duration + PAUSE
    return {"output": str(file), "actions": rows, "limits": limits}
