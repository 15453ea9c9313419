"""The actions of a plan replayed on their own: who has what from when on, and what does not fit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from lgp.audit.faults import LEVEL, TOUCHING, Fault
from lgp.audit.grips import direction_error, grip_error, tilt_error, tool_errors
from lgp.audit.joint_tree import turned
from lgp.audit.own_constraints import own_errors
from lgp.audit.resting import put_down_errors, rest_pose, resting_errors
from lgp.audit.samples import Poses, Samples
from lgp.errors import LgpError
from lgp.kinematics.actions import kind_of
from lgp.logic.task import parse_atom, parse_goal
from lgp.scene.model import Scene
from reba.arrays import Array


@dataclass(frozen=True)
class Span:
    """Something that lasts from one sample to another: an object on its parent, a hand that holds, parts that stand.

    Attributes:
        first, second: a hand or table and an object; two objects of an assembly.
        begin, end: samples; None from the start on, and to the end.
    """

    first: str
    second: str
    begin: int | None = None
    end: int | None = None


@dataclass
class Replay:
    """The replayed actions of a plan.

    Attributes:
        poses: of each object.
        spans: of each object, the hands and tables that have it, in order.
        holds: hands that hold an object still.
        helps: second hands that carry an object which another one has.
        touches: hands at a screw of an object.
        assemblies: parts that stand as assembled.
        faults: what does not fit.
        unaudited: what it could not judge.
    """

    samples: Samples
    poses: dict[str, Poses] = field(default_factory=dict)
    spans: dict[str, list[Span]] = field(default_factory=dict)
    holds: list[Span] = field(default_factory=list)
    helps: list[Span] = field(default_factory=list)
    touches: list[Span] = field(default_factory=list)
    assemblies: list[Span] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    unaudited: list[str] = field(default_factory=list)

    @property
    def scene(self) -> Scene:
        """The scene of the plan."""
        return self.samples.plan.scene

    def has(self, name: str) -> str:
        """Return the hand or table that has an object at the end of what is replayed."""
        return self.spans[name][-1].first


def replay(samples: Samples) -> Replay:
    """Replay the actions of a plan.

    Raises:
        LgpError: an action names what the scene does not have.
    """
    run = Replay(samples)
    for name, item in run.scene.objects.items():
        run.spans[name] = [Span(item.hand or item.on, name)]
        run.poses[name] = _first_poses(samples, name)
        if not item.hand:
            _rests(run, name, item.on, 0)
    for atom in map(parse_atom, run.scene.initial):
        if atom.predicate == "holding":
            run.holds.append(Span(atom.arguments[0], atom.arguments[1], None, _next(run, atom.arguments[0], -1)))
        elif atom.predicate == "screwed":
            run.assemblies.append(Span(atom.arguments[0], atom.arguments[1]))
    for number, text in enumerate(samples.plan.actions):
        _act(run, number, text, int(samples.switches[number]))
    _check_same_time(run)
    _check_holds(run)
    _check_helps(run)
    _check_goal(run)
    return run


def _first_poses(samples: Samples, name: str) -> Poses:
    """Return the poses (T, ...) of an object as if what has it at first had it all the time."""
    item = samples.plan.scene.objects[name]
    if item.on in samples.tops:
        return _carried(samples.tops[item.on][:2], *rest_pose(samples.plan.scene.tables[item.on].top, item))
    if not item.hand:
        rotation, position = rest_pose(samples.plan.scene.tables[item.on], item)
        return np.repeat(rotation[None], samples.count, axis=0), np.repeat(position[None], samples.count, axis=0)
    return _carried(samples.hands[item.hand], turned(item.in_hand[3:]), np.array(item.in_hand[:3]))


def _carried(carrier: Poses, turn: Array, offset: Array) -> Poses:
    """Return the poses (T, ...) of an object that a hand or table carries at a pose (3, 3), (3,) in its frame."""
    rotation, position = carrier
    return rotation @ turn, position + rotation @ offset


def pose_at(poses: Poses, sample: int) -> tuple[Array, Array]:
    """Return rotation (3, 3) and position (3,) [m] in one sample."""
    return poses[0][sample], poses[1][sample]


def _act(run: Replay, number: int, text: str, at: int) -> None:
    """Replay one action, `grasp(1, baxter.right, box)`, at its sample."""
    name, _, rest = text.partition("(")
    arguments = [part.strip() for part in rest.removesuffix(")").split(",")]
    arguments = arguments[1:] if re.fullmatch(r"\d+", arguments[0]) else arguments
    kind = kind_of(name)
    if kind is None or len(kind.roles) != len(arguments):
        what = f"{text}: an action that the audit does not know, so where its objects are is a guess"
        _fault(run, "unknown", what, 0.0, at)
        return
    who = dict(zip(kind.roles, arguments, strict=True))
    _check_names(run, text, who)
    hand, item_name = who["hand"], who["object"]
    if kind.attaches_to:
        giver, parent = who.get(kind.given_by, ""), run.has(item_name)
        if (giver and giver != parent) or (not giver and parent in run.scene.hands):
            _fault(run, "attachment", f"{text}: {parent} has {item_name}", 0.0, at)
    if kind.contact == "hand":
        _check_grip(run, text, hand, item_name, at)
    tilt = tilt_error(run.scene.hands[hand], pose_at(run.samples.hands[hand], at)) if kind.works_at_table else 0.0
    if tilt > LEVEL:
        _fault(run, "attachment", f"{text}: {hand} is tilted {tilt:.1f} deg too far", tilt, at)
    for what, amount, sample in own_errors(run.samples, run.poses, kind, who, at):
        _fault(run, "attachment", f"{text}: {what}", amount, sample)
    if kind.attaches_to == "hand":
        if "second" in who:
            run.helps.append(Span(who["second"], item_name, at, _next(run, who["second"], number)))
        _take(run, item_name, hand, at)
    elif kind.attaches_to == "table":
        _put(run, text, item_name, who["table"], at)
    elif kind.holds_still:
        run.holds.append(Span(hand, item_name, at, _next(run, hand, number)))
    elif kind.screws:
        _screw(run, text, hand, item_name, who["other"], at)


def _check_names(run: Replay, text: str, who: Mapping[str, str]) -> None:
    scene = run.scene
    anything = {*scene.hands, *scene.objects, *scene.tables}
    known = {role: {*scene.hands} for role in ("hand", "giver", "second")}
    known |= {role: {*scene.objects} for role in ("object", "other")} | {"table": {*scene.tables}}
    for role, name in who.items():
        if name not in known.get(role, anything):
            raise LgpError(f"{text}: the scene has no {name!r}; audit a plan with the scene it was made for")


def _fault(run: Replay, kind: str, what: str, amount: float, at: int) -> None:
    run.faults.append(Fault(kind, what, amount, float(run.samples.times[at])))


def _next(run: Replay, hand: str, number: int) -> int | None:
    """Return the sample of the first action after one that a hand takes part in, None without."""
    later = run.samples.plan.actions[number + 1 :]
    return next((int(run.samples.switches[number + 1 + k]) for k, text in enumerate(later)
                 if hand in re.split(r"[(),\s]+", text)), None)  # fmt: skip


def _check_grip(run: Replay, text: str, hand: str, item_name: str, at: int) -> None:
    item, one = run.scene.objects[item_name], run.scene.hands[hand]
    where = pose_at(run.samples.hands[hand], at), pose_at(run.poses[item_name], at)
    beside = grip_error(one, item, *where)
    if beside > TOUCHING:
        _fault(
            run, "attachment", f"{text}: {hand} is {1000 * beside:.1f} mm beside the grip of {item_name}", beside, at
        )
    turned = direction_error(one, item, *where)
    if turned > LEVEL:
        _fault(run, "attachment", f"{text}: {hand} is turned {turned:.1f} deg from the grip of {item_name}", turned, at)


def _take(run: Replay, item_name: str, parent: str, at: int) -> None:
    """Attach an object to a hand, or to a table that is carried, as it is there, from a sample on."""
    samples = run.samples
    carrier = samples.tops[parent][:2] if parent in samples.tops else samples.hands[parent]
    turn, position = pose_at(run.poses[item_name], at)
    own, place = pose_at(carrier, at)
    _switch(run, item_name, parent, _carried(carrier, own.T @ turn, own.T @ (position - place)), at)


def _switch(run: Replay, item_name: str, parent: str, poses: Poses, at: int) -> None:
    for old, new in zip(run.poses[item_name], poses, strict=True):
        old[at:] = new[at:]
    last = run.spans[item_name][-1]
    run.spans[item_name][-1:] = [Span(last.first, item_name, last.begin, at), Span(parent, item_name, at)]
    for kept, span in enumerate(run.assemblies):
        if span.end is None and item_name in (span.first, span.second):
            run.assemblies[kept] = Span(span.first, span.second, span.begin, at)


def _put(run: Replay, text: str, item_name: str, table: str, at: int) -> None:
    """Leave an object on a table as it is there, from a sample on."""
    turn, position = pose_at(run.poses[item_name], at)
    top = run.samples.table(table, at)
    for what, amount in put_down_errors(top, run.scene.objects[item_name], turn, position):
        _fault(run, "attachment", f"{text}: {item_name} is put down {what}", amount, at)
    count = run.samples.count
    if table in run.samples.tops:
        _take(run, item_name, table, at)
    else:
        _switch(run, item_name, table, (np.repeat(turn[None], count, 0), np.repeat(position[None], count, 0)), at)
    _rests(run, item_name, table, at)


def _rests(run: Replay, item_name: str, table: str, at: int) -> None:
    item, where = run.scene.objects[item_name], pose_at(run.poses[item_name], at)
    for what, amount in resting_errors(run.samples.table(table, at), item, *where):
        _fault(run, "resting", f"{item_name} on {table} {what}", amount, at)


def _screw(run: Replay, text: str, hand: str, item_name: str, other: str, at: int) -> None:
    assembly = next((one for one in run.scene.assemblies if set(one.parts) == {item_name, other}), None)
    if assembly is None:
        _fault(run, "attachment", f"{text}: the scene has no assembly of {item_name} and {other}", 0.0, at)
        return
    parts = [pose_at(run.poses[part], at) for part in assembly.parts]
    for what, amount in tool_errors(assembly, run.scene.hands[hand], pose_at(run.samples.hands[hand], at), *parts):
        _fault(run, "attachment", f"{text}: {what}", amount, at)
    run.touches += [Span(hand, part, at, at) for part in assembly.parts]
    begins = [run.spans[part][-1].begin for part in assembly.parts]
    stands = None if begins == [None, None] else max(begin or 0 for begin in begins)
    run.assemblies.append(Span(*assembly.parts, stands))


def _check_same_time(run: Replay) -> None:
    """Find agents and objects that take part in two actions at the same time."""
    scene = run.scene
    busy: dict[tuple[str, int], str] = {}
    for text, at in zip(run.samples.plan.actions, run.samples.switches.tolist(), strict=True):
        names = {name for name in re.split(r"[(),\s]+", text) if name in scene.hands or name in scene.objects}
        for name in sorted({scene.hands[name].agent if name in scene.hands else name for name in names}):
            before = busy.setdefault((name, at), text)
            if before != text:
                _fault(run, "attachment", f"{text}: {name} takes part in {before} at the same time", 0.0, at)


def _check_holds(run: Replay) -> None:
    """Find hands that move while they hold an object still."""
    for hold in run.holds:
        first, last = _ends(run, hold)
        turn, place = (values[first : last + 1] for values in run.samples.hands[hold.first])
        _check_still(run, (turn, place), f"{hold.first} {{}} while it holds {hold.second}", first)


def _check_helps(run: Replay) -> None:
    """Find grippers that do not go with an object which they carry together with another hand; a palm may turn."""
    for span in run.helps:
        if run.scene.hands[span.first].human:
            continue
        first, last = _ends(run, span)
        turn, place = (values[first : last + 1] for values in run.samples.hands[span.first])
        rotation, position = (values[first : last + 1] for values in run.poses[span.second])
        own = np.einsum("tji,tjk->tik", rotation, turn), np.einsum("tji,tj->ti", rotation, place - position)
        what = f"{span.first} {{}} in {span.second}, which it carries too: constrain its whole pose on the way"
        _check_still(run, own, what, first)


def _ends(run: Replay, span: Span) -> tuple[int, int]:
    """Return the first and last sample of a span."""
    return span.begin or 0, run.samples.count - 1 if span.end is None else span.end


def _check_still(run: Replay, poses: Poses, what: str, first: int) -> None:
    """Find where poses (T, ...) from a sample on move or turn away from the first of them."""
    turn, place = poses
    moved = 1000.0 * np.linalg.norm(place - place[0], axis=1)
    cosine = (np.einsum("tij,ij->t", turn, turn[0]) - 1.0) / 2.0
    turned = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    for amount, most, word, unit in ((moved, 1000.0 * TOUCHING, "moves", "mm"), (turned, LEVEL, "turns", "deg")):
        worst = int(amount.argmax())
        if amount[worst] > most:
            said = what.format(f"{word} {amount[worst]:.1f} {unit}")
            _fault(run, "attachment", said, float(amount[worst]) / (1000.0 if unit == "mm" else 1.0), first + worst)


def _check_goal(run: Replay) -> None:
    """Find atoms of the goal with a meaning in space that do not hold at the end."""
    wanted, unwanted = parse_goal(run.scene.goal)
    kept = {atom.arguments[1] for atom in wanted if atom.predicate == "grasped"}
    holding = {(span.first, span.second) for span in run.holds if span.end is None}
    joined = [{span.first, span.second} for span in run.assemblies if span.end is None]
    for atom, so in [*((atom, True) for atom in wanted), *((atom, False) for atom in unwanted)]:
        holds: bool | None = None
        names = atom.arguments
        if atom.predicate == "grasped":
            holds = run.has(names[1]) == names[0]
        elif atom.predicate == "placed":
            on = [span.first for span in run.spans[names[0]] if span.first in run.scene.tables]
            holds = names[1] in on[-1:] and (names[0] in kept or run.has(names[0]) == names[1])
        elif atom.predicate == "on_table":
            holds = run.has(names[0]) in run.scene.tables
        elif atom.predicate == "free":
            has = [span[-1].first for span in run.spans.values()] + [hand for hand, _ in holding]
            holds = names[0] not in has
        elif atom.predicate == "holding":
            holds = names in holding
        elif atom.predicate == "screwed":
            holds = set(names) in joined
        if holds is None:
            run.unaudited.append(f"{atom} of the goal: it has no meaning in space that the audit knows")
        elif holds != so:
            what = f"the goal {atom} does not hold" if so else f"the goal not {atom} does not hold"
            _fault(run, "goal", what, 0.0, run.samples.count - 1)
