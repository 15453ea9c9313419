"""One kinematic model of everybody: the human and all robots side by side, evaluated for many configurations at once.

A configuration q (n,) holds one number per moving joint [rad, m]; objects and tables are no joints. Batches are
(slices, n). Jacobians have the linear part of the motion in rows 0-2 and the angular in 3-5, in world axes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import pinocchio as pin

from lgp.errors import WorldError
from lgp.kinematics import human
from lgp.kinematics import leg_ik as leg_ik_
from lgp.kinematics.features import cross
from lgp.kinematics.robot import locked_model, robot_model, slides
from lgp.scene.model import Agent, Human, Robot, Scene
from reba.arrays import Array, Flags, Indices
from reba.errors import did_you_mean
from reba.posture.columns import SIDES

AnyAgent = TypeVar("AnyAgent", bound=Agent)
FEW = 12
"""Configurations up to which Pinocchio, one after the other, is faster than all at once."""
RADIAN = (180.0 / np.pi, "deg")
"""How a radian is shown to people."""


@dataclass(frozen=True)
class FramePlacement:
    """Rotations (n, 3, 3) and positions (n, 3) of a frame over n slices, and its Jacobian (n, 6, columns)."""

    rotation: Array
    position: Array
    jacobian: Array

    def axis(self, number: int) -> Array:
        """Return axis 0, 1 or 2 as (n, 3)."""
        return self.rotation[:, :, number]


class Kinematics:
    """Placements of some frames for a batch of configurations; Jacobians are made when asked for.

    Attributes:
        rotation: (n, F, 3, 3).
        position: (n, F, 3).
        spatial: (n, 6, nq) motion of each joint as felt at the world's origin.
    """

    def __init__(self, world: World, names: Sequence[str], rotation: Array, position: Array, spatial: Array) -> None:
        self.world, self.index = world, {name: number for number, name in enumerate(names)}
        self.rotation, self.position, self.spatial = rotation, position, spatial
        self._places: dict[str, FramePlacement] = {}

    def __len__(self) -> int:
        return len(self.rotation)

    def rows(self, which: slice | Indices) -> Kinematics:
        """Return the same for some of the slices."""
        return Kinematics(self.world, list(self.index), self.rotation[which], self.position[which], self.spatial[which])

    def placement(self, name: str) -> FramePlacement:
        """Return a frame with its Jacobian (n, 6, nq)."""
        if name not in self._places:
            at = self.index[name]
            position = self.position[:, at]
            jacobian = self.point_jacobian(name, position)
            self._places[name] = FramePlacement(self.rotation[:, at], position, jacobian)
        return self._places[name]

    def point_jacobian(self, name: str, points: Array) -> Array:
        """Return the Jacobian (n, 6, nq) of (n, 3) points that move with a frame."""
        jacobian = self.spatial * self.world.support(name)
        jacobian[:, :3] += cross(jacobian[:, 3:], points)
        return jacobian


class World:
    """Everybody's kinematics, and the scene they are in.

    Attributes:
        scene: tables and objects (of which only these may change with `with_scene`).
        joints: `agent.joint` for each column of q.
        lower, upper: limits [rad, m], (nq,).
        initial_configuration: (nq,).
        initial_values: first value of every joint [rad, m], those that are held included.
        planted: feet that stay where they are: frame -> ((3, 3) rotation, (3,) position).

    Example:
        >>> from lgp.scene.scene_file import load_scene
        >>> world = World(load_scene("screwdriver"))
        >>> kinematics = world.at(world.initial_configuration[None], ["human.right_hand"])
        >>> kinematics.placement("human.right_hand").position.shape
        (1, 3)
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.model = pin.Model()
        first: dict[str, float] = dict.fromkeys((f"human.{name}" for name in human.joint_names()), 0.0)
        for agent in scene.agents:
            self.model = pin.appendModel(self.model, *_placed(agent))
            first |= _first(agent)
        self.joints = tuple(self.model.names)[1:]
        self.column = {name: self.model.joints[number + 1].idx_q for number, name in enumerate(self.joints)}
        self.lower, self.upper = self.model.lowerPositionLimit.copy(), self.model.upperPositionLimit.copy()
        self.initial_values = first
        self.initial_configuration = self._start()
        self._data = self.model.createData()
        self._forward = Forward(self.model)
        self._support: dict[str, Array] = {}
        self._add_hands()
        self.planted = self._planted()

    @property
    def nq(self) -> int:
        """Number of joints."""
        return int(self.model.nq)

    def with_scene(self, scene: Scene) -> World:
        """Return this world with other tables and objects; the agents must be the same.

        Raises:
            WorldError: the scene has other agents.
        """
        if scene.agents != self.scene.agents:
            raise WorldError("another scene may change tables and objects only; build a new World for other agents")
        other = object.__new__(World)
        other.__dict__ = {**self.__dict__, "scene": scene}
        return other

    def with_free_hands(self, agent: str) -> World:
        """Return this world without limits on how the hands of an agent are tilted at tables."""
        scene = self.scene
        if scene.human is not None and scene.human.name == agent:
            scene = replace(scene, human=_free_hands(scene.human))
        elif agent in scene.robots:
            scene = replace(scene, robots={**scene.robots, agent: _free_hands(scene.robots[agent])})
        other = object.__new__(World)
        other.__dict__ = {**self.__dict__, "scene": scene}
        return other

    def columns(self, agent: str) -> Indices:
        """Return the columns of q that belong to an agent."""
        found = [column for name, column in self.column.items() if name.startswith(f"{agent}.")]
        if not found and agent not in {one.name for one in self.scene.agents}:
            raise WorldError(f"no agent {agent!r}{did_you_mean(agent, [one.name for one in self.scene.agents])}")
        return np.array(found, dtype=np.intp)

    def frame_id(self, name: str) -> int:
        """Return the number of a frame of the model.

        Raises:
            WorldError: there is no such frame.
        """
        if not self.model.existFrame(name):
            known = [frame.name for frame in self.model.frames]
            raise WorldError(f"no frame {name!r} in the scene{did_you_mean(name, known)}")
        return int(self.model.getFrameId(name))

    def support(self, name: str) -> Array:
        """Return (nq,) 1 where a joint moves a frame, else 0."""
        if name not in self._support:
            mask = np.zeros(self.nq)
            for joint in list(self.model.supports[self.model.frames[self.frame_id(name)].parentJoint])[1:]:
                mask[self.model.joints[joint].idx_q] = 1.0
            self._support[name] = mask
        return self._support[name]

    def at(self, q: Array, names: Iterable[str]) -> Kinematics:
        """Return the placements of frames for (n, nq) configurations.

        Raises:
            WorldError: q has another number of columns, or a frame is unknown.
        """
        q = np.ascontiguousarray(q, dtype=float)
        if q.ndim != 2 or q.shape[1] != self.nq:
            raise WorldError(f"configurations have shape {q.shape}, expected (slices, {self.nq})")
        wanted = list(dict.fromkeys(names))
        numbers = [self.frame_id(name) for name in wanted]
        if len(q) > FEW:
            found = self._forward.at(q, numbers)
            return Kinematics(self, wanted, found.rotation, found.position, found.spatial)
        rotation, position = np.empty((len(q), len(wanted), 3, 3)), np.empty((len(q), len(wanted), 3))
        spatial = np.empty((len(q), 6, self.nq))
        model, data = self.model, self._data
        jacobians, placement = pin.computeJointJacobians, pin.updateFramePlacement
        for row, configuration in enumerate(q):
            spatial[row] = jacobians(model, data, configuration)
            for at, number in enumerate(numbers):
                placed = placement(model, data, number)
                rotation[row, at], position[row, at] = placed.rotation, placed.translation
        return Kinematics(self, wanted, rotation, position, spatial)

    def _start(self) -> Array:
        """Return the first configuration; a joint without a first value is as near to 0 as its limits let it.

        Raises:
            WorldError: a first value is outside the limits.
        """
        start = np.clip(np.zeros(self.nq), self.lower, self.upper)
        for name, column in self.column.items():
            value = self.initial_values.get(name)
            if value is None:
                continue
            low, high = self.lower[column], self.upper[column]
            if not low - 1e-9 <= value <= high + 1e-9:
                scale, unit = (1.0, "m") if slides(self.model.joints[self.model.getJointId(name)]) else RADIAN
                raise WorldError(
                    f"{name} starts at {value * scale:g} {unit}, expected {low * scale:g} to {high * scale:g} {unit}"
                )
            start[column] = min(max(value, low), high)
        return start

    def _add_hands(self) -> None:
        """Add a frame under the full name of each end-effector that has none yet."""
        for full, hand in self.scene.hands.items():
            if self.model.existFrame(full):
                continue
            base = self.model.frames[self.frame_id(f"{hand.agent}.{hand.frame}")]
            offset = base.placement * pin.SE3(np.eye(3), np.array([0.0, 0.0, hand.reach]))
            self.model.addFrame(pin.Frame(full, base.parentJoint, offset, pin.FrameType.OP_FRAME))
        self._data = self.model.createData()

    def _planted(self) -> Mapping[str, tuple[Array, Array]]:
        if self.scene.human is None or self.scene.human.legs != "planted":
            return {}
        names = [f"human.{side}_sole" for side in SIDES]
        standing = self.initial_configuration.copy()
        standing[self.columns("human")] = 0.0
        found = self.at(standing[None], names)
        return {name: (found.rotation[0, at], found.position[0, at]) for name, at in found.index.items()}


def _free_hands(agent: AnyAgent) -> AnyAgent:
    return replace(agent, hands=tuple(replace(hand, tilt=180.0) for hand in agent.hands))


def _placed(agent: Agent) -> tuple[pin.Model, int, pin.SE3]:
    """Return an agent's model under its own names, the frame it stands in (the world), and its place."""
    if isinstance(agent, Human):
        model = human.human_model(agent.stature, agent.sex)
        first = {name: _degrees(name, value) for name, value in leg_ik_.rest(agent.stature, agent.sex).items()}
        whole = Human(**{**vars(agent), "joints": first | dict(agent.joints)})
        legs = tuple(f"{side}_{joint}" for side in SIDES for joint in human.LEGS)
        model = locked_model(model, whole, agent.locked + (() if agent.legs == "planted" else legs))
    elif isinstance(agent, Robot):
        model = robot_model(agent)
    else:
        raise WorldError(f"{agent.name} is neither a human nor a robot")
    for number in range(1, model.njoints):
        model.names[number] = f"{agent.name}.{model.names[number]}"
    for number in range(1, model.nframes):
        model.frames[number].name = f"{agent.name}.{model.frames[number].name}"
    yaw = np.radians(agent.yaw)
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    return model, 0, pin.SE3(turn, np.array(agent.position))


def _degrees(name: str, value: float) -> float:
    return value if name in ("pelvis_x", "pelvis_y", "pelvis_z") else float(np.degrees(value))


def _first(agent: Agent) -> dict[str, float]:
    """Return joint -> first value [rad, m] by full name."""
    values = leg_ik_.rest(agent.stature, agent.sex) if isinstance(agent, Human) else {}
    for name, value in agent.joints.items():
        slide = name in ("pelvis_x", "pelvis_y", "pelvis_z")
        values[name] = value if slide else float(np.radians(value))
    return {f"{agent.name}.{name}": value for name, value in values.items()}


@dataclass(frozen=True)
class _Level:
    """The k joints as far from the world as each other: their numbers, carriers, columns of q and placements."""

    joints: Indices
    parents: Indices
    columns: Indices
    slides: Flags
    rotation: Array
    """(k, 3, 3)"""
    position: Array
    """(k, 3, 1)"""


@dataclass(frozen=True)
class Placements:
    """What `Forward.at` returns, for n configurations and F frames.

    Attributes:
        rotation: (n, F, 3, 3).
        position: (n, F, 3).
        spatial: (n, 6, nq) motion of each joint as felt at the world's origin, linear part first.
    """

    rotation: Array
    position: Array
    spatial: Array


class Forward:
    """Forward kinematics of a model whose joints each have one coordinate.

    Args:
        model: the kinematic tree; frames may still be added to it.

    Example:
        >>> Forward(model).at(q, [model.getFrameId("human.left_hand")]).position      # doctest: +SKIP
    """

    def __init__(self, model: pin.Model) -> None:
        self.model = model
        data = model.createData()
        spatial = pin.computeJointJacobians(model, data, np.zeros(model.nq)).reshape(6, model.nq)
        count = model.njoints
        self._turns = np.tile(np.eye(3), (count, 1, 1))
        self._columns = np.array([0, *(model.joints[number].idx_q for number in range(1, count))], dtype=np.intp)
        self._slides = np.zeros(count, dtype=bool)
        depth = np.zeros(count, dtype=np.intp)
        parents = np.array(list(model.parents), dtype=np.intp)
        for number in range(1, count):
            motion = spatial[:, self._columns[number]]
            self._slides[number] = not np.any(np.abs(motion[3:]) > 0.5)
            axis = data.oMi[number].rotation.T @ (motion[:3] if self._slides[number] else motion[3:])
            self._turns[number] = _onto(axis)
            depth[number] = depth[parents[number]] + 1
        self._levels = []
        for level in range(1, int(depth.max(initial=0)) + 1):
            joints = np.flatnonzero(depth == level)
            carried = self._turns[parents[joints]].transpose(0, 2, 1)
            placed = [model.jointPlacements[int(joint)] for joint in joints]
            rotation = carried @ np.array([one.rotation for one in placed]) @ self._turns[joints]
            position = carried @ np.array([one.translation for one in placed])[:, :, None]
            self._levels.append(
                _Level(joints, parents[joints], self._columns[joints], self._slides[joints], rotation, position)
            )

    def at(self, q: Array, frames: Sequence[int]) -> Placements:
        """Return the placements of frames, by their numbers in the model, for configurations (n, nq)."""
        n, count = len(q), self.model.njoints
        rotations, positions = np.empty((count, n, 3, 3)), np.empty((count, n, 3))
        rotations[0], positions[0] = np.eye(3), 0.0
        sine, cosine = np.sin(q.T)[:, :, None], np.cos(q.T)[:, :, None]
        for level in self._levels:
            before = rotations[level.parents].reshape(-1, 3 * n, 3)
            at = (before @ level.rotation).reshape(-1, n, 3, 3)
            position = positions[level.parents] + (before @ level.position).reshape(-1, n, 3)
            c, s = cosine[level.columns], sine[level.columns]
            if level.slides.any():
                c[level.slides], s[level.slides] = 1.0, 0.0
                position[level.slides] += at[level.slides, :, :, 2] * q.T[level.columns[level.slides], :, None]
            along, across = at[..., 0], at[..., 1]
            turned = rotations[level.joints]
            turned[..., 0], turned[..., 1], turned[..., 2] = c * along + s * across, c * across - s * along, at[..., 2]
            rotations[level.joints], positions[level.joints] = turned, position
        carriers = np.array([self.model.frames[frame].parentJoint for frame in frames], dtype=np.intp)
        placed = [self.model.frames[frame].placement for frame in frames]
        turn = self._turns[carriers].transpose(0, 2, 1)
        before = rotations[carriers].reshape(-1, 3 * n, 3)
        rotation = (before @ (turn @ np.array([one.rotation for one in placed]))).reshape(-1, n, 3, 3)
        offset = turn @ np.array([one.translation for one in placed])[:, :, None]
        position = positions[carriers] + (before @ offset).reshape(-1, n, 3)
        spatial = self._spatial(rotations[1:, :, :, 2], positions[1:])
        return Placements(rotation.transpose(1, 0, 2, 3), position.transpose(1, 0, 2), spatial)

    def _spatial(self, axes: Array, positions: Array) -> Array:
        """Return the motions (n, 6, nq) of joints with given axes and positions (joints, n, 3)."""
        spatial = np.zeros((axes.shape[1], 6, self.model.nq))
        columns, slides = self._columns[1:], self._slides[1:]
        axes, positions = axes.transpose(2, 1, 0), positions.transpose(2, 1, 0)
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            moment = positions[j] * axes[k] - positions[k] * axes[j]
            spatial[:, i, columns] = np.where(slides, axes[i], moment)
            spatial[:, 3 + i, columns] = np.where(slides, 0.0, axes[i])
        return spatial


def _onto(axis: Array) -> Array:
    """Return a rotation (3, 3) whose third column is a unit vector."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(other, axis)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])
