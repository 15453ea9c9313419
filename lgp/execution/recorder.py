"""What of a run goes into the log, moment by moment."""

from __future__ import annotations

from collections.abc import Set as AbstractSet

import numpy as np
from numpy.typing import NDArray

from lgp.execution.events import Event
from lgp.execution.log import JOINT_STATE, TRAJECTORY, TRANSFORMS, RunLog
from lgp.execution.messages import joint_state, trajectory, transforms
from lgp.execution.observation import View
from lgp.execution.recognise import Verdict
from lgp.execution.segment import Segment
from lgp.execution.state import carrier
from lgp.logic.atom import Atom
from lgp.motion import human_joints
from lgp.plan_record import Plan
from lgp.world.human import ISB
from lgp.world.model import World
from reba.posture import COLUMNS

Array = NDArray[np.float64]

PELVIS = "middle_pelvis"
"""Frame of the pelvis in ISB axes, as the profile human_description of `reba` has it."""


class Recorder:
    """Writes moments, events and commands into a log.

    Args:
        log: where.
        world: kinematics and scene.
    """

    def __init__(self, log: RunLog, world: World) -> None:
        from lgp.world.posture import PostureMap

        self.log, self.world = log, world
        self._posture = PostureMap(world) if world.scene.human is not None else None
        self._columns = {name: world.columns(name) for name in world.scene.robots}
        self._verdicts: dict[str, Verdict] = {}

    def plan(self, time: float, plan: Plan, folder: str) -> None:
        """Write the plan that is followed from now on, and its scene."""
        steps = {"actions": list(plan.actions), "columns": list(plan.joints), "costs": plan.costs}
        self.log.json("/plan", time, {"folder": folder, **steps, "time": plan.time, "path": plan.path})
        self.log.json("/scene", time, {"name": plan.scene.name, "values": plan.scene.values})

    def event(self, event: Event) -> None:
        """Write what happened."""
        self.log.json("/events", event.time, event.record())

    def predicates(self, time: float, number: int, verdicts: dict[str, Verdict]) -> None:
        """Write the verdicts on the predicates of an action if any changed."""
        if verdicts and verdicts != self._verdicts:
            self._verdicts = dict(verdicts)
            found = {name: {"holds": one.holds, "why": "" if one.holds else one.why} for name, one in verdicts.items()}
            self.log.json("/predicates", time, {"time": time, "action": number, "predicates": found})

    def command(self, time: float, segment: Segment) -> None:
        """Write the motion that the robots are sent on."""
        for name, columns in self._columns.items():
            message = trajectory(self.log.stamp(time), self._joints(name), segment, columns)
            self.log.message(f"/{name}/trajectory", TRAJECTORY, time, message)

    def moment(self, view: View, believed: AbstractSet[Atom]) -> None:
        """Write joints, tracked poses and the posture of the present moment.

        Args:
            view: the tracked world.
            believed: what the plan has, which decides where a hand is at an object on a table.
        """
        now = view.now
        stamp = self.log.stamp(now.time)
        poses = {name: (at.rotation, at.position) for name, at in now.things.items() if view.seen(name)}
        if self._posture is not None:
            joints = {name: float(values[0]) for name, values in human_joints(self.world, now.q[None]).items()}
            message = joint_state(stamp, list(joints), np.array(list(joints.values())))
            self.log.message("/human/joint_states", JOINT_STATE, now.time, message)
            at = self.world.at(now.q[None], ["human.pelvis_tilt"])
            poses[PELVIS] = at.rotation[0, 0] @ ISB, at.position[0, 0]
            angles = dict(zip(COLUMNS, self._posture.angles(now.q[None])[0].tolist(), strict=True))
            self.log.json("/ergonomics/posture", now.time, {"time": now.time, **angles, "load": load(view, believed)})
        for name, columns in self._columns.items():
            message = joint_state(stamp, self._joints(name), now.q[columns])
            self.log.message(f"/{name}/joint_states", JOINT_STATE, now.time, message)
        self.log.message("/tf", TRANSFORMS, now.time, transforms(stamp, poses))
        self.log.flush()

    def _joints(self, robot: str) -> list[str]:
        return [self.world.joints[column].partition(".")[2] for column in self._columns[robot]]


def load(view: View, believed: AbstractSet[Atom]) -> float:
    """Return the mass that the human holds [kg]."""
    scene = view.world.scene
    hands = {name: carrier(view, name, believed) for name in scene.things}
    return float(sum(scene.things[name].mass for name, hand in hands.items() if hand.startswith("human.")))
