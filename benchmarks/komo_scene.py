"""The world of a path problem as a rai scene file, and its task and costs in words that `benchmarks/komo.py` reads."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from lgp.kinematics.world import World
from lgp.path.phases import Phases

Array = NDArray[np.float64]

HOMING = 0.01
"""Weight of the squared distance of every joint from where it starts, per second."""
POSTURE = {
    "lumbar": 2.0,
    "thoracic": 2.0,
    "cervical": 0.5,
    "clavicle": 1.0,
    "shoulder_Y": 0.5,
    "shoulder": 1.0,
    "elbow_Z": 0.5,
    "elbow_Y": 0.3,
    "wrist": 0.5,
    "pelvis_z": 20.0,
}
"""Weight of the squared angle of joints of the human whose names hold a word; the first word counts."""
ELBOW = 1.4
"""[rad] Flexion of the elbow that costs nothing."""


class JointCost:
    """A quadratic cost on joints, used in place of `lgp.path.ergonomics.Ergonomics`: the same cost KOMO is given."""

    stages = (None,)
    lower_bound = 0.0

    def __init__(self, world: World) -> None:
        self.columns = np.arange(world.nq)
        self.parts = [np.array([column]) for column in self.columns]
        self.weights, self.targets = np.zeros(world.nq), np.zeros(world.nq)
        self.home = world.initial_configuration
        for name, column in world.column.items():
            word = next((w for w in POSTURE if w in name), None)
            if name.startswith("human.") and word is not None:
                self.weights[column] = POSTURE[word]
                self.targets[column] = ELBOW if word == "elbow_Z" else 0.0

    def payload(self, loads: Array) -> Array:
        """Return 0 for every load."""
        return np.zeros_like(loads)

    def value(self, q: Array, loads: Array, stage: int = -1) -> Array:
        """Return the cost (n,) of configurations (n, nq)."""
        del loads, stage
        own = (q - self.targets) ** 2 @ self.weights
        return np.asarray(own + HOMING * np.sum((q - self.home) ** 2, axis=1))

    def quadratic_model(self, q: Array, loads: Array, stage: int = -1) -> tuple[Array, Array, list[Array]]:
        """Return value, gradient and the Hessian of each joint."""
        gradient = 2.0 * (self.weights * (q - self.targets) + HOMING * (q - self.home))
        bends = [np.full((len(q), 1, 1), 2.0 * (weight + HOMING)) for weight in self.weights]
        return self.value(q, loads, stage), gradient, bends


def task_text(
    world: World, phases: Phases, keys: Array, cost: JointCost, tolerances: dict[str, float | None], repeat: int
) -> dict[str, Any]:
    """Return the task as plain data; key frames start from `keys`, the configurations (K, nq) at the switches."""
    switches = []
    for switch in phases.switches:
        hand = world.scene.hands[switch.hand]
        row: dict[str, Any] = {"kind": switch.kind, "hand": plain(switch.hand), "tilt": hand.tilt}
        if switch.kind == "place":
            table, thing = world.scene.tables[switch.table], world.scene.objects[switch.object_name]
            margin = min(thing.size[:2]) / 2.0
            reach = [size / 2.0 - margin for size in table.size]
            row |= {"table": plain(switch.table), "reach": reach, "above": thing.size[2] / 2.0}
        switches.append(row)
    return {
        "joints": [plain(name) for name in world.joints],
        "home": world.initial_configuration.tolist(),
        "keys": keys.tolist(),
        "weights": {
            plain(name): [float(cost.weights[column]), float(cost.targets[column])]
            for name, column in world.column.items()
            if cost.weights[column] > 0.0
        },
        "homing": HOMING,
        "seconds": phases.seconds,
        "slices": phases.slices,
        "switches": switches,
        "thing": plain(phases.switches[0].object_name),
        "tolerances": tolerances,
        "repeat": repeat,
    }


def plain(name: str) -> str:
    """Return a name without dots."""
    return name.replace(".", "_")


def scene_text(world: World) -> str:
    """Return the scene in rai's format: the same joints, limits, hands, tables and objects."""
    model = world.model
    lines = ["world {}"]
    for joint in range(1, model.njoints):
        lines += _joint(model, joint)
    for full in world.scene.hands:
        frame = model.frames[world.frame_id(full)]
        parent = _out(model, frame.parentJoint)
        lines.append(f"{plain(full)} ({parent}) {{ Q:{_pose(frame.placement)}, shape:marker, size:[.05] }}")
    for table in world.scene.tables.values():
        turn = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, np.radians(table.yaw)), np.array([*table.position, table.height]))
        lines.append(f"{plain(table.full)} (world) {{ Q:{_pose(turn)}, shape:marker, size:[.05] }}")
    for thing in world.scene.objects.values():
        x, y, yaw = thing.at
        turn = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, np.radians(yaw)), np.array([x, y, thing.size[2] / 2.0]))
        size = " ".join(f"{side:g}" for side in thing.size)
        on = plain(world.scene.tables[thing.on].full)
        lines.append(
            f"{plain(thing.name)} ({on}) {{ Q:{_pose(turn)}, joint:rigid, shape:ssBox, size:[{size} .002], "
            "logical:{ is_object } }"
        )
    return "\n".join(lines) + "\n"


def _joint(model: pin.Model, joint: int) -> list[str]:
    name, parent = plain(model.names[joint]), _out(model, model.parents[joint])
    kind, turned = _kind(model, joint)
    before = model.jointPlacements[joint] * pin.SE3(turned, np.zeros(3))
    low, high = (limits[model.joints[joint].idx_q] for limits in (model.lowerPositionLimit, model.upperPositionLimit))
    return [
        f"{name}_pre ({parent}) {{ Q:{_pose(before)} }}",
        f"{name} ({name}_pre) {{ joint:{kind}, limits:[{low:.9g} {high:.9g}] }}",
        f"{name}_out ({name}) {{ Q:{_pose(pin.SE3(turned.T, np.zeros(3)))} }}",
    ]


def _kind(model: pin.Model, joint: int) -> tuple[str, Array]:
    """Return rai's name of a joint, and the rotation that brings its axis there."""
    short = model.joints[joint].shortname()
    known = {"JointModelR": "hinge", "JointModelP": "trans"}
    if short[:-1] in known:
        return known[short[:-1]] + short[-1], np.eye(3)
    # Any other axis is found in the motion of the joint.
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    motion = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL)[:, model.joints[joint].idx_v]
    slides = not np.any(motion[3:])
    axis = motion[:3] if slides else motion[3:]
    turned = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix()
    return "transZ" if slides else "hingeZ", turned


def _out(model: pin.Model, joint: int) -> str:
    return "world" if joint == 0 else f"{plain(model.names[joint])}_out"


def _pose(pose: pin.SE3) -> str:
    turn = pin.Quaternion(pose.rotation)
    numbers = [*pose.translation, turn.w, turn.x, turn.y, turn.z]
    return "[" + " ".join(f"{number:.9g}" for number in numbers) + "]"
