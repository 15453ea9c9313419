"""A scene: who and what is there, where, what holds at first and what is to hold at the end; frozen records.

Lengths are metres, angles degrees as a person writes them; the world is x, y on the floor and z up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from lgp.errors import SceneError
from reba.errors import did_you_mean

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class Hand:
    """An end-effector.

    Attributes:
        agent: who it belongs to.
        name: name inside the agent; `full` joins them.
        frame: frame of the agent's model, z pointing the way it approaches things.
        reach: from the frame to the point that grasps, along z [m].
        kind: its type in the domain.
        tilt: largest angle [deg] between its z and straight down when it grasps from or places on a table; 180 = any.
        freedom: how a held object may turn in the hand: "free", about the "axis" z only, about the axis y along which
            a "jaw" closes, or "fixed".
    """

    agent: str
    name: str
    frame: str
    reach: float
    kind: str
    tilt: float
    freedom: str

    @property
    def full(self) -> str:
        """The name in plans: `human.right_hand`."""
        return f"{self.agent}.{self.name}"


@dataclass(frozen=True)
class Agent:
    """The human or a robot.

    Attributes:
        name: of the agent.
        position: of its base [m].
        yaw: [deg], 0 faces x.
        hands: its end-effectors.
        locked: patterns of joints that do not move.
        joints: joint -> first value [deg, m for slides] where it is not that of the resting posture.
    """

    name: str
    position: tuple[float, float, float]
    yaw: float
    hands: tuple[Hand, ...]
    locked: tuple[str, ...]
    joints: Mapping[str, float]


@dataclass(frozen=True)
class Human(Agent):
    """The human: stature [m] and sex scale the body.

    `legs`: "planted" (12 leg joints, both soles stay by constraints), "solved" (the legs follow from the pelvis in
    closed form, no joints, same postures) or "locked" (rigid legs hang from a free pelvis).
    """

    stature: float
    sex: str
    legs: str


@dataclass(frozen=True)
class Robot(Agent):
    """A robot: `model` is a name in the table of robots, or the path of a URDF; `height` of its base is in position."""

    model: str


@dataclass(frozen=True)
class Table:
    """A table: the centre of its top (x, y), yaw [deg], size of the top, height of the top.

    `heights` is the range that an experiment draws the height from, (height, height) where it is given.
    """

    name: str
    position: tuple[float, float]
    yaw: float
    size: tuple[float, float]
    height: float
    heights: tuple[float, float]
    thickness: float

    @property
    def full(self) -> str:
        """The name in plans: `table.left`."""
        return f"table.{self.name}"


@dataclass(frozen=True)
class Grip:
    """Where and from where hands of a kind take an object, in its own frame.

    Attributes:
        at: the point that the hand takes [m].
        along: unit vector, the way the hand's z points when nothing is turned; the default comes from above.
        slide: the point may be this far from `at`, along the longest side of the object [m].
    """

    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    along: tuple[float, float, float] = (0.0, 0.0, -1.0)
    slide: float = 0.0


@dataclass(frozen=True)
class SceneObject:
    """An object: size of its box [m], mass [kg], the table it is `on` first and where `at` on it (x, y [m], yaw [deg]).

    A hand may grasp it up to `slide` [m] from its middle, along its longest side, or as `grips` say for its kind. If a
    `hand` holds it at first, `in_hand` is its place in the frame of that hand: x, y, z [m] and a rotation vector [deg];
    else its axis `up` points upwards at first. Where it is placed it stands on its x-y side.
    """

    name: str
    size: tuple[float, float, float]
    mass: float
    on: str
    at: tuple[float, float, float]
    slide: float
    hand: str = ""
    in_hand: tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    up: str = "z"
    grips: Mapping[str, Grip] = field(default_factory=dict)

    def grip(self, kind: str) -> Grip:
        """Return where a kind of hand takes the object."""
        return self.grips.get(kind, Grip(slide=self.slide))


@dataclass(frozen=True)
class Assembly:
    """How two objects stand when they are joined, and where the screw goes in; all in the frame of the first.

    Attributes:
        parts: their names.
        position: of the second [m].
        yaw: of the second [deg].
        screw: the head of the screw [m].
        along: unit vector, the way the screw goes in.
        tool: from the hand to the head of the screw, along the fingers of a human, the z of other hands [m].
    """

    parts: tuple[str, str]
    position: tuple[float, float, float]
    yaw: float
    screw: tuple[float, float, float]
    along: tuple[float, float, float]
    tool: float


@dataclass(frozen=True)
class FreeParameter:
    """A free choice of the scene: the keys that hold it, and why it is as it is."""

    keys: tuple[str, ...]
    reason: str


@dataclass(frozen=True)
class Scene:
    """A scene.

    Attributes:
        name: short name.
        title: one line.
        domain: name or path of the PDDL domain.
        initial: atoms that hold at first, as text.
        goal: atoms that are to hold, as text.
        phase_seconds: duration of each phase [s].
        slices: slices per phase of a path.
        human: the human, or None.
        robots: robots by name.
        tables: tables by full name.
        objects: by name.
        assemblies: which objects can be screwed together, and how.
        depth: longest sequence of actions that a search tries.
        choices: free choices with reasons.
        values: the table of values it was read from, heights as they are now; `read_scene` makes it again from them.
    """

    name: str
    title: str
    domain: str
    initial: tuple[str, ...]
    goal: tuple[str, ...]
    phase_seconds: float
    slices: int
    human: Human | None
    robots: Mapping[str, Robot]
    tables: Mapping[str, Table]
    objects: Mapping[str, SceneObject]
    assemblies: tuple[Assembly, ...] = ()
    depth: int = 4
    choices: tuple[FreeParameter, ...] = ()
    values: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)

    @property
    def agents(self) -> tuple[Agent, ...]:
        """The human, then the robots."""
        return (*([self.human] if self.human else []), *self.robots.values())

    @property
    def hands(self) -> dict[str, Hand]:
        """Every end-effector by full name, the human's first."""
        return {hand.full: hand for agent in self.agents for hand in agent.hands}

    @property
    def object_types(self) -> dict[str, str]:
        """Every name that a plan can speak of -> its type in the domain."""
        return (
            {name: hand.kind for name, hand in self.hands.items()}
            | dict.fromkeys(self.tables, "table")
            | dict.fromkeys(self.objects, "thing")
        )

    def with_heights(self, heights: Mapping[str, float]) -> Scene:
        """Return the scene with other table heights [m].

        Args:
            heights: name of a table ("left" or "table.left") -> height.

        Raises:
            SceneError: there is no such table, or a height is not above 0.
        """
        tables = dict(self.tables)
        for name, height in heights.items():
            full = name if name in tables else f"table.{name}"
            if full not in tables:
                raise SceneError(f"{self.name}: no table {name!r}{did_you_mean(full, tables)}")
            if not 0.0 < height < 3.0:
                raise SceneError(f"{self.name}: height of {full} is {height:g} m, expected 0 to 3 m")
            tables[full] = replace(tables[full], height=float(height))
        written = dict(self.values.get("tables", {}))
        written |= {table.name: {**written.get(table.name, {}), "height": table.height} for table in tables.values()}
        return replace(self, tables=tables, values={**self.values, "tables": written})

    def draw_heights(self, rng: np.random.Generator) -> Scene:
        """Return the scene with every height drawn uniformly from its range; given heights stay."""
        drawn = {
            name: float(rng.uniform(*table.heights))
            for name, table in self.tables.items()
            if table.heights[1] > table.heights[0]
        }
        return self.with_heights(drawn)
