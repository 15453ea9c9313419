"""`lgp.replan`: a new plan of what remains, from where everything is now."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from lgp.agent_trajectory import configurations_at
from lgp.defaults import COST
from lgp.errors import LgpError
from lgp.execution.predicates import CLOSING
from lgp.execution.retarget import Planner
from lgp.execution.tracking import Observation, Tolerances, TrackedPose, TrackedWorld, box_gap
from lgp.plan_record import Plan
from reba.arrays import Array
from reba.checks import NOT_NEGATIVE, PATH, POSITIVE, Allowed, accepts, instance, is_number, shown
from reba.errors import did_you_mean

MAPPING: Final = Allowed("a mapping, or None", lambda value: value is None or isinstance(value, Mapping))
ORTHONORMAL: Final = 1e-3
"""Departure of R'R from 1 that rounding and a tracker explain."""
MOMENTS: Final = (0.0, 0.1, 0.2, 0.3)
"""[s] Times at which all is seen where it is: long enough to count as resting."""


@accepts(
    LgpError,
    plan=instance("what lgp.plan returns", Plan),
    now=NOT_NEGATIVE,
    poses=MAPPING,
    joints=MAPPING,
    cost=PATH.or_none(),
    seconds=POSITIVE,
)
def replan(
    plan: Plan,
    now: float = 0.0,
    poses: Mapping[str, Any] | None = None,
    *,
    joints: Mapping[str, float] | None = None,
    cost: str | Path | None = COST,
    seconds: float = 10.0,
) -> Plan:
    """Return a new plan of what remains to be done, from where everything is now.

    Actions that have ended by then count as done as far as the poses agree: an object that is not where its action
    puts it has to be brought there again. What remains of the plan is tried first and is the initial guess.

    Args:
        plan: feasible.
        now: time since the plan began [s].
        poses: object -> its pose in the world, a (4, 4) matrix [m]; an object that is not named is where the plan has
            it. It rests on a table or is in the hand that has it.
        joints: `agent.joint` -> measured value [rad, m]; others are where the plan has them.
        cost: dREBA surrogate, as for `plan`; not used where the plan was made without ergonomics.
        seconds: wall-clock limit of the search [s].

    Returns:
        A plan that starts now, at time 0; without actions where the goal holds. It may be infeasible, with a `reason`.

    Raises:
        LgpError: an object, joint or pose is wrong, or an object is neither on a table nor in a hand.

    Example:
        >>> import lgp
        >>> scene = lgp.load_scene("screwdriver", {"goal": ["grasped(baxter.right, screwdriver)"]})
        >>> plan = lgp.plan(scene, cost=None, collisions=False)
        >>> lgp.replan(plan, 1.0).actions
        ('grasp(1, baxter.right, screwdriver)',)
    """
    planner = Planner(plan, cost)
    world, motion = planner.motion.world, planner.motion
    q = configurations_at(motion.path, motion.time, np.array([min(float(now), float(motion.time[-1]))]))[0][0]
    for name, value in (joints or {}).items():
        if name not in world.column:
            raise LgpError(f"{plan.scene.name}: no joint {shown(name)}{did_you_mean(str(name), world.column)}")
        if not is_number(value) or not np.isfinite(value):
            raise LgpError(f"joint {name} is {shown(value)}, expected a finite number [rad, m]")
        q[world.column[name]] = value
    world.check_limits(q, "`joints`")
    done = int(np.count_nonzero(motion.time[motion.phases.slices :: motion.phases.slices] <= now + 1e-9))
    number = int(np.searchsorted(motion.phases.phase_of, done))
    view = TrackedWorld(world)
    seen = _objects(planner, number, q, poses or {})
    closed = frozenset(_closed(planner, number, q, seen))
    for moment in MOMENTS:
        at = {name: TrackedPose(*pose, moment) for name, pose in seen.items()}
        view.add(Observation(moment, q, at, closed))
    return planner.replan(number, planner.scene(number, view), q, seconds)


def _objects(planner: Planner, number: int, q: Array, poses: Mapping[str, Any]) -> dict[str, tuple[Array, Array]]:
    """Return the pose of every object: as given, else where the plan has it after `number` actions."""
    motion, scene = planner.motion, planner.plan.scene
    for name in poses:
        if name not in scene.objects:
            hint = did_you_mean(str(name), scene.objects) or f"; known are {', '.join(scene.objects)}"
            raise LgpError(f"{scene.name}: no object {shown(name)}{hint}")
    kinematics = motion.world.at(q[None], motion.modes.frames)
    seen = {}
    for name in scene.objects:
        if name in poses:
            seen[name] = _pose(name, poses[name])
        else:
            planned = motion.modes.pose(name, number, kinematics, motion.variables)
            seen[name] = planned.rotation[0], planned.position[0]
    return seen


def _closed(planner: Planner, number: int, q: Array, seen: Mapping[str, tuple[Array, Array]]) -> Iterator[str]:
    """Yield the grippers that by the plan have an object or hold it after `number` actions, and are still at it."""
    motion, scene = planner.motion, planner.plan.scene
    hands = motion.world.at(q[None], scene.hands)
    has = {(motion.modes.attachment(name, number).parent, name) for name in seen}
    has |= {(atom.arguments[0], atom.arguments[1]) for atom in planner.nominal(number) if atom.predicate in CLOSING}
    seconds = motion.modes.second_intervals
    has |= {(hand, motion.modes.switches[k].object_name) for hand, k, last in seconds if k < number <= last}
    for hand, name in sorted(has):
        if hand in scene.hands and not scene.hands[hand].human:
            point = hands.position[0, hands.index[hand]]
            if box_gap(point, TrackedPose(*seen[name], 0.0), scene.objects[name]) <= Tolerances().reach:
                yield hand


def _pose(name: str, value: Any) -> tuple[Array, Array]:
    """Return rotation (3, 3) and position (3,) [m] of a (4, 4) matrix."""
    try:
        matrix = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        matrix = np.zeros(0)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise LgpError(f"the pose of {name} is {shown(value)}, expected a (4, 4) matrix of finite numbers [m]")
    rotation = matrix[:3, :3]
    proper = np.abs(rotation.T @ rotation - np.eye(3)).max() <= ORTHONORMAL and np.linalg.det(rotation) > 0.0
    if not proper or np.abs(matrix[3] - (0.0, 0.0, 0.0, 1.0)).max() > ORTHONORMAL:
        raise LgpError(f"the pose of {name} is no rotation and translation, expected [[R, p], [0, 0, 0, 1]]")
    return rotation, matrix[:3, 3]
