"""Planned robot motion as trajectory_msgs/JointTrajectory in an MCAP file, for a robot's own controller."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lgp.errors import LgpError
from lgp.execution.log import Recorder, RunLog
from lgp.execution.retarget import Planner
from lgp.execution.trajectory import time_scaled, violations
from lgp.plan_record import Plan
from reba.checks import PATH, YES_NO, accepts, instance
from reba.files import write_atomic
from reba.outputs import FileOutput, check_outputs

PAUSE = 1.0
"""[s] Time between the stamps of two actions; in a run the predicates decide."""


@accepts(LgpError, plan=instance("what lgp.plan returns", Plan), path=PATH, slow_down=YES_NO)
def write_trajectories(plan: Plan, path: str | Path, *, slow_down: bool = False) -> dict[str, Any]:
    """Write the motion of each robot in each action as one JointTrajectory, from rest to rest, as `lgp run --export`.

    Args:
        plan: feasible.
        path: MCAP file of trajectory_msgs/JointTrajectory on `/ROBOT/trajectory`, for a robot's own controller.
        slow_down: scale the duration of motions above a velocity limit; otherwise they are refused.

    Returns:
        `output`, `actions` (label, seconds, factor of the duration) and `limits` (exceeded limits in words).

    Raises:
        LgpError: there is no robot, a motion exceeds a limit, or the file cannot be written.
    """
    file = Path(path)
    check_outputs(FileOutput(file), error=LgpError)
    planner = Planner(plan, None)
    world = planner.motion.world
    if not world.scene.robots:
        raise LgpError(f"{plan.scene.name}: no robot, thus no motion to export; expected a plan with a robot")
    rows: list[dict[str, Any]] = []
    trajectories, limits = [], []
    phases = planner.motion.phases
    for number in phases.switched:
        trajectory, factor = planner.planned(number).trajectory, 1.0
        label = " and ".join(map(phases.label, planner.step(number)))
        for name in world.scene.robots:
            violated = violations(world, trajectory, world.columns(name))
            limits += [f"{label}: {one}" for one in violated]
            if any(one.kind == "position" for one in violated) or (violated and not slow_down):
                hint = "plan again" if violated[0].kind == "position" else "leave out --strict to slow it down"
                raise LgpError(f"{limits[-len(violated)]}; {hint}")
            trajectory, more = time_scaled(world, trajectory, world.columns(name))
            factor *= more
        trajectories.append(trajectory)
        rows.append({"label": label, "seconds": trajectory.duration, "factor": factor})
    about = {"scene": plan.scene.name, "what": "planned motion of the robots"}

    def write(part: Path) -> None:
        with RunLog(part, 0.0, about, "ros2") as log:
            recorder, time = Recorder(log, world), 0.0
            for trajectory in trajectories:
                recorder.command(time, trajectory)
                time += trajectory.duration + PAUSE

    write_atomic(file, write, error=LgpError)
    return {"output": str(file), "actions": rows, "limits": limits}
