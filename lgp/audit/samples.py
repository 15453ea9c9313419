"""The motion of a plan, sampled: times, joint values, and where hands and bodies are in every sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from lgp.audit.agents import AgentModel, person_model, robot_model
from lgp.audit.joint_tree import about, along, attached, place, values_of
from lgp.audit.shapes import Body
from lgp.errors import LgpError
from lgp.kinematics.human import PELVIS
from lgp.kinematics.interpolation import interpolate
from lgp.kinematics.leg_ik import LegSegments
from lgp.plan_record import Plan
from lgp.scene.model import Human, Robot, Table
from reba.arrays import Array, Indices

PER_SLICE: Final = 10
"""Samples from one slice to the next."""

Poses = tuple[Array, Array]
"""Rotations (T, 3, 3) and positions (T, 3) [m]."""


class CarriedTop(NamedTuple):
    """The top of a table that a robot carries: where its centre is in T samples, x along its length.

    Attributes:
        rotation, position: (T, 3, 3) and (T, 3) [m].
        robot, joint: that carry it; the joint by the number of its frame.
    """

    rotation: Array
    position: Array
    robot: str
    joint: int


@dataclass(frozen=True)
class Samples:
    """A plan in T samples.

    Attributes:
        times: (T,) [s].
        moved: joint -> values (T,) [rad, m], of the joints that the plan moves.
        switches: sample in which each action happens (K,).
        models: the agents.
        frames: of the joints of each agent, (n + 1, T, ...), jaws where they are at first.
        hands: grip point of each hand.
        tops: centre of the top of each table that a robot carries.
    """

    plan: Plan
    times: Array
    moved: Mapping[str, Array]
    switches: Indices
    models: tuple[AgentModel, ...]
    frames: tuple[Poses, ...]
    hands: Mapping[str, Poses]
    tops: Mapping[str, CarriedTop]

    @staticmethod
    def of(plan: Plan) -> Samples:
        """Return the samples of a plan, by the interpolation that it states.

        Raises:
            LgpError: the phases do not fit the actions, or time does not increase.
        """
        knots = np.concatenate([plan.start[None], plan.path.reshape(len(plan.path), len(plan.joints))])
        clock = np.concatenate([[0.0], plan.time])
        if (np.diff(clock) <= 0.0).any():
            raise LgpError("the time of the plan does not increase from slice to slice; plan again")
        if not (np.isfinite(knots).all() and np.isfinite(clock).all()):
            raise LgpError("the path of the plan has values that are not finite; plan again")
        phase_of, phases = plan.phase_of, set(plan.phase.tolist())
        if phases != set(phase_of):
            raise LgpError(
                f"the plan has {len(phases)} phases, expected one for each number of its {len(plan.actions)} actions; "
                "plan again"
            )
        count = (len(knots) - 1) * PER_SLICE + 1
        before = np.minimum(np.arange(count) // PER_SLICE, max(len(knots) - 2, 0))
        share = (np.arange(count) - before * PER_SLICE) / PER_SLICE
        q = interpolate(knots, before, share) if len(knots) > 1 else knots
        after = np.minimum(before + 1, len(clock) - 1)
        times = clock[before] + share * (clock[after] - clock[before])
        moved = dict(zip(plan.joints, q.T, strict=True))
        models = tuple(_model(agent) for agent in plan.scene.agents)
        known = {joint.name for model in models for joint in model.joints}
        if not known.issuperset(moved):
            unknown = next(name for name in moved if name not in known)
            raise LgpError(f"no agent of the scene has joint {unknown!r}; audit a plan with the scene it was made for")
        frames = tuple(_frames(model, moved, count) for model in models)
        hands: dict[str, Poses] = {}
        for model, placed in zip(models, frames, strict=True):
            if model.hands:
                rotation, position = attached(*placed, list(model.hands.values()))
                hands |= dict(zip(model.hands, zip(rotation, position, strict=True), strict=True))
        tops = {name: _top(table, models, frames) for name, table in plan.scene.carried_tables.items()}
        last = np.array([np.flatnonzero(plan.phase == number)[-1] for number in phase_of], np.intp)
        return Samples(plan, np.asarray(times), moved, (last + 1) * PER_SLICE, models, frames, hands, tops)

    def table(self, name: str, sample: int) -> Table:
        """Return a table as it stands in the world in one sample."""
        table = self.plan.scene.tables[name]
        if name not in self.tops:
            return table
        turn, (x, y, height) = self.tops[name].rotation[sample], self.tops[name].position[sample].tolist()
        return replace(table, position=(x, y), yaw=float(np.degrees(np.arctan2(turn[1, 0], turn[0, 0]))), height=height)

    @property
    def count(self) -> int:
        """Number of samples T."""
        return len(self.times)

    def bodies(self, model: AgentModel, jaws: Mapping[str, Array]) -> tuple[list[Body], Array, Array]:
        """Return the bodies of an agent and their poses, (m, T, 3, 3) and (m, T, 3) [m]."""
        if not model.parts:
            return [], np.zeros((0, self.count, 3, 3)), np.zeros((0, self.count, 3))
        frames = self.frames[self.models.index(model)]
        if jaws:
            frames = _frames(model, {**self.moved, **jaws}, self.count)
        rotation, position = attached(*frames, [frame for _, frame in model.parts])
        bodies = [body for body, _ in model.parts]
        if model.legs and isinstance(model.agent, Human):
            pelvis = 1 + [joint.name for joint in model.joints].index(f"{model.agent.name}.{PELVIS}")
            legs = LegSegments(model.agent, model.ground(frames))
            for number, body in enumerate(bodies):
                if body.name in model.legs:
                    start, end = legs.ends(model.legs[body.name], frames[0][pelvis], frames[1][pelvis])
                    rotation[number], position[number] = along(end - start), (start + end) / 2.0
        return bodies, rotation, position


def _frames(model: AgentModel, moved: Mapping[str, Array], count: int) -> Poses:
    values = values_of(model.joints, moved, model.fixed)
    return place(model.joints, model.rotation, model.position, values, count)


def _top(table: Table, models: tuple[AgentModel, ...], frames: tuple[Poses, ...]) -> CarriedTop:
    """Return the top of a table that a robot carries."""
    robot, _, link = table.frame.partition(".")
    for model, placed in zip(models, frames, strict=True):
        if model.agent.name == robot and model.file is not None and link in model.file.frames:
            turn = about(np.array([0.0, 0.0, 1.0]), np.radians([table.yaw]))[0]
            top = model.file.frames[link].then(turn, np.array([*table.position, table.height]))
            rotation, position = attached(*placed, [top])
            return CarriedTop(rotation[0], position[0], robot, top.on)
    raise LgpError(
        f"{table.full} is on {table.frame!r}, which no robot has; audit a plan with the scene it was made for"
    )


def _model(agent: object) -> AgentModel:
    if isinstance(agent, Human):
        return person_model(agent)
    if isinstance(agent, Robot):
        return robot_model(agent)
    raise LgpError(f"{agent!r} is no human and no robot; audit a plan for these")
