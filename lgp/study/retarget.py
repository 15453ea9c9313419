"""A planned motion done by a person of another stature: working hands where the plan has them, the rest little changed.

The person's body is scaled; the configuration of the plan is then moved, slice by slice, by the shortest step in the
joints that brings both hands to their places (damped least squares, `lgp.kinematics.ik`). A hand's place is the planned
one as far as the plan moves it away from rest; a resting hand stays with the body. Nothing is planned again: robot,
timing and places of objects are those that the plan was made for, as in a study where everybody gets the same plan.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from lgp.errors import LgpError
from lgp.kinematics.ik import least_squares
from lgp.kinematics.posture import PostureMap
from lgp.kinematics.world import World
from lgp.plan_record import Plan
from reba.arrays import Array, Indices
from reba.posture.columns import SIDES

WORKING: Final = 0.15
"""[m] A hand this far from where it rested counts as working in full; before, in part, smoothly."""
STEP: Final = 0.2
"""[m] of the pelvis that cost as much as a radian of a joint: people lean and reach before they crouch or step."""


@dataclass(frozen=True)
class RetargetedMotion:
    """What a person does in a condition, before anything of their own is added.

    Attributes:
        time: (T,) [s], increasing from 0.
        phase: (T,) number of the action.
        posture: (T, 22) angles [deg] in the order of `reba.COLUMNS`.
        carried: (T,) mass held [kg].
        miss: largest distance of a hand from its place [m].
    """

    time: Array
    phase: Indices
    posture: Array
    carried: Array
    miss: float = 0.0


class Retarget:
    """A plan to be done by people of other statures; hands and joints are worked out once.

    Attributes:
        planned: the course of the person that the plan was made for.
        stature: of that person [m].

    Args:
        plan: one that is feasible and holds a human.
        name: of the plan in errors.

    Raises:
        LgpError: the plan is not feasible or holds no human.

    Example:
        >>> Retarget(lgp.Plan.load("plan")).course(1.62).posture.shape          # doctest: +SKIP
        (30, 22)
    """

    def __init__(self, plan: Plan, name: str = "the plan") -> None:

        if not plan.feasible:
            raise LgpError(f"{name}: there is no plan in it ({plan.reason}); give a feasible one")
        if plan.scene.human is None or not len(plan.posture):
            raise LgpError(f"{name}: the plan holds no human; give one with a human")
        self.planned = RetargetedMotion(plan.time - plan.time[0], plan.phase, plan.posture, plan.carried)
        self.scene, self.human = replace(plan.scene, robots={}), plan.scene.human
        self.stature = self.human.stature
        world = World(self.scene)
        index = {joint: column for column, joint in enumerate(plan.joints)}
        columns = [index[joint] for joint in world.joints]
        self.path = plan.path[:, columns]
        self.hands, _ = _places(world, self.path)
        rested, _ = _places(world, plan.start[None, columns])
        away = np.linalg.norm((self.hands - rested).reshape(-1, 2, 3), axis=2) / WORKING
        share = np.clip(away, 0.0, 1.0)
        self._courses: dict[float, RetargetedMotion] = {self.stature: self.planned}
        self.working: Array = np.repeat(share**2 * (3.0 - 2.0 * share), 3, axis=1)

    def course(self, stature: float) -> RetargetedMotion:
        """Return the motion of a person of this stature [m]; each stature is worked out once.

        Raises:
            SceneError: it is no adult's.
        """
        if stature not in self._courses:
            self._courses[stature] = self._course(stature)
        return self._courses[stature]

    def _course(self, stature: float) -> RetargetedMotion:

        world = World(replace(self.scene, human=replace(self.human, stature=stature)))
        own, _ = _places(world, self.path)
        wanted = own + self.working * (self.hands - own)
        slides = ("human.pelvis_x", "human.pelvis_y", "human.pelvis_z")
        unit = np.array([STEP if joint in slides else 1.0 for joint in world.joints])

        def residuals(scaled: Array, which: Indices) -> tuple[Array, Array]:
            places, slopes = _places(world, scaled * unit)
            return places - wanted[which], slopes * unit

        found, miss = least_squares(residuals, self.path / unit, world.lower / unit, world.upper / unit)
        return replace(self.planned, posture=PostureMap(world).angles(found * unit), miss=float(miss.max()))


def _places(world: World, q: Array) -> tuple[Array, Array]:
    """Return (T, 6) places of both hands [m] and their Jacobian (T, 6, nq)."""
    names = [f"human.{side}_hand" for side in SIDES]
    kinematics = world.at(q, names)
    places = [kinematics.placement(name) for name in names]
    return (
        np.concatenate([place.position for place in places], axis=1),
        np.concatenate([place.jacobian[:, :3] for place in places], axis=1),
    )
