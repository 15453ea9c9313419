"""Forward kinematics of all agents of a scene in one Pinocchio model, for batches of configurations.

A configuration q (nq,) holds one coordinate per moving joint [rad, m]; joints that follow another one have none of
their own, objects and tables are no joints. Batches are (n, nq). Jacobians have linear velocity in rows 0-2 and
angular velocity in rows 3-5, in world axes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin

from lgp.errors import WorldError
from lgp.kinematics import human
from lgp.kinematics.carried_tables import add_carried_tables
from lgp.kinematics.features import cross, rotation_about_z
from lgp.kinematics.leg_ik import rest_posture
from lgp.kinematics.planar_joints import BASE
from lgp.kinematics.robot import Coupling, JointedModel, locked_model, robot_model
from lgp.scene.joint_units import JointUnit, unit_of
from lgp.scene.model import SCENE, Agent, Human, Robot, Scene, Table
from reba.arrays import Array, Indices
from reba.checks import accepts
from reba.errors import did_you_mean, join_names
from reba.posture.columns import SIDES

AnyAgent = TypeVar("AnyAgent", bound=Agent)
MOST_FRAMES = 8
"""Frames of a robot that a message lists, the last ones of its URDF first."""
ROUNDING = 1e-9
"""[rad, m] A value beyond a joint limit by less counts as at it."""


@dataclass(frozen=True)
class FramePlacement:
    """Rotations (n, 3, 3), positions (n, 3) [m] and Jacobians (n, 6, columns) of a frame in n slices."""

    rotation: Array
    position: Array
    jacobian: Array

    def axis(self, number: int) -> Array:
        """Return axis 0, 1 or 2 as (n, 3)."""
        return self.rotation[:, :, number]


class Kinematics:
    """Placements of F frames for n configurations; the Jacobian of a frame is computed on first use.

    Attributes:
        index: frame -> its row in `rotation` (n, F, 3, 3) and `position` (n, F, 3) [m].
        model_spatial: (n, 6, joints of the model) spatial velocity of each joint at the origin of the world.
    """

    def __init__(self, world: World, names: Sequence[str], rotation: Array, position: Array, spatial: Array) -> None:
        self.world, self.index = world, {name: number for number, name in enumerate(names)}
        self.rotation, self.position, self.model_spatial = rotation, position, spatial
        self._placements: dict[str, FramePlacement] = {}

    def __len__(self) -> int:
        return len(self.rotation)

    def rows(self, which: slice | Indices) -> Kinematics:
        """Return the placements of some of the slices."""
        parts = (self.rotation[which], self.position[which], self.model_spatial[which])
        return Kinematics(self.world, list(self.index), *parts)

    @property
    def spatial(self) -> Array:
        """Spatial velocities (n, 6, nq) by the configuration: of frames that all joints of a coupling move, or none."""
        return self.world.by_configuration(self.model_spatial)

    def placement(self, name: str) -> FramePlacement:
        """Return the placement of a frame with its Jacobian (n, 6, nq)."""
        if name not in self._placements:
            number = self.index[name]
            position = self.position[:, number]
            jacobian = self.point_jacobian(name, position)
            self._placements[name] = FramePlacement(self.rotation[:, number], position, jacobian)
        return self._placements[name]

    def table(self, name: str, row: int = 0) -> Table:
        """Return a table as it stands in the world in one slice, where the robot that carries it is then."""
        table = self.world.scene.tables[name]
        if not table.frame:
            return table
        at = self.index[name]
        (x, y, height), turn = self.position[row, at].tolist(), self.rotation[row, at]
        return replace(table, position=(x, y), yaw=float(np.degrees(np.arctan2(turn[1, 0], turn[0, 0]))), height=height)

    def point_jacobian(self, name: str, points: Array) -> Array:
        """Return the Jacobian (n, 6, nq) of points (n, 3) fixed to a frame, given in world axes."""
        jacobian = self.model_spatial * self.world.model_support(name)
        jacobian[:, :3] += cross(jacobian[:, 3:], points)
        return self.world.by_configuration(jacobian)


class World:
    """The kinematics of the agents of a scene.

    Args:
        scene: its persons and robots become one model.

    Attributes:
        scene: the scene; tables and objects change with `with_scene`.
        joints: `agent.joint` of each column of q.
        column: joint -> column.
        units: joint -> its unit, locked joints included.
        lower, upper: joint limits [rad, m], (nq,).
        initial_configuration: (nq,) [rad, m].
        initial_values: initial value of every joint [rad, m], locked joints included.
        robot_shapes: what `lgp.collision` prepares once of each robot; shared by worlds with other tables and objects.
        planted: soles that must not move: frame -> (rotation (3, 3), position (3,)).

    Raises:
        WorldError: a robot, joint or frame of the scene does not exist, or an initial value is outside its limits.

    Example:
        >>> from lgp.scene.scene_file import load_scene
        >>> world = World(load_scene("screwdriver"))
        >>> kinematics = world.at(world.initial_configuration[None], ["human.right_hand"])
        >>> kinematics.placement("human.right_hand").position.shape
        (1, 3)
    """

    @accepts(WorldError, scene=SCENE)
    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.model = pin.Model()
        values: dict[str, float] = {}
        couplings: dict[str, Coupling] = {}
        self.units: dict[str, JointUnit] = {}
        for agent in scene.agents:
            built, placement = _agent_model(agent)
            self.model = pin.appendModel(self.model, built.model, 0, placement)
            self.units |= {f"{agent.name}.{name}": unit for name, unit in built.units.items()}
            couplings |= built.couplings
            values |= _initial_values(agent, built.units)
        self.joints = tuple(name for name in list(self.model.names)[1:] if name not in couplings)
        self.column = {name: number for number, name in enumerate(self.joints)}
        self._spread, self._offset = self._coupled(couplings)
        self.lower, self.upper = self._limits()
        self.initial_values = values
        self.initial_configuration = self._initial_configuration()
        self._support: dict[str, Array] = {}
        self.robot_shapes: dict[str, Any] = {}
        self._add_hands()
        add_carried_tables(self.model, scene, self.model_configuration(self.initial_configuration))
        self._data = self.model.createData()
        self.planted = self._planted()

    @property
    def nq(self) -> int:
        """Number of joints with a coordinate of their own."""
        return len(self.joints)

    @property
    def speed_limit(self) -> Array:
        """Largest speeds (nq,) [rad/s, m/s], also of the joints that follow; infinite where the model has none."""
        limit = np.asarray(self.model.velocityLimit, dtype=float)
        limit = np.where(limit > 0.0, limit, np.inf)
        if self._spread is None:
            return limit
        with np.errstate(divide="ignore"):
            return np.asarray(np.min(limit[:, None] / np.abs(self._spread), axis=0))

    @cached_property
    def acceleration_weights(self) -> Array:
        """Weights (nq,) of the squared accelerations of joints in the cost: 1, or what a base over the floor states."""
        weights = np.ones(self.nq)
        for agent in self.scene.agents:
            base = agent.step if isinstance(agent, Human) else agent.base if isinstance(agent, Robot) else None
            if base is not None:
                place = (self.column.get(f"{agent.name}.{BASE}_{part}") for part in ("x", "y", "yaw"))
                weights[[column for column in place if column is not None]] = base.cost
        return weights

    def with_scene(self, scene: Scene) -> World:
        """Return this world with other tables and objects, sharing the kinematic model if robots carry the same ones.

        Raises:
            WorldError: the scene has other agents.
        """
        if scene.agents != self.scene.agents:
            names = ", ".join(agent.name for agent in scene.agents)
            raise WorldError(f"agents {names} differ, expected other tables and objects only; build a new World")
        if scene.carried_tables != self.scene.carried_tables:
            return World(scene)
        other = object.__new__(World)
        other.__dict__ = {**self.__dict__, "scene": scene}
        return other

    def without_tilt_limits(self, *agents: str) -> World:
        """Return this world without the limits of tilt of the hands of some agents at tables."""
        humans, robots = dict(self.scene.humans), dict(self.scene.robots)
        for name in agents:
            if name in humans:
                humans[name] = _without_tilt_limits(humans[name])
            elif name in robots:
                robots[name] = _without_tilt_limits(robots[name])
        scene = replace(self.scene, humans=humans, robots=robots)
        other = object.__new__(World)
        other.__dict__ = {**self.__dict__, "scene": scene}
        return other

    def columns(self, agent: str) -> Indices:
        """Return the columns of q that belong to an agent.

        Raises:
            WorldError: there is no such agent.
        """
        columns = [column for name, column in self.column.items() if name.startswith(f"{agent}.")]
        if not columns and agent not in {one.name for one in self.scene.agents}:
            raise WorldError(f"no agent {agent!r}{did_you_mean(agent, [one.name for one in self.scene.agents])}")
        return np.array(columns, dtype=np.intp)

    def frame_id(self, name: str) -> int:
        """Return the number of a frame in the Pinocchio model.

        Raises:
            WorldError: there is no such frame.
        """
        if not self.model.existFrame(name):
            known = [frame.name for frame in self.model.frames]
            raise WorldError(f"no frame {name!r} in the scene{did_you_mean(name, known)}")
        return int(self.model.getFrameId(name))

    def model_support(self, name: str) -> Array:
        """Return 1 for each joint of the Pinocchio model that moves a frame, else 0; in the order of the model."""
        if name not in self._support:
            mask = np.zeros(self.model.nq)
            for joint in list(self.model.supports[self.model.frames[self.frame_id(name)].parentJoint])[1:]:
                mask[self.model.joints[joint].idx_q] = 1.0
            self._support[name] = mask
        return self._support[name]

    def support(self, name: str) -> Array:
        """Return (nq,) 1 for each joint that moves a frame, itself or by one that follows it, else 0."""
        mask = self.model_support(name)
        return mask if self._spread is None else np.asarray(mask @ (self._spread != 0.0) > 0.0, dtype=float)

    def model_configuration(self, q: Array) -> Array:
        """Return configurations (..., nq) with a value for every joint of the Pinocchio model, followers included."""
        return q if self._spread is None else np.asarray(q @ self._spread.T + self._offset)

    def by_configuration(self, jacobian: Array) -> Array:
        """Return a Jacobian (..., joints of the model) by the configuration, (..., nq)."""
        return jacobian if self._spread is None else np.asarray(jacobian @ self._spread)

    def at(self, q: Array, names: Iterable[str]) -> Kinematics:
        """Return the placements of frames for (n, nq) configurations.

        Raises:
            WorldError: q has another number of columns, or a frame is unknown.
        """
        q = np.ascontiguousarray(q, dtype=float)
        if q.ndim != 2 or q.shape[1] != self.nq:
            raise WorldError(f"configurations have shape {q.shape}, expected (n, {self.nq}), one column per joint")
        frames = list(dict.fromkeys(names))
        numbers = [self.frame_id(name) for name in frames]
        rotation, position = np.empty((len(q), len(frames), 3, 3)), np.empty((len(q), len(frames), 3))
        spatial = np.empty((len(q), 6, self.model.nq))
        model, data = self.model, self._data
        jacobians, placement = pin.computeJointJacobians, pin.updateFramePlacement
        for row, configuration in enumerate(self.model_configuration(q)):
            spatial[row] = jacobians(model, data, configuration)
            for at, number in enumerate(numbers):
                placed = placement(model, data, number)
                rotation[row, at], position[row, at] = placed.rotation, placed.translation
        return Kinematics(self, frames, rotation, position, spatial)

    def _coupled(self, couplings: Mapping[str, Coupling]) -> tuple[Array | None, Array]:
        """Return the matrix (joints of the model, nq) and offset that give joints which follow; None without any."""
        spread, offset = np.zeros((self.model.nq, self.nq)), np.zeros(self.model.nq)
        for number, name in enumerate(self.model.names):
            if number and name in couplings:
                row, one = self.model.joints[number].idx_q, couplings[name]
                spread[row, self.column[one.leader]], offset[row] = one.factor, one.offset
            elif number:
                spread[self.model.joints[number].idx_q, self.column[name]] = 1.0
        return (spread if couplings else None), offset

    def _limits(self) -> tuple[Array, Array]:
        """Return the joint limits (nq,) within which the joints that follow keep theirs too."""
        low, high = self.model.lowerPositionLimit.copy(), self.model.upperPositionLimit.copy()
        if self._spread is None:
            return low, high
        lower, upper = np.full(self.nq, -np.inf), np.full(self.nq, np.inf)
        for row, column in zip(*np.nonzero(self._spread), strict=True):
            ends = (np.array([low[row], high[row]]) - self._offset[row]) / self._spread[row, column]
            lower[column], upper[column] = max(lower[column], ends.min()), min(upper[column], ends.max())
        return lower, upper

    def _initial_configuration(self) -> Array:
        """Return (nq,) [rad, m]; a joint without an initial value is as near to 0 as its limits allow."""
        configuration = np.clip(np.zeros(self.nq), self.lower, self.upper)
        for name, column in self.column.items():
            if name in self.initial_values:
                configuration[column] = self.initial_values[name]
        self.check_limits(configuration, "the scene's `joints`")
        return np.clip(configuration, self.lower, self.upper)

    def check_limits(self, q: Array, where: str) -> None:
        """Refuse a configuration (nq,) [rad, m] beyond joint limits; `where` says what to change.

        Raises:
            WorldError: names the joint, its value and its limits.
        """
        for name, column in self.column.items():
            value, low, high = q[column], self.lower[column], self.upper[column]
            if not low - ROUNDING <= value <= high + ROUNDING:
                unit = self.units[name]
                value, low, high = map(unit.from_si, (value, low, high))
                raise WorldError(
                    f"{name} starts at {value:g} {unit.written}, expected {low:g} to {high:g} {unit.written}; "
                    f"change its value in {where}"
                )

    def _add_hands(self) -> None:
        """Add the grasping point of each end-effector as a frame under its full name."""
        for full, hand in self.scene.hands.items():
            if self.model.existFrame(full):
                if hand.frame == hand.name and not hand.reach and not any(hand.rotation):
                    continue
                raise WorldError(f"{full}: is a link or joint of {hand.agent} elsewhere; give the hand another name")
            if not self.model.existFrame(f"{hand.agent}.{hand.frame}"):
                own = [
                    frame.name.partition(".")[2]
                    for frame in self.model.frames
                    if frame.name.startswith(f"{hand.agent}.")
                ]
                hint = did_you_mean(hand.frame.removeprefix(f"{hand.agent}."), own)
                hint = hint or f": {join_names(own[::-1], MOST_FRAMES)}"
                raise WorldError(f"{full}: frame is {hand.frame!r}, expected a link or joint of {hand.agent}{hint}")
            base = self.model.frames[self.frame_id(f"{hand.agent}.{hand.frame}")]
            turn = pin.exp3(np.radians(hand.rotation))
            offset = base.placement * pin.SE3(turn, hand.reach * turn[:, 2])
            self.model.addFrame(pin.Frame(full, base.parentJoint, offset, pin.FrameType.OP_FRAME))

    def _planted(self) -> Mapping[str, tuple[Array, Array]]:
        people = [name for name, person in self.scene.humans.items() if person.legs == "planted"]
        names = [f"{person}.{side}_sole" for person in people for side in SIDES]
        standing = self.initial_configuration.copy()
        for person in people:
            standing[self.columns(person)] = 0.0
        soles = self.at(standing[None], names)
        return {name: (soles.rotation[0, at], soles.position[0, at]) for name, at in soles.index.items()}


def _without_tilt_limits(agent: AnyAgent) -> AnyAgent:
    return replace(agent, hands=tuple(replace(hand, tilt=180.0) for hand in agent.hands))


def _agent_model(agent: Agent) -> tuple[JointedModel, pin.SE3]:
    """Return an agent's model with joints and frames named `agent.name`, and its placement in the world."""
    if isinstance(agent, Human):
        units = {joint.name: unit_of(joint.prismatic) for joint in human.joints(agent.stature, agent.sex, agent.step)}
        full = JointedModel(human.human_model(agent.stature, agent.sex, agent.step), units)
        rest = {name: units[name].from_si(value) for name, value in rest_posture(agent.stature, agent.sex).items()}
        standing = replace(agent, joints=rest | dict(agent.joints))
        legs = tuple(f"{side}_{joint}" for side in SIDES for joint in human.LEGS)
        built = locked_model(full, standing, agent.locked + (() if agent.legs == "planted" else legs))
    elif isinstance(agent, Robot):
        built = robot_model(agent)
    else:
        raise WorldError(f"{agent.name} is a {type(agent).__name__}, expected a Human or a Robot")
    model = built.model
    for number in range(1, model.njoints):
        model.names[number] = f"{agent.name}.{model.names[number]}"
    links = {frame.name for frame in model.frames if frame.type == pin.FrameType.BODY}
    for number in range(1, model.nframes):
        frame = model.frames[number]
        # A joint and a link may have one name: it is that of the link, as in `frame` of a hand.
        twice = frame.type != pin.FrameType.BODY and frame.name in links
        frame.name = f"{agent.name}.{frame.name}{' (joint)' if twice else ''}"
    couplings = {
        f"{agent.name}.{name}": replace(one, leader=f"{agent.name}.{one.leader}")
        for name, one in built.couplings.items()
    }
    placement = pin.SE3(rotation_about_z(np.radians(agent.yaw)), np.array(agent.position))
    return JointedModel(model, built.units, couplings), placement


def _initial_values(agent: Agent, units: Mapping[str, JointUnit]) -> dict[str, float]:
    """Return `agent.joint` -> initial value [rad, m]; a scene states [deg, m]."""
    values: dict[str, float] = {}
    if isinstance(agent, Human):
        values = dict.fromkeys(human.joint_names(), 0.0) | rest_posture(agent.stature, agent.sex)
    values |= {name: units[name].to_si(value) for name, value in agent.joints.items()}
    return {f"{agent.name}.{name}": value for name, value in values.items()}
