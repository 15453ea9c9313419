"""How far the jaws of a hand are open: wide until it takes an object, then as far apart as the object is wide.

The jaws are joints of the URDF beyond the joint that carries the hand which the plan does not move.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import coal
import numpy as np

from lgp.audit.agents import AgentModel
from lgp.audit.faults import TOUCHING
from lgp.audit.joint_tree import BASE, attached, place, values_of
from lgp.audit.replay import Replay, Span
from lgp.audit.shapes import Body
from lgp.scene.model import Human
from reba.arrays import Array


@dataclass(frozen=True)
class _Jaws:
    """The jaws of a hand.

    Attributes:
        joints: their names with the values [rad, m] at which they are closed and open.
        closing: (3,) direction in which they close, in the frame of the hand.
        gaps: distance [m] of the two jaws when closed and open.
    """

    joints: dict[str, tuple[float, float]]
    closing: Array
    gaps: tuple[float, float]


def carriers(model: AgentModel, moved: set[str]) -> dict[str, int]:
    """Return the frame of the joint that carries each hand: the last one before it that the plan moves, if any."""
    carrying = {}
    for hand, frame in model.hands.items():
        chain = model.chain(frame.on)
        carrying[hand] = next((n for n in chain[:-1] if model.joints[n - 1].name in moved), chain[0])
    return carrying


def jaw_values(run: Replay, model: AgentModel) -> dict[str, Array]:
    """Return the value (T,) [rad, m] of every joint of the jaws of an agent."""
    values: dict[str, Array] = {}
    for hand, carrier in carriers(model, set(run.samples.moved)).items():
        jaws = _jaws(model, hand, carrier, set(run.samples.moved))
        if jaws is None:
            continue
        share = np.ones(run.samples.count)  # 1: open
        for span in _has(run, hand):
            first, last = span.begin or 0, run.samples.count - 1 if span.end is None else span.end
            # At the switch itself the hand still reaches for the object.
            after = first if span.begin is None else first + 1
            share[after : last + 1] = _share(run, jaws, span, first)
        for name, (closed, opened) in jaws.joints.items():
            values[name] = closed + share * (opened - closed)
    return values


def too_wide(run: Replay, model: AgentModel) -> Iterator[str]:
    """Yield what the jaws of an agent take where it is wider than they open."""
    for hand, carrier in carriers(model, set(run.samples.moved)).items():
        jaws = _jaws(model, hand, carrier, set(run.samples.moved))
        if jaws is None:
            continue
        for span in _has(run, hand):
            width, opened = _width(run, jaws, span, span.begin or 0), jaws.gaps[1]
            if width > opened + TOUCHING:
                wide = f"it is {100 * width:.1f} cm wide across them and they open {100 * opened:.1f} cm"
                how = "the freedom of the hand and the grips of the object say how it is taken"
                yield f"whether the jaws of {hand} can hold {span.second}: {wide}; {how}"


def _has(run: Replay, hand: str) -> list[Span]:
    return [span for spans in (*run.spans.values(), run.holds, run.helps) for span in spans if span.first == hand]


def _share(run: Replay, jaws: _Jaws, span: Span, at: int) -> float:
    """Return how far the jaws are open, 0 to 1, at the width of an object across them."""
    closed, opened = jaws.gaps
    width = _width(run, jaws, span, at)
    return float(np.clip((width - closed) / (opened - closed), 0.0, 1.0)) if opened > closed else 0.0


def _width(run: Replay, jaws: _Jaws, span: Span, at: int) -> float:
    """Return how wide [m] an object is in the direction in which the jaws that have it close."""
    across = run.samples.hands[span.first][0][at] @ jaws.closing
    return float(np.abs(run.poses[span.second][0][at].T @ across) @ np.array(run.scene.objects[span.second].size))


def _jaws(model: AgentModel, hand: str, carrier: int, moved: set[str]) -> _Jaws | None:
    """Return the jaws of a hand, None without."""
    if isinstance(model.agent, Human):
        return None
    own = set(model.chain(model.hands[hand].on))
    beyond = {n: joint for n, joint in enumerate(model.joints, 1)
              if joint.name not in moved and n not in own and carrier in model.chain(n)}  # fmt: skip
    joints = [
        joint for joint in beyond.values() if joint.follows is None and np.isfinite([joint.lower, joint.upper]).all()
    ]
    parts = [(body, frame) for body, frame in model.parts if set(model.chain(frame.on)) & set(beyond)]
    if carrier == BASE or not joints or not parts:
        return None
    stands = []
    for end in ("lower", "upper"):
        fixed = {**model.fixed, **{joint.name: float(getattr(joint, end)) for joint in joints}}
        frames = place(model.joints, np.eye(3), np.zeros(3), values_of(model.joints, {}, fixed), 1)
        turn, at = (values[0, 0] for values in attached(*frames, [model.hands[hand]]))
        rotation, position = (values[:, 0] for values in attached(*frames, [frame for _, frame in parts]))
        stands.append((turn.T @ rotation, (position - at) @ turn))
    # Open is where the jaws are farther from the line along which the hand approaches.
    away = [float(np.linalg.norm(position[:, :2], axis=1).mean()) for _, position in stands]
    order = (0, 1) if away[0] <= away[1] else (1, 0)
    closed, opened = (stands[number] for number in order)
    step = opened[1] - closed[1]
    farthest = step[int(np.linalg.norm(step, axis=1).argmax())]
    length = float(np.linalg.norm(farthest))
    if length == 0.0:
        return None
    limits = {joint.name: (joint.lower, joint.upper) for joint in joints}
    values = {name: (ends[order[0]], ends[order[1]]) for name, ends in limits.items()}
    bodies = [body for body, _ in parts]
    return _Jaws(values, farthest / length, (_gap(bodies, *closed), _gap(bodies, *opened)))


def _gap(bodies: list[Body], rotation: Array, position: Array) -> float:
    """Return the distance [m] of two jaws where they take things, 0 where they meet or are one."""
    nearest: dict[int, int] = {}
    for number in np.argsort(np.linalg.norm(position, axis=1)).tolist():
        nearest.setdefault(bodies[number].joint, number)
    gaps = [
        coal.distance(bodies[one].shape.convex, coal.Transform3s(rotation[one], position[one]),
                      bodies[other].shape.convex, coal.Transform3s(rotation[other], position[other]),
                      coal.DistanceRequest(), coal.DistanceResult())
        for one, other in combinations(nearest.values(), 2)
    ]  # fmt: skip
    return max(min(gaps, default=0.0), 0.0)
