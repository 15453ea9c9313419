"""Joints of a plan: limits, speeds, joints that follow others, and legs that are long enough."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from lgp.audit.agents import AgentModel
from lgp.audit.faults import LEVEL, TOUCHING, Extreme, Fault
from lgp.audit.joint_tree import attached, place, values_of
from lgp.audit.samples import PER_SLICE, Samples
from lgp.kinematics.leg_ik import solve_legs
from lgp.scene.joint_units import unit_of
from lgp.scene.mobile_base import standing_from
from lgp.scene.model import Human

SLACK: Final = 1e-4
"""[rad, m] Beyond a limit of a joint that is rounding."""
SPEED_SLACK: Final = 0.001
"""Share of a limit of speed that is rounding."""


def fastest(samples: Samples) -> tuple[Extreme, list[Fault]]:
    """Return the largest share of the speed limit of a joint, and a fault for each joint that is too fast."""
    worst, faults = Extreme(), []
    seconds = np.diff(samples.times)
    for model in samples.models:
        for joint in model.joints:
            if joint.name not in samples.moved or not len(seconds):
                continue
            speed = np.abs(np.diff(samples.moved[joint.name])) / seconds
            at = int(speed.argmax())
            time, share = float(samples.times[at + 1]), float(speed[at] / joint.speed)
            if worst.value is None or share > worst.value:
                worst = Extreme(share, (joint.name,), time)
            if share > 1.0 + SPEED_SLACK:
                unit = unit_of(joint.slides)
                moves, limit = unit.from_si(float(speed[at])), unit.from_si(joint.speed)
                what = f"{joint.name} moves at {moves:.3g} of {limit:.3g} {unit.written}/s"
                faults.append(Fault("speed", what, share, time))
    return worst, faults


def beyond_limits(samples: Samples) -> Iterator[Fault]:
    """Yield joints beyond their limits and joints that do not follow the one that they mimic."""
    for model in samples.models:
        for joint in model.joints:
            if joint.name not in samples.moved:
                continue
            value = samples.moved[joint.name]
            unit, scale = unit_of(joint.slides).written, unit_of(joint.slides).from_si(1.0)
            over = np.maximum(joint.lower - value, value - joint.upper)
            at = int(over.argmax())
            if over[at] > SLACK:
                limits = f"{joint.lower * scale:.4g} to {joint.upper * scale:.4g} {unit}"
                what = f"{joint.name} is at {value[at] * scale:.4g} {unit}, its limits are {limits}"
                yield Fault("limit", what, float(over[at] * scale), float(samples.times[at]))
            if joint.follows is not None and joint.follows[0] in samples.moved:
                name, factor, offset = joint.follows
                off = np.abs(factor * samples.moved[name] + offset - value)
                at = int(off.argmax())
                if off[at] > SLACK:
                    what = f"{joint.name} is {off[at] * scale:.4g} {unit} from where {name} takes it"
                    yield Fault("limit", what, float(off[at] * scale), float(samples.times[at]))


def feet_leave(samples: Samples) -> Iterator[Fault]:
    """Yield legs that are too short for their pelvis, and planted soles that move."""
    for model, frames in zip(samples.models, samples.frames, strict=True):
        person = model.agent
        if not isinstance(person, Human) or not len(samples.plan.actions):
            continue
        if person.legs == "solved":
            yield from _short_legs(samples, model, person)
        if person.step is not None:
            yield from _late_steps(samples, person)
        standing = place(
            model.joints, model.rotation, model.position, {joint.name: np.zeros(1) for joint in model.joints}, 1
        )
        for name, frame in model.soles.items():
            moved = np.linalg.norm(attached(*frames, [frame])[1][0] - attached(*standing, [frame])[1][0], axis=1)
            at = int(moved.argmax())
            if moved[at] > TOUCHING:
                what = f"{person.name}.{name} is {1000 * moved[at]:.1f} mm from where it stands"
                yield Fault("feet", what, float(moved[at]), float(samples.times[at]))


def _late_steps(samples: Samples, person: Human) -> Iterator[Fault]:
    """Yield steps in the part of a phase in which a person has to stand, from then until the action."""
    phase = samples.plan.phase
    for part, most in (("x", TOUCHING), ("y", TOUCHING), ("yaw", np.radians(LEVEL))):
        values = samples.moved.get(f"{person.name}.base_{part}")
        if values is None:
            continue
        for number in np.unique(phase):
            slices = np.flatnonzero(phase == number)
            first, last = (PER_SLICE * (int(slices[at]) + 1) for at in (standing_from(len(slices)), -1))
            moved = np.abs(values[first : last + 1] - values[last])
            at = int(moved.argmax())
            if moved[at] > most:
                unit = unit_of(part != "yaw")
                what = f"{person.name} steps by {unit.from_si(moved[at]):.3g} {unit.written} where it has to stand"
                yield Fault("feet", what, float(unit.from_si(moved[at])), float(samples.times[first + at]))


def _short_legs(samples: Samples, model: AgentModel, person: Human) -> Iterator[Fault]:
    names = [f"{person.name}.pelvis_{part}" for part in ("x", "y", "z", "yaw", "tilt")]
    values = values_of(model.joints, samples.moved, model.fixed)
    pelvis = np.stack([np.broadcast_to(values[name], samples.count) for name in names], axis=1)
    _, beyond = solve_legs(pelvis, person.stature, person.sex)
    for side, short in zip(("left", "right"), beyond.T, strict=True):
        at = int(short.argmax())
        if short[at] > TOUCHING:
            what = f"the {side} leg of {person.name} is {1000 * short[at]:.1f} mm too short"
            yield Fault("feet", what, float(short[at]), float(samples.times[at]))
