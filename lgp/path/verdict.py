"""Why a sequence fails, in words: which constraint, by how much, in which phase."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lgp.path.problem import PathProblem

Array = NDArray[np.float64]

FINE = 1e-4
"""[m, rad] Violations below this are not worth a word."""


def reason(problem: PathProblem, x: Array) -> str:
    """Return the constraint that fails most at x (n,), "" if all hold.

    Example of a result: `phase 1, grasp(1, baxter.left, screwdriver): baxter.left stays 0.496 m away from screwdriver
    on table.start`.
    """
    values = problem.rows.evaluate(*problem.split(x))
    size = 3 * len(problem.rows.enforced) * 2
    jumps = values.equality[:size].reshape(-1, 6)
    words: list[tuple[float, str]] = []
    for number, jump in zip(problem.rows.enforced, jumps, strict=True):
        away, turned = float(np.linalg.norm(jump[:3])), float(np.linalg.norm(jump[3:]))
        words.append((away + turned, f"{_where(problem, number)}: {_jump(problem, number, away, turned)}"))
    for row, value in zip(problem.rows.eq_rows[size:], values.equality[size:], strict=True):
        if row.kind == "sole":
            words.append(
                (
                    abs(value),
                    f"{_slice(problem, row.number)}: {row.name} leaves the ground by {_amount(value, row.unit)}",
                )
            )
    for row, value in zip(problem.rows.in_rows, values.inequality, strict=True):
        if row.kind == "tilt":
            words.append((value, f"{_where(problem, row.number)}: {row.name} {_tilt(problem, row.name, value)}"))
        else:
            words.append((value, f"{_slice(problem, row.number)}: the {row.name} leg is too short by {value:.3f} m"))
    amount, text = max(words, default=(0.0, ""))
    return text if amount > FINE else ""


def _jump(problem: PathProblem, number: int, away: float, turned: float) -> str:
    switch = problem.phases.switches[number]
    table = switch.table or problem.modes.holder(switch.thing, number).by
    if away > FINE:
        what = f"{switch.thing} on {table}" if switch.kind == "grasp" else f"where {switch.thing} lies on {table}"
        more = f", turned by {np.degrees(turned):.1f} deg" if turned > FINE else ""
        return f"{switch.hand} stays {away:.3f} m away from {what}{more}"
    return f"{switch.hand} cannot turn as {switch.thing} lies on {table}, {np.degrees(turned):.1f} deg are missing"


def _tilt(problem: PathProblem, hand: str, value: float) -> str:
    limit = problem.world.scene.hands[hand].tilt
    tilted = np.degrees(np.arccos(np.clip(np.cos(np.radians(limit)) - value, -1.0, 1.0)))
    return f"must tilt by {tilted:.0f} deg, {tilted - limit:.1f} deg more than it may"


def _where(problem: PathProblem, number: int) -> str:
    return f"phase {number + 1}, {problem.phases.label(number)}"


def _slice(problem: PathProblem, at: int) -> str:
    slice_ = int(problem.kept[at])
    return f"phase {slice_ // problem.phases.slices + 1}"


def _amount(value: float, unit: str) -> str:
    return f"{abs(value):.3f} m" if unit == "m" else f"{np.degrees(abs(value)):.1f} deg"
