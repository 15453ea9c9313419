"""A simulated study from plans: people of varying stature follow each plan, one MCAP log per person and condition.

Every log says that it is simulated, in its `study` record and in a record `simulation` with how it was made.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from lgp.errors import LgpError
from lgp.plan_record import Plan
from lgp.study.labels import RECORD, Label
from lgp.study.movement import VARIATION, MotionVariability, Movement, perform, person
from lgp.study.retarget import Retarget, RetargetedMotion
from reba._version import __version__
from reba.arrays import Array
from reba.files import as_json
from reba.posture.columns import INDEX
from reba.posture.table import table_of
from reba.writers import write_postures

SIMULATION: Final = "simulation"
"""Name of the metadata record that says how a log was made."""


@dataclass(frozen=True)
class Log:
    """A simulated recording: its label, the person's stature [m], the course that was followed, the movement."""

    label: Label
    stature: float
    course: RetargetedMotion
    movement: Movement


def simulate(
    plans: Mapping[str, Plan | str | Path],
    folder: str | Path,
    *,
    participants: int = 10,
    seed: int = 0,
    rate: float = 30.0,
    vary: MotionVariability = VARIATION,
    offsets: Mapping[str, Mapping[str, float]] | None = None,
) -> list[dict[str, Any]]:
    """Write a simulated study; return file, participant, condition, stature and seconds of each log.

    Args:
        plans: condition -> plan, or the folder that `lgp plan -o` wrote; the same plan twice has no effect.
        folder: for the logs; it must hold no other recordings.
        participants: number of people.
        seed: of all draws.
        rate: frames a second.
        vary: how people vary.
        offsets: condition -> angle column -> degrees added throughout: an effect of known size.

    Raises:
        LgpError: a plan cannot be used, an offset names no angle, or the folder holds other recordings.
        RebaError: a log cannot be written.

    Example:
        >>> simulate({"ergonomic": "plan_a", "non-ergonomic": "plan_b"}, "logs")     # doctest: +SKIP
    """
    place = Path(folder)
    names = {condition: _slug(condition) for condition in plans}
    if len(set(names.values())) < len(names):
        raise LgpError(f"conditions {', '.join(plans)} give the same file names; name them more differently")
    logs = simulated(plans, participants=participants, seed=seed, rate=rate, vary=vary, offsets=offsets)
    width = max(2, len(str(participants)))
    ours = {f"{_name(n, width)}_{slug}.mcap" for n in range(participants) for slug in names.values()}
    _check_folder(place, ours)
    made = []
    for log in logs:
        path = place / f"{log.label.participant}_{names[log.label.condition]}.mcap"
        records = {RECORD: log.label.record(), SIMULATION: _about(log, plans, seed, vary, offsets)}
        write_postures(table_of(log.movement.table()), path, records=records)
        made.append(
            {
                "file": path.name, "participant": log.label.participant, "condition": log.label.condition,
                "stature": log.stature, "seconds": float(log.movement.time[-1]),
            }
        )  # fmt: skip
    return made


def simulated(
    plans: Mapping[str, Plan | str | Path | Retarget],
    *,
    participants: int = 10,
    seed: int = 0,
    rate: float = 30.0,
    vary: MotionVariability = VARIATION,
    offsets: Mapping[str, Mapping[str, float]] | None = None,
) -> Iterator[Log]:
    """Return the recordings one after another, without files; arguments as in `simulate`.

    Raises:
        LgpError: a plan cannot be used, or an offset names no angle or condition.
    """
    known: dict[str, Retarget] = {}
    bodies = {condition: _retarget(plan, known) for condition, plan in plans.items()}
    shifts = {condition: _offset(condition, (offsets or {}).get(condition, {})) for condition in plans}
    if unknown := sorted(set(offsets or {}) - set(plans)):
        raise LgpError(f"offset for {unknown[0]!r}, which is no condition; there are {', '.join(plans)}")
    return _draw(bodies, shifts, participants, seed, rate, vary)


def _draw(
    bodies: Mapping[str, Retarget],
    shifts: Mapping[str, Array],
    participants: int,
    seed: int,
    rate: float,
    vary: MotionVariability,
) -> Iterator[Log]:
    width = max(2, len(str(participants)))
    for number in range(participants):
        who = person(np.random.default_rng([seed, number]), vary)
        for place, (condition, body) in enumerate(bodies.items()):
            course = body.course(who.stature)
            rng = np.random.default_rng([seed, number, place + 1])
            movement = perform(course, who, rng, rate=rate, vary=vary, offset=shifts[condition])
            label = Label(_name(number, width), condition, simulated=True)
            yield Log(label, who.stature, course, movement)


def _retarget(plan: Plan | str | Path | Retarget, known: dict[str, Retarget]) -> Retarget:
    """Return the plan ready for other statures; the same folder is read once."""
    if isinstance(plan, Retarget):
        return plan
    if isinstance(plan, Plan):
        return Retarget(plan)
    if str(plan) not in known:
        known[str(plan)] = Retarget(Plan.load(plan), str(plan))
    return known[str(plan)]


def _offset(condition: str, degrees: Mapping[str, float]) -> Array:
    found = np.zeros(len(INDEX))
    for column, value in degrees.items():
        if column not in INDEX:
            raise LgpError(f"offset of {condition}: {column!r} is no angle; use names of reba.COLUMNS")
        found[INDEX[column]] = value
    return found


def _about(
    log: Log,
    plans: Mapping[str, Plan | str | Path],
    seed: int,
    vary: MotionVariability,
    offsets: Mapping[str, Mapping[str, float]] | None,
) -> dict[str, str]:
    """Return how a log was made, as text by key."""

    plan = plans[log.label.condition]
    scene = plan.scene.name if isinstance(plan, Plan) else Path(plan).name
    return {
        "simulated": "true",
        "note": "made by a program from a plan; no person was recorded",
        "plan": scene,
        "stature": f"{log.stature:.3f}",
        "retargeted": "posture moved to the stature of the person, hands where the plan has them; not planned again",
        "largest_miss": f"{log.course.miss:.4f}",
        "seed": str(seed),
        "variation": as_json(asdict(vary)),
        "offsets": as_json((offsets or {}).get(log.label.condition, {})),
        "version": __version__,
    }


def _check_folder(folder: Path, ours: set[str]) -> None:
    if not folder.exists():
        return
    if not folder.is_dir():
        raise LgpError(f"{folder}: this is a file; give a folder for the logs")
    others = sorted(path.name for path in folder.glob("*.mcap") if path.name not in ours)
    if others:
        raise LgpError(f"{folder}: it holds other recordings ({others[0]}), which would be mixed up; give a new folder")


def _name(number: int, width: int) -> str:
    return f"sim{number + 1:0{width}d}"


def _slug(condition: str) -> str:
    return re.sub(r"[^\w.-]+", "-", condition).strip("-.") or "condition"
