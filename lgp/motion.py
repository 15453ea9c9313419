"""The motion of a plan: poses of objects, frames and joints by forward kinematics of its configurations.

plan -> world + attachments of every object (`ModeSequence`) -> poses per slice
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lgp.errors import LgpError
from lgp.kinematics.human import joint_names
from lgp.kinematics.leg_ik import solve_legs
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.posture import PELVIS
from lgp.kinematics.world import World
from lgp.path.phases import Phases
from lgp.plan_record import Plan
from lgp.planner import parse_sequence, task_of
from lgp.scene.model import Human
from reba.arrays import Array
from reba.checks import TEXT, Allowed, accepts, instance

_NAMES = Allowed(
    "a list of names of frames",
    lambda given: (
        isinstance(given, Collection)
        and not isinstance(given, str | bytes)
        and all(isinstance(name, str) for name in given)
    ),
)


@dataclass(frozen=True)
class PoseTrajectory:
    """Rotations (T, 3, 3) and positions (T, 3) [m] in the world."""

    rotation: Array
    position: Array


class Motion:
    """Poses of objects, frames and joints in a plan: at time 0 and at every slice of the path, T + 1 rows.

    Args:
        plan: a feasible plan.
        world: kinematics with the agents of its scene, to save building them.

    Attributes:
        plan: the plan.
        world: its kinematics.
        phases: its actions in time.
        modes: the attachment of each object in each phase.
        time: (T + 1,) [s].
        phase: (T + 1,) number of the phase, 0 in the first row; `phases.switched` are the modes of each.
        path: (T + 1, nq) configurations [rad, m].

    Raises:
        LgpError: the plan has no motion, or its actions are not those of its scene.
    """

    @accepts(
        LgpError,
        plan=instance("a plan, as lgp.plan returns it", Plan),
        world=instance("the kinematics of its scene, lgp.World(scene)", World).or_none(),
    )
    def __init__(self, plan: Plan, world: World | None = None) -> None:
        if not plan.feasible:
            raise LgpError(
                f"{plan.scene.name}: the plan is infeasible ({plan.reason}), so there is no motion; plan again"
            )
        self.plan = plan
        self.world = World(plan.scene) if world is None else world.with_scene(plan.scene)
        if self.world.joints != plan.joints:
            raise LgpError(f"{plan.scene.name}: the joints of the plan differ from those of its scene; plan again")
        actions = parse_sequence(task_of(plan.scene), plan.actions)
        slices = len(plan.path) // sum(not one.together for one in actions) if actions else None
        own = plan.durations if plan.scene.durations != "fixed" else ()
        self.phases = Phases.of(plan.scene, actions, slices, own)
        self.modes = ModeSequence(self.world, self.phases.switches)
        if self.modes.names != tuple(plan.variables):
            raise LgpError(f"{plan.scene.name}: variables of the plan differ from those of its actions; plan again")
        self.variables = np.array(list(plan.variables.values()), dtype=float)
        self.time = np.concatenate([[0.0], plan.time])
        self.phase = np.concatenate([np.zeros(1, np.intp), plan.phase])
        self.path = np.concatenate([plan.start[None], plan.path])

    @accepts(LgpError, names=_NAMES)
    def frames(self, names: Collection[str]) -> dict[str, PoseTrajectory]:
        """Return frame -> poses, for frames such as `baxter.right` or `human.head`.

        Raises:
            WorldError: a frame is unknown.
        """
        kinematics = self.world.at(self.path, names)
        return {
            name: PoseTrajectory(kinematics.rotation[:, at], kinematics.position[:, at])
            for name, at in kinematics.index.items()
        }

    @accepts(LgpError, name=TEXT)
    def object_poses(self, name: str) -> PoseTrajectory:
        """Return the poses of an object; those of its attachments before and after agree in the slice of a switch.

        Raises:
            WorldError: there is no such object.
        """
        kinematics = self.world.at(self.path, self.modes.frames)
        rotation, position = np.empty((len(self.path), 3, 3)), np.empty((len(self.path), 3))
        for phase, switched in enumerate(self.phases.switched if self.phases.count else [0]):
            rows = np.flatnonzero(self.phase == phase)
            pose = self.modes.pose(name, int(switched), kinematics.rows(rows), self.variables)
            rotation[rows], position[rows] = pose.rotation, pose.position
        return PoseTrajectory(rotation, position)

    @cached_property
    def human(self) -> dict[str, Array]:
        """Return joint -> (T + 1,) value [rad, m] of all 41 joints of the first person, solved legs included.

        Raises:
            LgpError: there is no human in the scene.
        """
        person = self.world.scene.human
        if person is None:
            raise LgpError(f"{self.world.scene.name}: the scene has no human; add a [human] table")
        return self.joints_of(person)

    @accepts(LgpError, person=instance("a person of the scene, such as one of scene.humans", Human))
    def joints_of(self, person: Human) -> dict[str, Array]:
        """Return joint -> (T + 1,) value [rad, m] of all 41 joints of a person, solved legs included."""
        return human_joints(self.world, self.path, person)


def human_joints(world: World, path: Array, person: Human) -> dict[str, Array]:
    """Return joint -> (T,) value [rad, m] of all 41 joints of a person in a path (T, nq)."""
    values = {name: np.full(len(path), world.initial_values[f"{person.name}.{name}"]) for name in joint_names()}
    for name in values:
        column = world.column.get(f"{person.name}.{name}")
        if column is not None:
            values[name] = path[:, column]
    if person.legs == "solved":
        pelvis = np.stack([values[name] for name in PELVIS], axis=1)
        solved, _ = solve_legs(pelvis, person.stature, person.sex)
        values |= solved
    return values
