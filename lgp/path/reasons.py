"""Reasons why there is no path: the constraint that fails most, in words."""

from __future__ import annotations

import numpy as np

from lgp.path.joint_speeds import too_fast
from lgp.path.mode_constraints import SPARE_SHARE, ConstraintInfo
from lgp.path.problem import PathProblem
from lgp.scene.footing import LEAST_SHARE, footprint
from reba.arrays import Array

REPORTED = 1e-4
"""[m, rad] Smallest violation that is reported: below it a constraint counts as met."""
REPORTED_TURN = 1e-3
"""[rad] Smallest rotation that is reported beside a distance."""

NAMED = 2
"""Number of pairs of bodies that are named."""


def explain_infeasibility(problem: PathProblem, x: Array) -> str:
    """Return a sentence on the constraint that is violated most at x (n,), "" if all are satisfied.

    Where a hand does not reach its place, bodies that are as near to each other then as they may be are named too.

    Example: `phase 1, grasp(1, baxter.left, screwdriver): baxter.left cannot reach screwdriver on table.start: 0.496 m
    short`.
    """
    values = problem.constraints.evaluate(*problem.split(x))
    messages: list[tuple[float, str]] = []
    switches: dict[tuple[int, str], list[float]] = {}
    for row, value in zip(problem.constraints.eq_rows, values.equality, strict=True):
        if row.kind in ("pose_continuity", "tool", "joint"):
            switches.setdefault((row.number, row.kind), []).append(float(value))
        elif row.kind == "sole":
            text = f"{row.name} is off the ground by {_amount(value, row.unit)}"
            messages.append((abs(value), f"{_phase_of_knot(problem, row.number)}: {text}"))
        elif row.kind == "action":
            messages.append((abs(value), _of_action(problem, row, abs(value))))
    for (number, kind), difference in switches.items():
        distance, angle = float(np.linalg.norm(difference[:3])), float(np.linalg.norm(difference[3:]))
        if kind == "joint" and len(difference) == 3:
            distance, angle = float(np.linalg.norm(difference[:2])), abs(difference[2])
        explain = {"pose_continuity": _pose_continuity, "tool": _tool, "joint": _joint}[kind]
        text = explain(problem, number, distance, angle) + _blocking_pairs(problem, number, values.inequality)
        messages.append((distance + angle, f"{_phase_of_switch(problem, number)}: {text}"))
    for row, value in zip(problem.constraints.in_rows, values.inequality, strict=True):
        if row.kind == "tilt":
            messages.append((value, f"{_phase_of_switch(problem, row.number)}: {_tilt(problem, row.name, value)}"))
        elif row.kind == "hands":
            text = f"{row.name} come {value:.3f} m nearer to each other than grip points may"
            messages.append((value, f"{_phase_of_switch(problem, row.number)}: {text}"))
        elif row.kind == "footing":
            messages.append((value, f"{_phase_of_switch(problem, row.number)}: {_footing(problem, row.number, value)}"))
        elif row.kind == "speed":
            at = int(problem.knots[row.number]) // problem.phases.slices
            longest = too_fast(problem.world, problem.phases, problem.initial_configuration, problem.path(x))
            text = longest or f"phase {at + 1}: {row.name} is too fast"
            messages.append((value, text))
        elif row.kind == "limit":
            text = f"{row.name} is {_amount(value, row.unit)} beyond its limit"
            messages.append((value, f"{_phase_of_knot(problem, row.number)}: {text}"))
        elif row.kind == "action":
            messages.append((value, _of_action(problem, row, value)))
        elif row.kind == "collision":
            messages.append((value, f"{_phase_of_knot(problem, row.number)}: {_collision(row.name, value)}"))
        else:
            text = f"the straighter leg of {row.name} is {value:.3f} m too short"
            messages.append((value, f"{_phase_of_knot(problem, row.number)}: {text}"))
    amount, text = max(messages, default=(0.0, ""))
    return text if amount > REPORTED else ""


def _blocking_pairs(problem: PathProblem, number: int, inequality: Array) -> str:
    """Return which bodies are as near to each other at a switch as they may be, "" if none are."""
    end = problem.phases.keyframes[number]
    near = {
        row.name: value
        for row, value in zip(problem.constraints.in_rows, inequality, strict=True)
        if row.kind == "collision" and value > -REPORTED and problem.knots[row.number] == end
    }
    if not near:
        return ""
    first = sorted(near, key=lambda name: -near[name])[:NAMED]
    more = f" and {len(near) - NAMED} other pairs" if len(near) > NAMED else ""
    return f", while {', '.join(first)}{more} keep their distance"


def _pose_continuity(problem: PathProblem, number: int, distance: float, angle: float) -> str:
    switch = problem.phases.switches[number]
    name, hand = switch.object_name, switch.hand
    parent = switch.table or problem.modes.attachment(name, number).parent
    at = f"in {parent}" if parent in problem.world.scene.hands else f"on {parent}"
    if distance > REPORTED:
        target = f"the place of {name} {at}" if switch.action.attaches_to == "table" else f"{name} {at}"
        rotation = f" and {np.degrees(angle):.1f} deg" if angle > REPORTED_TURN else ""
        return f"{hand} cannot reach {target}: {distance:.3f} m{rotation} short"
    return f"{hand} cannot turn as {name} lies {at}: {np.degrees(angle):.1f} deg short"


def _tool(problem: PathProblem, number: int, distance: float, angle: float) -> str:
    switch = problem.phases.switches[number]
    rotation = f" and {np.degrees(angle):.1f} deg" if angle > REPORTED else ""
    return f"{switch.hand} cannot reach its place behind the screw: {distance:.3f} m{rotation} short"


def _joint(problem: PathProblem, number: int, distance: float, angle: float) -> str:
    switch = problem.phases.switches[number]
    parents = {part: problem.modes.attachment(part, number).parent for part in (switch.object_name, switch.other)}
    rotation = f" and {np.degrees(angle):.1f} deg" if angle > REPORTED_TURN else ""
    parts = " and ".join(f"{part} on {parent}" for part, parent in parents.items())
    return f"{parts} are {distance:.3f} m{rotation} from where they are joined"


def _tilt(problem: PathProblem, hand: str, value: float) -> str:
    limit = problem.world.scene.hands[hand].tilt
    tilt = np.degrees(np.arccos(np.clip(np.cos(np.radians(limit)) - value, -1.0, 1.0)))
    return f"{hand} is tilted by {tilt:.0f} deg, {tilt - limit:.1f} deg above its limit"


def _footing(problem: PathProblem, number: int, value: float) -> str:
    switch, scene = problem.phases.switches[number], problem.world.scene
    side = 2.0 * float(np.sqrt(footprint(scene.objects[switch.object_name]).prod()))
    share = LEAST_SHARE + SPARE_SHARE - value / side
    return f"{100 * share:.0f} % of the footprint of {switch.object_name} is on {switch.table}, half of it has to be"


def _collision(name: str, value: float) -> str:
    first, _, second = name.partition(" and ")
    return f"{first} comes {value:.3f} m nearer to {second} than it may"


def _of_action(problem: PathProblem, row: ConstraintInfo, value: float) -> str:
    amount = _amount(value, row.unit) if row.unit else f"{value:.3f}"
    return f"{_phase_of_switch(problem, row.number)}: not met by {amount}: {row.name}"


def _phase_of_switch(problem: PathProblem, number: int) -> str:
    return f"phase {problem.phases.phase_of[number] + 1}, {problem.phases.label(number)}"


def _phase_of_knot(problem: PathProblem, at: int) -> str:
    return f"phase {int(problem.knots[at]) // problem.phases.slices + 1}"


def _amount(value: float, unit: str) -> str:
    return f"{abs(value):.3f} m" if unit == "m" else f"{np.degrees(abs(value)):.1f} deg"
