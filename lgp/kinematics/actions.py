"""What actions mean in space: one `ActionKind` record for each, registered under its name in PDDL domains.

The planner, its bounds, collision checks, the audit, pages and execution read these records and ask for no name of an
action, so that one of your own is a PDDL action and a record. The shipped ones are registered in the same way.
"""

from __future__ import annotations

import re
import string
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

from lgp.errors import LgpError
from lgp.kinematics.features import Feature, Placement
from lgp.scene.model import Scene
from reba.checks import TEXT, Allowed, accepts


class ActionMoment(Protocol):
    """The n configurations in which an action is looked at, as its constraints see them.

    Attributes:
        scene: the scene.
        arguments: role -> name: `{"hand": "panda.hand", "object": "box"}`.
    """

    @property
    def scene(self) -> Scene: ...

    @property
    def arguments(self) -> Mapping[str, str]: ...

    def place(self, name: str) -> Placement:
        """Return the placements of a hand, an object, a table (the centre of its top) or a frame such as `panda.hand`.

        Raises:
            WorldError: there is no such name.
        """

    def __getitem__(self, role: str) -> Placement:
        """Return the placements of the argument in a role: `at["hand"]`."""


@dataclass(frozen=True)
class ActionConstraint:
    """What has to hold where an action ends, or all along the phase that it ends.

    Attributes:
        says: what holds, for messages: "the camera sees the part".
        feature: moment -> values (n, m) and Jacobian (n, m, columns), made of `lgp.kinematics.features`.
        equal: whether the values are 0; otherwise they are at most 0.
        unit: of the values: "m", "rad", or "" for cosines and the like.
        along: whether it holds in every slice of the phase; otherwise in its last one, that of the switch.
    """

    says: str
    feature: Callable[[ActionMoment], Feature]
    equal: bool = False
    unit: str = "m"
    along: bool = False


@dataclass(frozen=True)
class Sentences:
    """What a page says about an action.

    Fields in braces are filled in: {robot} and {arm} of the robot that acts, {hand} of the person, {object}, {other},
    {table} and further roles with their articles, {from} where the object was, {giver} and {taker} of a handover.

    Attributes:
        robot: what a robot does: "{robot}{arm} picks up {object}{from}."
        human: what the reader is to do: "Pick up {object}{from} with your {hand}."
        robot_short, human_short: a few words for the overview: "picks up {object}", "pick up {object}".
        own_hands: instead of `human` where both hands are those of the reader.
    """

    robot: str
    human: str
    robot_short: str
    human_short: str
    own_hands: str = ""

    @property
    def texts(self) -> tuple[str, ...]:
        """All of them."""
        return self.robot, self.human, self.robot_short, self.human_short, self.own_hands


@dataclass(frozen=True)
class ActionKind:
    """The geometry of one kind of action.

    Attributes:
        roles: of its arguments, in the order of its PDDL parameters. "hand" acts (it takes the object in a handover),
            "object" is acted on; "table", "giver" (the hand that hands over), "second" (a hand that may touch an
            object that the first one takes, until its own next action) and "other" (a second object) are known too; any
            other role is a hand, object or table for constraints.
        attaches_to: "hand" or "table" that the object is attached to from then on; "" leaves its attachment.
        given_by: role of the hand that must have the object before, "" if any attachment will do.
        holds_still: the hand touches the object where it is and does not move until its next action.
        screws: the hand brings its tool to the screw of two objects that stand as their assembly says.
        works_at_table: the hand reaches to a table top, so that the limit of its tilt applies.
        conflict_scope: what decides whether the pose of the switch is feasible: the "action" alone, the "table" that
            the object is on, or the complete "sequence" before. The search refuses sequences with a known conflict.
        constraints: what else has to hold.
        verb: of messages, "hands over".
        sentences: of pages; made of the name by default.
    """

    roles: tuple[str, ...]
    attaches_to: str = ""
    given_by: str = ""
    holds_still: bool = False
    screws: bool = False
    works_at_table: bool = False
    conflict_scope: str = "sequence"
    constraints: tuple[ActionConstraint, ...] = ()
    verb: str = "needs"
    sentences: Sentences | None = None

    @property
    def signature(self) -> str:
        """The arguments as a plan prints them: `hand, object, table`."""
        return ", ".join(self.roles)

    @property
    def contact(self) -> str:
        """ "hand" or "table" that touches the object in the switch, "" for none."""
        return "hand" if self.holds_still else self.attaches_to


ROLES: Final = ("hand", "object", "table", "giver", "second", "other")
"""Roles with a meaning of their own."""
FILLED: Final = frozenset({"robot", "arm", "hand", "giver", "taker", "second", "object", "other", "table", "from"})
"""Fields of sentences."""

_registered: dict[str, ActionKind] = {}


def kind_of(name: str) -> ActionKind | None:
    """Return the record of an action, None where none is registered.

    >>> kind_of("place").signature
    'hand, object, table'
    """
    return _registered.get(name)


def registered_actions() -> dict[str, ActionKind]:
    """Return every registered action by name, the shipped ones first."""
    return dict(_registered)


KIND: Final = Allowed("an `ActionKind`", lambda value: isinstance(value, ActionKind))


@accepts(LgpError, name=TEXT, kind=KIND)
def register_action(name: str, kind: ActionKind) -> None:
    """Register the geometry of a PDDL action under its name; one of your own may be registered again.

    Raises:
        LgpError: a shipped action has that name, or the record contradicts itself.

    Example:
        >>> import lgp
        >>> lgp.register_action("inspect", lgp.ActionKind(("hand", "object"), holds_still=True, works_at_table=True))
    """
    if name in SHIPPED:
        raise LgpError(f"action {name!r} is a shipped one; register yours under another name")
    _register(name, kind)


def _register(name: str, kind: ActionKind) -> None:
    wrong = _contradiction(name, kind)
    if wrong:
        raise LgpError(f"action {name!r}: {wrong}")
    _registered[name] = kind


def _contradiction(name: str, kind: ActionKind) -> str:
    """Return what is wrong with a record, "" if nothing is."""
    if not re.fullmatch(r"[A-Za-z][\w-]*", name):
        return "is no name of a PDDL action; use letters, digits, - and _"
    if not isinstance(kind.roles, tuple) or not all(isinstance(role, str) for role in kind.roles):
        return f'roles are {kind.roles!r}, expected a tuple of names such as ("hand", "object")'
    missing = [role for role in ("hand", "object") if role not in kind.roles]
    if missing or len(set(kind.roles)) < len(kind.roles):
        what = f"role {missing[0]!r} is missing" if missing else "a role occurs twice"
        return f"{what} in ({kind.signature}); name the hand that acts and the object once each"
    choices = {"attaches_to": ("", "hand", "table"), "conflict_scope": ("action", "table", "sequence")}
    for field, known in choices.items():
        if getattr(kind, field) not in known:
            return f"{field} is {getattr(kind, field)!r}, expected one of {', '.join(map(repr, known))}"
    needed = {
        "attaches_to 'table'": "table" if kind.attaches_to == "table" else "",
        "screws": "other" if kind.screws else "",
        "given_by": kind.given_by,
    }
    for field, role in needed.items():
        if role and role not in kind.roles:
            return f"{field} needs the role {role!r}, its roles are ({kind.signature}); add it"
    if kind.holds_still and kind.attaches_to:
        return "holds_still and attaches_to exclude each other; leave one of them out"
    for one in kind.constraints:
        if not isinstance(one, ActionConstraint) or not callable(one.feature):
            return f"constraint {one!r}, expected an `ActionConstraint` with a function"
        if one.unit not in ("m", "rad", ""):
            return f"unit of {one.says!r} is {one.unit!r}, expected 'm', 'rad' or ''"
    known_fields = FILLED | set(kind.roles)
    for text in kind.sentences.texts if kind.sentences else ():
        fields = {field for _, field, _, _ in string.Formatter().parse(text) if field is not None}
        if not fields <= known_fields:
            return f"{{{min(fields - known_fields)}}} in {text!r}, expected {', '.join(sorted(known_fields))}"
    return ""


def sentences_of(name: str) -> Sentences:
    """Return the sentences of an action; made of its name where it has none of its own."""
    kind = kind_of(name)
    if kind is not None and kind.sentences is not None:
        return kind.sentences
    words = re.sub(r"[-_]+", " ", name)
    return Sentences(
        f"{{robot}}{{arm}} does this: {words} {{object}}.",
        f"{words} {{object}} with your {{hand}}.",
        f"{words} {{object}}",
        f"{words} {{object}}",
    )


HAND_OBJECT: Final = ("hand", "object")
SHIPPED: Final = {
    "grasp": ActionKind(
        HAND_OBJECT,
        attaches_to="hand",
        works_at_table=True,
        conflict_scope="table",
        sentences=Sentences(
            "{robot}{arm} picks up {object}{from}.",
            "Pick up {object}{from} with your {hand}.",
            "picks up {object}",
            "pick up {object}",
        ),
    ),
    "place": ActionKind(
        (*HAND_OBJECT, "table"),
        attaches_to="table",
        given_by="hand",
        works_at_table=True,
        conflict_scope="action",
        verb="places",
        sentences=Sentences(
            "{robot}{arm} puts {object} on {table}.",
            "Put {object} on {table} with your {hand}.",
            "puts down {object}",
            "put down {object}",
        ),
    ),
    "handover": ActionKind(
        ("giver", "object", "hand"),
        attaches_to="hand",
        given_by="giver",
        conflict_scope="action",
        verb="hands over",
        # After Fig. 10 of Busch, Toussaint & Lopes (2018): "The robot, using its left arm, hands over the toolbox
        # handle to the agent's right hand."
        sentences=Sentences(
            "{robot}{arm} hands over {object} to {taker}.",
            "Hand over {object} to {taker} with your {giver}.",
            "hands over {object}",
            "hand over {object}",
            own_hands="Pass {object} from your {giver} to your {hand}.",
        ),
    ),
    "hold": ActionKind(
        HAND_OBJECT,
        holds_still=True,
        works_at_table=True,
        conflict_scope="table",
        sentences=Sentences(
            "{robot}{arm} holds {object} still for you.",
            "Hold {object} still with your {hand}.",
            "holds {object}",
            "hold {object}",
        ),
    ),
    "screw": ActionKind(
        (*HAND_OBJECT, "other"),
        screws=True,
        sentences=Sentences(
            "{robot}{arm} screws {object} and {other} together.",
            "Screw {object} and {other} together with your {hand}.",
            "screws {object} and {other} together",
            "screw {object} and {other} together",
        ),
    ),
    "release": ActionKind(
        HAND_OBJECT,
        sentences=Sentences(
            "{robot}{arm} lets go of {object}.",
            "Let go of {object} with your {hand}.",
            "lets go of {object}",
            "let go of {object}",
        ),
    ),
}
"""The shipped actions: those of Busch, Toussaint & Lopes 2018, and release."""
for _name, _kind in SHIPPED.items():
    _register(_name, _kind)
