"""The planned motion of the robots as trajectory_msgs/JointTrajectory in an MCAP file, limits and timing checked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lgp.errors import LgpError
from lgp.execution.limits import slowed, violations
from lgp.execution.log import RunLog
from lgp.execution.planner import Planner
from lgp.execution.recorder import Recorder
from lgp.plan_record import Plan

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
            segment, more = slowed(world, segment, world.columns(name))
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
