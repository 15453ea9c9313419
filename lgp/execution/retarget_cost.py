"""What retargeting costs: a retargeted motion, and all later ones retargeted in turn, against a new plan."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from lgp.errors import LgpError
from lgp.execution.executive import RetargetedAction
from lgp.execution.fixed_path import FixedPathBounds, holding_hands
from lgp.execution.predicates import closed_grippers
from lgp.execution.retarget import ActionMotion, Planner
from lgp.execution.tracking import Observation, TrackedPose, TrackedWorld
from lgp.kinematics.modes import ModeSequence
from lgp.logic.task import numbered
from lgp.path.partial_order import one_at_a_time
from lgp.path.phases import Phases
from lgp.scene.model import Scene
from lgp.search.records import BoundResult


def retarget_cost(planner: Planner, retargeted: RetargetedAction, seconds: float) -> dict[str, Any]:
    """Return the cost of a retargeted motion and of all later ones retargeted in turn, against that of a new plan.

    The new plan is the better of two, as solutions of path problems are local: the result of a search of `seconds`
    wall-clock time, and the retargeted motions optimised as a whole.

    Returns:
        `action`, costs `greedy` (retargeted) and `anew` (new plan), their difference `extra` and its `share` of the new
        plan, `actions` of the new plan and `same_actions`: whether they are the remaining ones. A cost without path
        is None.
    """
    own = planner.snapshot()
    own.use(retargeted.motion)
    number, phase, scene = retargeted.number, retargeted.phase, retargeted.phase.scene
    remaining = [str(action) for action in own.actions[number:]]
    comparison: dict[str, Any] = {"action": own.motion.phases.label(number), "extra": None, "share": None}
    if scene is None:
        return comparison
    greedy_phases = _greedy(own, number, phase)
    greedy, whole = (None, None) if greedy_phases is None else _costs(own, number, scene, greedy_phases)
    plan = own.replan(number, scene, phase.trajectory.knots[0], seconds, thorough=True)
    labels = [label for label, _ in numbered(plan.actions)]
    replanned = float(plan.costs["total"]) if plan.feasible else None
    if whole is not None and (replanned is None or whole < replanned):
        replanned, labels = whole, remaining
    comparison |= {"greedy": greedy, "anew": replanned, "actions": labels, "same_actions": labels == remaining}
    if greedy is not None and replanned is not None:
        comparison |= {"extra": greedy - replanned, "share": (greedy - replanned) / replanned}
    return comparison


def _greedy(planner: Planner, number: int, phase: ActionMotion) -> list[ActionMotion] | None:
    """Return the retargeted motion and all later ones, each retargeted in turn; None if one is infeasible."""
    phases = [phase]
    for later in range(number + 1, len(planner.actions)):
        view = _after(planner, later - 1, phases[-1])
        following = planner.retarget(later, planner.scene(later, view), view.now.q, pause=True)
        if isinstance(following, str):
            return None
        phases.append(following)
    return phases


def _costs(planner: Planner, number: int, scene: Scene, phases: list[ActionMotion]) -> tuple[float, float | None]:
    """Return the cost of successive motions, and of their joint optimum (None: infeasible)."""
    solutions = [phase.solution for phase in phases if phase.solution is not None]
    keys = np.stack([phase.trajectory.knots[-1] for phase in phases])
    variables = np.concatenate([solution.variables for solution in solutions])
    path = np.concatenate([phase.trajectory.knots[1:] for phase in phases])
    world, start = planner.motion.world.with_scene(scene), phases[0].trajectory.knots[0]
    slices = planner.motion.phases.slices
    bounds = FixedPathBounds(
        world,
        planner.ergonomics(),
        initial_configuration=start,
        slices=slices,
        collisions=planner.collision_free,
        holding=holding_hands(planner.motion.modes, number),
    )
    actions = one_at_a_time(planner.actions[number:])
    problem = bounds.problem("path", bounds.phases(actions))
    greedy = problem.costs(problem.join(path, variables)).total
    first = replace(solutions[-1], keyframes=keys, variables=variables, path=None, minima=())
    result = bounds.solve("path", actions, BoundResult(True, greedy, payload=first))
    return greedy, result.cost if result.feasible else None


def _after(planner: Planner, number: int, phase: ActionMotion) -> TrackedWorld:
    """Return the world after a retargeted motion as if tracked at rest for a window."""
    scene, action = phase.scene, planner.actions[number]
    if scene is None or phase.solution is None:
        raise LgpError("expected a retargeted motion: only those have a scene and a solution")
    world, q = planner.motion.world.with_scene(scene), phase.trajectory.knots[-1]
    modes = ModeSequence(world, Phases.of(scene, (action,)).switches)
    kinematics = world.at(q[None], modes.frames)
    poses = {}
    for name in scene.objects:
        pose = modes.pose(name, 1, kinematics, phase.solution.variables)
        poses[name] = pose.rotation[0], pose.position[0]
    view = TrackedWorld(world)
    closed = closed_grippers(scene, planner.task.holding(planner.states[number + 1]))
    for time in (0.0, view.tolerances.window):
        view.add(Observation(time, q, {name: TrackedPose(*pose, time) for name, pose in poses.items()}, closed))
    return view
