"""A plan as an animated scene: meshes, the frames that they move with, and the poses of these over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from lgp.kinematics import human
from lgp.kinematics.features import exponential
from lgp.kinematics.interpolation import interpolate
from lgp.motion import Motion
from lgp.page.camera import Shot, shots_of
from lgp.page.mesh import Mesh, surface_points
from lgp.page.objects import object_mesh, obstacle_mesh, robot_meshes, table_mesh
from lgp.page.person import Skin, figure
from lgp.plan_record import Plan
from lgp.scene.model import Human
from lgp.scene.surroundings import fixed_bodies
from reba.arrays import Array, Indices

RATE = 20.0
"""[Hz] Smallest rate of moments; players interpolate between them."""
SPACING = 0.03
"""[m] Distance between the surface points of the occlusion test."""


@dataclass(frozen=True, eq=False)
class MeshInstance:
    """A mesh (its number) with a (4, 4) pose in a frame (its number, None for the world)."""

    mesh: int
    frame: int | None
    place: Array


@dataclass(frozen=True, eq=False)
class SceneAnimation:
    """An animated scene.

    Attributes:
        meshes: each once.
        bodies: rigid meshes in their frames.
        skins: of each person, and the frames (B,) of its bones.
        time: (T,) moments [s].
        place: (T, F, 4, 4) poses of the frames in the world [m].
        ends: (K,) number of the last moment of each phase.
        shots: of the start, then of each phase.
    """

    meshes: tuple[Mesh, ...]
    bodies: tuple[MeshInstance, ...]
    skins: tuple[tuple[Skin, Indices], ...]
    frames: tuple[str, ...]
    time: Array
    place: Array
    ends: Indices
    shots: tuple[Shot, ...]


def scene_animation(motion: Motion) -> SceneAnimation:
    """Return the animation of a feasible plan, as the plan interpolates between its slices.

    Raises:
        LgpError: the meshes of a robot cannot be read.
    """
    dense, steps = _dense(motion)
    stage = _Stage(dense)
    stage.tables()
    stage.objects()
    stage.robots()
    skins = tuple(stage.person(number, one) for number, one in enumerate(dense.plan.scene.humans.values()))
    place = np.stack(list(stage.place.values()), axis=1)
    ends = (np.arange(dense.phases.count) + 1) * dense.phases.slices
    points = [surface_points(mesh, SPACING) for mesh in stage.meshes]
    solid = [_solid(stage, skins, points, place[end]) for end in (0, *ends)]
    return SceneAnimation(
        tuple(stage.meshes),
        tuple(stage.bodies),
        skins,
        tuple(stage.place),
        dense.time,
        place,
        ends,
        shots_of(dense, dict(zip(stage.place, range(len(stage.place)), strict=True)), place, solid, steps),
    )


def _dense(motion: Motion) -> tuple[Motion, int]:
    """Return the motion in shorter slices, and their number per slice of the plan."""
    plan = motion.plan
    longest = float(np.diff(motion.time).max())
    steps = max(1, int(np.ceil(longest * RATE - 1e-9)))
    points = np.arange(steps * len(plan.time))
    before, share = points // steps, (points % steps + 1) / steps
    at = motion.time[before] * (1.0 - share) + motion.time[before + 1] * share
    path = interpolate(motion.path, before, share)
    finer: Plan = replace(plan, path=path, time=at, phase=np.repeat(plan.phase, steps))
    return Motion(finer, motion.world), steps


def _solid(stage: _Stage, skins: tuple[tuple[Skin, Indices], ...], points: list[Array], place: Array) -> Array:
    """Return the surface points (k, 3) of all bodies at a moment in the world [m], from those of each mesh."""
    solid = []
    for body in stage.bodies:
        at = body.place if body.frame is None else place[body.frame] @ body.place
        solid.append(points[body.mesh] @ at[:3, :3].T + at[:3, 3])
    solid += [skinned(skin, place[frames]) for skin, frames in skins]
    return np.concatenate(solid)


class _Stage:
    """Builder of a scene animation: collects meshes, frames and bodies."""

    def __init__(self, motion: Motion) -> None:
        self.motion, self.scene = motion, motion.plan.scene
        self.meshes: list[Mesh] = []
        self.bodies: list[MeshInstance] = []
        self.place: dict[str, Array] = {}
        self._known: dict[str, int] = {}

    def tables(self) -> None:
        for name, table in self.scene.tables.items():
            frame, place = None, _standing((*table.position, 0.0), table.yaw)
            if table.frame:
                top = self.motion.frames([name])[name]
                frame, place = self.frame(name, _matrices(top.rotation, top.position)), np.eye(4)
            self.bodies.append(MeshInstance(self.mesh(name, table_mesh(table)), frame, place))
        for name, body in fixed_bodies(self.scene).items():
            place = np.eye(4)
            place[:3, :3], place[:3, 3] = exponential(np.radians(np.array(body.rotation))), body.position
            self.bodies.append(MeshInstance(self.mesh(name, obstacle_mesh(body)), None, place))

    def objects(self) -> None:
        for number, (name, scene_object) in enumerate(self.scene.objects.items()):
            poses = self.motion.object_poses(name)
            frame = self.frame(name, _matrices(poses.rotation, poses.position))
            self.bodies.append(MeshInstance(self.mesh(name, object_mesh(scene_object, number)), frame, np.eye(4)))

    def robots(self) -> None:
        for robot in self.scene.robots.values():
            visuals = robot_meshes(robot)
            links = list(dict.fromkeys(f"{robot.name}.{part.link}" for part in visuals))
            poses = self.motion.frames(links)
            frames: dict[str, tuple[int | None, Array]] = {}
            for link in links:
                place = _matrices(poses[link].rotation, poses[link].position)
                fixed = bool(np.ptp(place, axis=0).max() < 1e-9)
                frames[link] = (None, place[0]) if fixed else (self.frame(link, place), np.eye(4))
            for part in visuals:
                number, place = frames[f"{robot.name}.{part.link}"]
                self.bodies.append(MeshInstance(self.mesh(part.key, part.mesh), number, place @ part.place))

    def person(self, number: int, person: Human) -> tuple[Skin, Indices]:
        shape = figure(person.stature, person.sex, number)
        joints = list(dict.fromkeys([*shape.skin.bones, *(joint for joint, _ in shape.parts)]))
        numbers = {
            joint: self.frame(f"{person.name}.{joint}", place)
            for joint, place in _joints(person, self.motion.joints_of(person), joints, self._ground(person)).items()
        }
        for joint, mesh in shape.parts:
            self.bodies.append(MeshInstance(self.mesh(f"{person.name}.{joint}", mesh), numbers[joint], np.eye(4)))
        return shape.skin, np.array([numbers[bone] for bone in shape.skin.bones])

    def _ground(self, person: Human) -> Array:
        """Return (T, 4, 4), or (1, 4, 4) of one who does not step: where a person stands in the world."""
        if not person.ground:
            return _standing(person.position, person.yaw)[None]
        poses = self.motion.frames([person.ground])[person.ground]
        return _matrices(poses.rotation, poses.position)

    def frame(self, name: str, place: Array) -> int:
        self.place[name] = place
        return len(self.place) - 1

    def mesh(self, key: str, mesh: Mesh) -> int:
        if key not in self._known:
            self._known[key] = len(self.meshes)
            self.meshes.append(mesh)
        return self._known[key]


def _joints(person: Human, values: Mapping[str, Array], names: list[str], ground: Array) -> dict[str, Array]:
    """Return joint -> (T, 4, 4) in the world, from the values of all joints (T,) [rad, m]."""
    import pinocchio as pin

    model = human.human_model(person.stature, person.sex)
    data = model.createData()
    columns = {name: model.joints[model.getJointId(name)].idx_q for name in values}
    q = np.empty((len(next(iter(values.values()))), model.nq))
    for name, column in columns.items():
        q[:, column] = values[name]
    poses = np.empty((len(names), len(q), 4, 4))
    for row, configuration in enumerate(q):
        pin.forwardKinematics(model, data, configuration)
        for number, name in enumerate(names):
            poses[number, row] = ground[row % len(ground)] @ data.oMi[model.getJointId(name)].homogeneous
    return dict(zip(names, poses, strict=True))


def skinned(skin: Skin, place: Array) -> Array:
    """Return the vertices (n, 3) of a skin whose bones are at (B, 4, 4) in the world [m]."""
    points = np.concatenate([skin.mesh.vertices, np.ones((len(skin.mesh.vertices), 1))], axis=1)
    blended = np.einsum("nk,nkij->nij", skin.weight, (place @ skin.inverse)[skin.index])
    return np.asarray(np.einsum("nij,nj->ni", blended[:, :3], points))


def _standing(position: tuple[float, ...], yaw: float) -> Array:
    turn = np.radians(yaw)
    place = np.eye(4)
    place[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    place[:3, 3] = position
    return place


def _matrices(rotation: Array, position: Array) -> Array:
    """Return (T, 4, 4) from (T, 3, 3) and (T, 3)."""
    place = np.zeros((len(rotation), 4, 4))
    place[:, :3, :3], place[:, :3, 3], place[:, 3, 3] = rotation, position, 1.0
    return place
