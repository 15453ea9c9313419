"""What it cost to move one motion instead of planning anew: both rolled out from the same moment.

The greedy rest is the moved motion, and every later action moved in its turn, solved one after the other from where the
one before ends; the other is a full new plan. Both are measured by the same path problem on the same scene.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lgp.errors import LgpError
from lgp.execution.executive import Shift
from lgp.execution.grippers import grips_after
from lgp.execution.idle import still_hands
from lgp.execution.observation import Observation, Sighting, View
from lgp.execution.pinned import PinnedBounds
from lgp.execution.planner import Phase, Planner
from lgp.path.phases import Phases
from lgp.search import BoundResult
from lgp.world.scene import Scene
from lgp.world.switches import Modes

Array = NDArray[np.float64]


def compare(planner: Planner, shift: Shift, seconds: float) -> dict[str, Any]:
    """Return the costs of a moved motion with its greedy rest, of a new plan, and their difference.

    The new plan is the better of two: what a search finds, and the greedy rest optimised as a whole, as solutions of
    path problems are local.

    Args:
        planner: of the run.
        shift: the motion that was moved.
        seconds: wall-clock time for the search.

    Returns:
        action, greedy, anew, extra (greedy - anew), share (extra / anew), actions of the new plan, whether they differ
        from those that were left; costs are None where there is no such path.
    """
    own = planner.as_it_is()
    own.use(shift.motion)
    phase, scene = shift.phase, shift.phase.scene
    left = [str(action) for action in own.actions[shift.number :]]
    found: dict[str, Any] = {"action": own.actions[shift.number].at(shift.number + 1), "extra": None, "share": None}
    if scene is None:
        return found
    rest = _greedy(own, shift.number, phase)
    greedy, whole = (None, None) if rest is None else _costs(own, shift.number, scene, rest)
    new = own.anew(shift.number, scene, phase.segment.knots[0], seconds, thorough=True)
    labels = [label.replace(f"({at + 1}, ", "(") for at, label in enumerate(new.actions)]
    anew = float(new.costs["total"]) if new.feasible else None
    if whole is not None and (anew is None or whole < anew):
        anew, labels = whole, left
    found |= {"greedy": greedy, "anew": anew, "actions": labels, "same_actions": labels == left}
    if greedy is not None and anew is not None:
        found |= {"extra": greedy - anew, "share": (greedy - anew) / anew}
    return found


def _greedy(planner: Planner, number: int, phase: Phase) -> list[Phase] | None:
    """Return the moved motion and all later ones, each moved in its turn; None if one is infeasible."""
    found = [phase]
    for later in range(number + 1, len(planner.actions)):
        view = _after(planner, later - 1, found[-1])
        following = planner.retarget(later, planner.scene(later, view), view.now.q, pause=True)
        if isinstance(following, str):
            return None
        found.append(following)
    return found


def _costs(planner: Planner, number: int, scene: Scene, rest: list[Phase]) -> tuple[float, float | None]:
    """Return the cost of motions one after the other, and when they are optimised as a whole (None: it failed)."""
    solutions = [phase.solution for phase in rest if phase.solution is not None]
    keys = np.stack([phase.segment.knots[-1] for phase in rest])
    variables = np.concatenate([solution.variables for solution in solutions])
    path = np.concatenate([phase.segment.knots[1:] for phase in rest])
    world, start = planner.motion.world.with_scene(scene), rest[0].segment.knots[0]
    slices = planner.motion.phases.slices
    bounds = PinnedBounds(
        world,
        planner.ergonomics(),
        start=start,
        slices=slices,
        collisions=planner.apart,
        still=still_hands(planner.motion.modes, number),
    )
    actions = planner.actions[number:]
    problem = bounds.problem("path", bounds.phases(actions))
    greedy = problem.costs(problem.join(path, variables)).total
    first = replace(solutions[-1], keys=keys, variables=variables, path=None)
    found = bounds.solve("path", actions, BoundResult(True, greedy, payload=first))
    return greedy, found.cost if found.feasible else None


def _after(planner: Planner, number: int, phase: Phase) -> View:
    """Return the world as it is after a moved motion, as if it had been tracked at rest for a while."""
    scene, action = phase.scene, planner.actions[number]
    if scene is None or phase.solution is None:
        raise LgpError("only a motion that was moved knows the world it ends in")
    world, q = planner.motion.world.with_scene(scene), phase.segment.knots[-1]
    modes = Modes(world, Phases.of(scene, (action,)).switches)
    kinematics = world.at(q[None], modes.frames)
    poses = {}
    for name in scene.things:
        pose = modes.pose(name, 1, kinematics, phase.solution.variables)
        poses[name] = pose.rotation[0], pose.position[0]
    view = View(world)
    closed = {thing.hand for thing in scene.things.values() if thing.hand and not thing.hand.startswith("human.")}
    for time in (0.0, view.tolerances.window):
        things = {name: Sighting(*pose, time) for name, pose in poses.items()}
        view.add(Observation(time, q, things, frozenset(closed)))
        for hand, shut in grips_after(planner.task, action, view):
            (closed.add if shut else closed.discard)(hand)
    view.add(Observation(view.now.time, q, view.now.things, frozenset(closed)))
    return view
