"""Why a sequence fails, in words: which constraint, by how much, in which phase."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lgp.path.collision_rows import MARGIN
from lgp.path.problem import PathProblem

Array = NDArray[np.float64]

FINE = 1e-4
"""[m, rad] Violations below this are not worth a word."""
TURNED = 1e-3
"""[rad] Turns below this are not worth a word beside a distance."""


def reason(problem: PathProblem, x: Array) -> str:
    """Return the constraint that fails most at x (n,), "" if all hold.

    Example of a result: `phase 1, grasp(1, baxter.left, screwdriver): baxter.left stays 0.496 m away from screwdriver
    on table.start`.
    """
    values = problem.rows.evaluate(*problem.split(x))
    words: list[tuple[float, str]] = []
    switches: dict[tuple[int, str], list[float]] = {}
    for row, value in zip(problem.rows.eq_rows, values.equality, strict=True):
        if row.kind in ("jump", "screw", "joint"):
            switches.setdefault((row.number, row.kind), []).append(float(value))
        elif row.kind == "sole":
            text = f"{row.name} leaves the ground by {_amount(value, row.unit)}"
            words.append((abs(value), f"{_slice(problem, row.number)}: {text}"))
    for (number, kind), difference in switches.items():
        away, turned = float(np.linalg.norm(difference[:3])), float(np.linalg.norm(difference[3:]))
        if kind == "joint" and len(difference) == 3:
            away, turned = float(np.linalg.norm(difference[:2])), abs(difference[2])
        say = {"jump": _jump, "screw": _screw, "joint": _joint}[kind]
        words.append((away + turned, f"{_where(problem, number)}: {say(problem, number, away, turned)}"))
    for row, value in zip(problem.rows.in_rows, values.inequality, strict=True):
        if row.kind == "tilt":
            words.append((value, f"{_where(problem, row.number)}: {row.name} {_tilt(problem, row.name, value)}"))
        elif row.kind == "collision":
            words.append((value, f"{_slice(problem, row.number)}: {_touch(row.name, value)}"))
        else:
            words.append((value, f"{_slice(problem, row.number)}: the {row.name} leg is too short by {value:.3f} m"))
    amount, text = max(words, default=(0.0, ""))
    return text if amount > FINE else ""


def _jump(problem: PathProblem, number: int, away: float, turned: float) -> str:
    switch = problem.phases.switches[number]
    by = switch.table or problem.modes.holder(switch.thing, number).by
    at = f"in {by}" if by in problem.world.scene.hands else f"on {by}"
    if away > FINE:
        what = f"where {switch.thing} lies {at}" if switch.kind == "place" else f"{switch.thing} {at}"
        more = f", turned by {np.degrees(turned):.1f} deg" if turned > TURNED else ""
        return f"{switch.hand} stays {away:.3f} m away from {what}{more}"
    return f"{switch.hand} cannot turn as {switch.thing} lies {at}, {np.degrees(turned):.1f} deg are missing"


def _screw(problem: PathProblem, number: int, away: float, turned: float) -> str:
    switch = problem.phases.switches[number]
    skew = f", {np.degrees(turned):.1f} deg aslant" if turned > FINE else ""
    return f"{switch.hand} stays {away:.3f} m away from its place behind the screw{skew}"


def _joint(problem: PathProblem, number: int, away: float, turned: float) -> str:
    switch = problem.phases.switches[number]
    places = [f"{part} on {problem.modes.holder(part, number).by}" for part in (switch.thing, switch.other)]
    more = f" and {np.degrees(turned):.1f} deg" if turned > TURNED else ""
    return f"{' and '.join(places)} stand {away:.3f} m{more} from where they are joined"


def _tilt(problem: PathProblem, hand: str, value: float) -> str:
    limit = problem.world.scene.hands[hand].tilt
    tilted = np.degrees(np.arccos(np.clip(np.cos(np.radians(limit)) - value, -1.0, 1.0)))
    return f"must tilt by {tilted:.0f} deg, {tilted - limit:.1f} deg more than it may"


def _touch(name: str, value: float) -> str:
    first, _, second = name.partition(" and ")
    if value > MARGIN:
        return f"{first} goes {value - MARGIN:.3f} m into {second}"
    return f"{first} comes {value:.3f} m nearer to {second} than the {MARGIN:g} m that are kept"


def _where(problem: PathProblem, number: int) -> str:
    return f"phase {number + 1}, {problem.phases.label(number)}"


def _slice(problem: PathProblem, at: int) -> str:
    slice_ = int(problem.kept[at])
    return f"phase {slice_ // problem.phases.slices + 1}"


def _amount(value: float, unit: str) -> str:
    return f"{abs(value):.3f} m" if unit == "m" else f"{np.degrees(abs(value)):.1f} deg"
