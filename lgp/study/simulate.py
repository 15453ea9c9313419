"""Simulated study from plans: persons of varying stature follow each plan, one MCAP log per person and condition.

Every log is marked as simulated, in its `study` record and in a record `simulation` with the parameters.
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
from reba.arrays import Array
from reba.files import as_json, write_folder
from reba.outputs import FolderOutput, check_outputs
from reba.posture.columns import INDEX
from reba.posture.table import table_of
from reba.writers import write_postures

SIMULATION: Final = "simulation"
"""Name of the metadata record with the parameters of the simulation."""


@dataclass(frozen=True)
class Log:
    """Simulated recording: its label, the person's stature [m], the retargeted plan, and the movement."""

    label: Label
    stature: float
    motion: RetargetedMotion
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
    """Write a simulated study; return file, participant, condition, stature [m] and seconds of each log.

    Args:
        plans: condition -> plan, or the folder of `lgp plan -o`; the same plan under two names gives no effect.
        folder: of the logs; must not contain other recordings.
        rate: frames per second.
        offsets: condition -> angle column -> degrees added to every frame: an effect of known size.

    Raises:
        LgpError: a plan cannot be used, an offset names no angle, or the folder contains other recordings.
        RebaError: a log cannot be written.
    """
    output = Path(folder)
    names = {condition: _slug(condition) for condition in plans}
    if len(set(names.values())) < len(names):
        raise LgpError(
            f"conditions {', '.join(plans)} give the same file names; choose names that differ in letters or digits"
        )
    width = max(2, len(str(participants)))
    files = {f"{_name(n, width)}_{slug}.mcap" for n in range(participants) for slug in names.values()}
    _check_folder(output, files)
    logs = simulated(plans, participants=participants, seed=seed, rate=rate, vary=vary, offsets=offsets)
    rows: list[dict[str, Any]] = []

    def write(part: Path) -> None:
        for log in logs:
            path = part / f"{log.label.participant}_{names[log.label.condition]}.mcap"
            records = {RECORD: log.label.record(), SIMULATION: _parameters(log, plans, seed, vary, offsets)}
            write_postures(table_of(log.movement.table()), path, records=records)
            rows.append(
                {
                    "file": path.name, "participant": log.label.participant, "condition": log.label.condition,
                    "stature": log.stature, "seconds": float(log.movement.time[-1]),
                }
            )  # fmt: skip

    write_folder(output, write)
    return rows


def simulated(
    plans: Mapping[str, Plan | str | Path | Retarget],
    *,
    participants: int = 10,
    seed: int = 0,
    rate: float = 30.0,
    vary: MotionVariability = VARIATION,
    offsets: Mapping[str, Mapping[str, float]] | None = None,
) -> Iterator[Log]:
    """Simulated recordings one after another, without files; arguments as in `simulate`.

    Raises:
        LgpError: a plan cannot be used, or an offset names no angle or condition.
    """
    loaded: dict[str, Retarget] = {}
    retargets = {condition: _retarget(plan, loaded) for condition, plan in plans.items()}
    shifts = {condition: _offset(condition, (offsets or {}).get(condition, {})) for condition in plans}
    if unknown := sorted(set(offsets or {}) - set(plans)):
        raise LgpError(f"offset for {unknown[0]!r}, which is no condition; expected {', '.join(plans)}")
    return _draw(retargets, shifts, participants, seed, rate, vary)


def _draw(
    retargets: Mapping[str, Retarget],
    shifts: Mapping[str, Array],
    participants: int,
    seed: int,
    rate: float,
    vary: MotionVariability,
) -> Iterator[Log]:
    width = max(2, len(str(participants)))
    for number in range(participants):
        participant = person(np.random.default_rng([seed, number]), vary)
        for index, (condition, retarget) in enumerate(retargets.items()):
            motion = retarget.motion(participant.stature)
            rng = np.random.default_rng([seed, number, index + 1])
            movement = perform(motion, participant, rng, rate=rate, vary=vary, offset=shifts[condition])
            label = Label(_name(number, width), condition, simulated=True)
            yield Log(label, participant.stature, motion, movement)


def _retarget(plan: Plan | str | Path | Retarget, loaded: dict[str, Retarget]) -> Retarget:
    """Retargeting of a plan; a folder that several conditions share is read once."""
    if isinstance(plan, Retarget):
        return plan
    if isinstance(plan, Plan):
        return Retarget(plan)
    if str(plan) not in loaded:
        loaded[str(plan)] = Retarget(Plan.load(plan), str(plan))
    return loaded[str(plan)]


def _offset(condition: str, degrees: Mapping[str, float]) -> Array:
    offset = np.zeros(len(INDEX))
    for column, value in degrees.items():
        if column not in INDEX:
            raise LgpError(f"offset of {condition}: {column!r} is no angle column; expected a name of reba.COLUMNS")
        offset[INDEX[column]] = value
    return offset


def _parameters(
    log: Log,
    plans: Mapping[str, Plan | str | Path],
    seed: int,
    vary: MotionVariability,
    offsets: Mapping[str, Mapping[str, float]] | None,
) -> dict[str, str]:
    """Parameters of the simulation of a log, as text by key."""
    plan = plans[log.label.condition]
    scene = plan.scene.name if isinstance(plan, Plan) else Path(plan).name
    return {
        "simulated": "true",
        "note": "made by a program from a plan; no person was recorded",
        "plan": scene,
        "stature": f"{log.stature:.3f}",
        "retargeted": "posture retargeted to the stature of the person, hand positions of the plan; not planned again",
        "largest_miss": f"{log.motion.miss:.4f}",
        "seed": str(seed),
        "variation": as_json(asdict(vary)),
        "offsets": as_json((offsets or {}).get(log.label.condition, {})),
    }


def _check_folder(folder: Path, files: set[str]) -> None:
    check_outputs(FolderOutput(folder, tuple(files)), error=LgpError)
    others = sorted(path.name for path in folder.glob("*.mcap") if path.name not in files)
    if others:
        raise LgpError(f"{folder}: contains other recordings ({others[0]}), expected none; give a new folder")


def _name(number: int, width: int) -> str:
    return f"sim{number + 1:0{width}d}"


def _slug(condition: str) -> str:
    return re.sub(r"[^\w.-]+", "-", condition).strip("-.") or "condition"
