"""The scene model as frozen records: agents, tables, objects, initial state and goal.

Lengths are in metres, angles in degrees as in scene files; world axes are x, y on the floor and z up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final, TypeVar

from lgp.defaults import COST, SCENE_COST, TIME_WEIGHT
from lgp.errors import SceneError
from reba.checks import COUNT, Allowed, accepts, has, instance, is_finite
from reba.errors import did_you_mean

if TYPE_CHECKING:
    import numpy as np

T = TypeVar("T")


@dataclass(frozen=True)
class Hand:
    """An end-effector.

    Attributes:
        name: name inside the agent; `full` joins both.
        frame: frame of the agent's model; its axes turned by `rotation`, a rotation vector [deg], are those of the
            hand: z in the direction of approach. reach: distance from there to the grasping point, along this z [m].
        kind: its type in the PDDL domain.
        tilt: largest angle [deg] between its z and straight down when it works at a table; 180 allows any.
        freedom: rotation of an object relative to the hand: "free", about the "axis" z only, about the axis y of a
            "jaw", or "fixed".
        payload: largest mass that it carries [kg]; infinite where the scene states none. human: of a person.
    """

    agent: str
    name: str
    frame: str
    reach: float
    kind: str
    tilt: float
    freedom: str
    payload: float = math.inf
    human: bool = False
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def full(self) -> str:
        """The name in plans: `human.right_hand`."""
        return f"{self.agent}.{self.name}"


@dataclass(frozen=True)
class Agent:
    """A person or a robot, its base at `position` [m] with `yaw` [deg], 0 faces x.

    Attributes:
        locked: patterns of joints that do not move.
        joints: joint -> initial value [deg, m for prismatic joints] where it differs from the rest posture.
    """

    name: str
    position: tuple[float, float, float]
    yaw: float
    hands: tuple[Hand, ...]
    locked: tuple[str, ...]
    joints: Mapping[str, float]


@dataclass(frozen=True)
class PlanarBase:
    """How far an agent moves over the floor from its position and yaw, along and about its own axes.

    Attributes:
        x, y, yaw: lowest and highest displacement [m] and turn [deg].
        speed, turn: largest speeds [m/s, deg/s].
        cost: weight of squared accelerations of the base, beside 1 of other joints.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    yaw: tuple[float, float]
    speed: float
    turn: float
    cost: float = 1.0


@dataclass(frozen=True)
class Human(Agent):
    """A person: stature [m] and sex scale the body.

    `legs`: "planted" (12 leg joints, soles fixed by constraints), "solved" (closed-form inverse kinematics from the
    pelvis, without joints, same postures) or "locked" (rigid legs below a free pelvis). `step`: where they may step to.
    """

    stature: float
    sex: str
    legs: str
    step: PlanarBase | None = None

    @property
    def ground(self) -> str:
        """The frame that the soles stand in where they may step: `human.base_yaw`; else ""."""
        return "" if self.step is None else f"{self.name}.base_yaw"


@dataclass(frozen=True)
class Robot(Agent):
    """A robot: `model` is a name in robots.toml or the path of a URDF file; `position` includes the base height.

    Attributes:
        base: of a mobile robot; its joints are `base_x`, `base_y` [m] and `base_yaw`.
        packages: folders in which ROS packages are looked for, those that `package://NAME/...` names.
    """

    model: str
    base: PlanarBase | None = None
    packages: tuple[str, ...] = ()


@dataclass(frozen=True)
class Table:
    """A table: centre of its top (x, y) [m], yaw [deg], size, height and thickness of the top [m].

    An experiment draws the height from the range `heights`, which is (height, height) for a fixed one. Above the top
    `clearance` [m] are free; what bounds them is another table, or a board of its own where it is `covered`. If a robot
    carries it, position, yaw and height are in the axes of `frame`, a link or joint such as `cart.deck`.
    """

    name: str
    position: tuple[float, float]
    yaw: float
    size: tuple[float, float]
    height: float
    heights: tuple[float, float]
    thickness: float
    clearance: float = math.inf
    covered: bool = False
    frame: str = ""

    @property
    def full(self) -> str:
        """The name in plans: `table.left`."""
        return f"table.{self.name}"

    @property
    def top(self) -> Table:
        """The table in the axes of its top, whose centre is the origin."""
        return replace(self, position=(0.0, 0.0), yaw=0.0, height=0.0)


@dataclass(frozen=True)
class Obstacle:
    """A body that is in the way: it never moves, nothing is placed on it, and no action names it.

    Attributes:
        shape: "box", "cylinder" (its axis is z) or "mesh".
        position: of the middle of a box or cylinder, of the origin of a mesh [m].
        rotation: rotation vector [deg].
        size: sides of a box, two diameters and the length of a cylinder [m]; the scale of a mesh.
        file: path of a mesh.
    """

    name: str
    shape: str
    position: tuple[float, float, float]
    rotation: tuple[float, float, float]
    size: tuple[float, float, float]
    file: str = ""

    @property
    def full(self) -> str:
        """The name in messages: `obstacle.pillar`."""
        return f"obstacle.{self.name}"


@dataclass(frozen=True)
class Grip:
    """How hands of one kind grasp an object, in the frame of the object.

    Attributes:
        at: grasping point [m].
        along: direction of approach (unit vector), the hand's z at zero rotation; from above by default.
        slide: largest offset of the grasping point from `at`, along the longest side of the object [m].
    """

    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    along: tuple[float, float, float] = (0.0, 0.0, -1.0)
    slide: float = 0.0


GRIP_DEPTH = 0.01
"""[m] Grips by default are this far below the top (a choice): deeper, palm and wrist would be inside the object."""


@dataclass(frozen=True)
class SceneObject:
    """An object: size of its box [m], mass [kg], initial table `on` and pose `at` on its top (x, y [m], yaw [deg]).

    A hand may grasp it below the middle of its top, up to `slide` [m] from there along its longest side, or as `grips`
    state for its kind. If a `hand` has it initially, `in_hand` is its pose in the frame of that hand: x, y, z [m] and a
    rotation vector [deg]; else its axis `up` points upwards initially. Placed objects stand on their x-y side.
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
        """Return the grip of a kind of hand; by default `GRIP_DEPTH` below the middle of the top."""
        return self.grips.get(kind, Grip((0.0, 0.0, max(self.size[2] / 2.0 - GRIP_DEPTH, 0.0)), slide=self.slide))


@dataclass(frozen=True)
class Assembly:
    """The relative pose of two objects that are screwed together, and the screw, in the frame of the first object.

    Attributes:
        position, yaw: of the second object [m, deg].
        screw, along: position of the screw head [m] and direction of the screw (unit vector).
        tool: distance from the hand to the screw head, along the fingers of a human hand, z of other hands [m].
    """

    parts: tuple[str, str]
    position: tuple[float, float, float]
    yaw: float
    screw: tuple[float, float, float]
    along: tuple[float, float, float]
    tool: float


@dataclass(frozen=True)
class FreeParameter:
    """A parameter that the source of the scene leaves open: its keys in the file and the reason for its value."""

    keys: tuple[str, ...]
    reason: str


HAND_CLEARANCE = 0.06
"""[m] Distance of the grip points of two hands by default (a choice: a palm and a gripper beside each other)."""

_HEIGHTS = Allowed(
    "a mapping of tables to heights [m]",
    lambda given: isinstance(given, Mapping) and all(isinstance(name, str) for name in given),
)
_TIME_WEIGHT = Allowed("a number from 0 to 1000", lambda given: is_finite(given) and 0 <= given <= 1000)


@dataclass(frozen=True)
class SceneCost:
    """The ergonomic cost: a surrogate by name or path, and the weight of a score point for a second or a slice.

    `time_weight` is the cost of a second, `terms` the weights of cost terms of one's own.
    """

    model: str = COST
    weight: float = 1.0
    per: str = "second"
    time_weight: float = TIME_WEIGHT
    terms: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Scene:
    """A scene.

    Attributes:
        name, title: a short name and one line.
        domain: of PDDL, its name or path.
        initial, goal: atoms of the initial state and the goal, as text; with "not" before it, one has to be false.
        phase_seconds: duration of each phase [s], or the first guess of it.
        durations: "fixed", "stretched" where a joint would be too fast, or "free" where they are unknowns of a plan.
        concurrent: whether independent actions of different agents may happen at the same time.
        slices: slices per phase of a path.
        humans, robots: by name; the person of `[human]` is "human".
        tables, objects: by full name, by name.
        assemblies: objects that can be screwed together.
        depth: longest sequence of actions of a search.
        hand_clearance: least distance of the grip points of two hands [m].
        cost: the ergonomic cost, and that of a second.
        choices: parameters that the source leaves open, with reasons.
        values: the TOML values with current heights; `read_scene(values)` returns an equal scene.
        obstacles: by full name; `lgp.scene.surroundings.fixed_bodies` adds the boards above covered tables.
    """

    name: str
    title: str
    domain: str
    initial: tuple[str, ...]
    goal: tuple[str, ...]
    phase_seconds: float
    slices: int
    humans: Mapping[str, Human]
    robots: Mapping[str, Robot]
    tables: Mapping[str, Table]
    objects: Mapping[str, SceneObject]
    assemblies: tuple[Assembly, ...] = ()
    depth: int = 4
    hand_clearance: float = HAND_CLEARANCE
    cost: SceneCost = SceneCost()
    durations: str = "fixed"
    choices: tuple[FreeParameter, ...] = ()
    values: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)
    obstacles: Mapping[str, Obstacle] = field(default_factory=dict)
    concurrent: bool = False

    @property
    def agents(self) -> tuple[Agent, ...]:
        """The persons, then the robots."""
        return (*self.humans.values(), *self.robots.values())

    @property
    def human(self) -> Human | None:
        """The first person, for what is about one person only; None without any."""
        return next(iter(self.humans.values()), None)

    @property
    def hands(self) -> dict[str, Hand]:
        """Every end-effector by full name, those of persons first."""
        return {hand.full: hand for agent in self.agents for hand in agent.hands}

    @accepts(SceneError, slices=COUNT.or_none())
    def ergonomic_weight(self, slices: int | None = None) -> float:
        """Return the weight of a score point for a second, with these slices per phase, its own by default."""
        per_phase = (slices or self.slices) / self.phase_seconds
        return self.cost.weight * (per_phase if self.cost.per == "slice" else 1.0)

    def cost_model(self, given: T) -> T | str:
        """Return a given cost model, or where that is "scene" the one that the scene states."""
        return self.cost.model if isinstance(given, str) and given == SCENE_COST else given

    @property
    def carried_tables(self) -> dict[str, Table]:
        """The tables that robots carry, by full name."""
        return {name: table for name, table in self.tables.items() if table.frame}

    @property
    def object_types(self) -> dict[str, str]:
        """Name of every end-effector, table and object -> its type in the PDDL domain."""
        return (
            {name: hand.kind for name, hand in self.hands.items()}
            | dict.fromkeys(self.tables, "table")
            | dict.fromkeys(self.objects, "thing")
        )

    @accepts(SceneError, heights=_HEIGHTS)
    def with_heights(self, heights: Mapping[str, float]) -> Scene:
        """Return the scene with other table heights.

        Args:
            heights: name of a table ("left" or "table.left") -> height [m], 0 to 3.

        Raises:
            SceneError: there is no such table, or a height is out of range.
        """
        tables = dict(self.tables)
        for name, height in heights.items():
            full = name if name in tables else f"table.{name}"
            if full not in tables:
                hint = did_you_mean(full, tables) or f"; known are {', '.join(tables)}"
                raise SceneError(f"{self.name}: no table {name!r}{hint}")
            if not is_finite(height) or not (-3.0 if tables[full].frame else 0.0) < height < 3.0:
                raise SceneError(f"{self.name}: height of {full} is {height!r}, expected 0 to 3 m")
            tables[full] = replace(tables[full], height=float(height))
        written = dict(self.values.get("tables", {}))
        written |= {name: {**entry, "height": tables[f"table.{name}"].height} for name, entry in written.items()}
        return replace(self, tables=tables, values={**self.values, "tables": written})

    @accepts(SceneError, weight=_TIME_WEIGHT)
    def with_time_weight(self, weight: float) -> Scene:
        """Return the scene with another cost of a second.

        Raises:
            SceneError: the cost is no number from 0 to 1000.
        """
        cost = {**self.values.get("cost", {}), "time_weight": float(weight)}
        return replace(self, cost=replace(self.cost, time_weight=float(weight)), values={**self.values, "cost": cost})

    @accepts(SceneError, rng=has("a random generator of NumPy", "uniform"))
    def draw_heights(self, rng: np.random.Generator) -> Scene:
        """Return the scene with every table height drawn uniformly from its range."""
        drawn = {name: one.heights for name, one in self.tables.items() if one.heights[1] > one.heights[0]}
        return self.with_heights({name: float(rng.uniform(*heights)) for name, heights in drawn.items()})


SCENE: Final = instance("a scene, such as lgp.load_scene returns", Scene)
"""What public functions take as a scene."""
