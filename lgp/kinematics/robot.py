"""Robot models: URDF to a reduced Pinocchio model without the locked joints, and joints that follow others."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatch
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from lgp.errors import WorldError
from lgp.kinematics.ros_packages import find_package, searched_folders_message, split_package
from lgp.kinematics.urdf import read_urdf
from lgp.scene.joint_units import JointUnit, unit_of
from lgp.scene.model import Agent, Robot
from lgp.scene.scene_file import known_robots
from reba.arrays import Array
from reba.errors import did_you_mean
from reba.extras import missing

if TYPE_CHECKING:
    import pinocchio as pin

PACKAGE = "example-robot-data"
FOLDER = "cmeel.prefix/share/example-robot-data/robots"
"""Folder of the robots inside the installed package."""


ENDLESS: Final = 2.0 * np.pi
"""[rad] How far a joint without end turns each way from where it starts; every orientation is half of it away."""


@dataclass(frozen=True)
class Coupling:
    """How a joint follows another one (`<mimic>`): factor * value of the `leader` + offset [rad, m]."""

    leader: str
    factor: float
    offset: float


@dataclass(frozen=True)
class JointedModel:
    """The kinematic model of an agent.

    Attributes:
        model: Pinocchio model of the joints that move.
        units: joint -> its unit, locked joints included.
        couplings: joints of the model that follow another one of it.
    """

    model: pin.Model
    units: Mapping[str, JointUnit]
    couplings: Mapping[str, Coupling] = field(default_factory=dict)


def urdf_of(model: str, packages: tuple[str, ...] = ()) -> Path:
    """Return the URDF file of a robot: a path, a known name, or a path below the robots of example-robot-data.

    Args:
        packages: folders in which the package of `package://NAME/...` is looked for, before those of the environment.

    Raises:
        WorldError: there is no such file, or the package that holds it is not installed.
    """
    owner, inside = split_package(model)
    if owner:
        package = find_package(owner, packages)
        if package is None:
            raise WorldError(f"robot model {model!r} does not exist: {searched_folders_message(owner, packages)}")
        model = str(package / inside)
    path = Path(model)
    if path.suffix == ".urdf" and os.path.isfile(path):
        return path
    known = known_robots()
    if model not in known and path.suffix != ".urdf":
        xacro = f"; write that file with: xacro {path.name} > {path.name.partition('.')[0]}.urdf"
        hint = xacro if path.suffix == ".xacro" else did_you_mean(model, known)
        raise WorldError(f"robot model is {model!r}, expected {', '.join(known)} or the path of a .urdf file{hint}")
    if path.is_absolute() or model.startswith("."):
        raise WorldError(
            f"robot model is {model!r}, but there is no such file; give its path from the folder of the scene"
        )
    inside = known[model]["urdf"] if model in known else model
    try:
        path = Path(str(metadata.distribution(PACKAGE).locate_file(f"{FOLDER}/{inside}")))
    except metadata.PackageNotFoundError as error:
        raise missing(PACKAGE, f"robot {model!r}") from error
    if not os.path.isfile(path):
        raise WorldError(
            f"robot model is {model!r}, but there is no such file, and {PACKAGE} {metadata.version(PACKAGE)} has no "
            f"{inside}; give the path of a .urdf file from the folder of the scene"
        )
    return path


def robot_model(robot: Robot) -> JointedModel:
    """Return the model of a robot, its locked joints fixed at their initial value, 0 by default.

    Raises:
        WorldError: the URDF cannot be read or is damaged, or a joint that is not locked has no single coordinate.
    """
    import pinocchio as pin

    path = urdf_of(robot.model, robot.packages)
    root, text = read_urdf(path, robot.base)
    try:
        model = pin.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise WorldError(f"{path}: cannot be read as URDF ({reason}); give a valid .urdf file") from error
    kinds = {str(joint.get("name")): joint.get("type") for joint in root.findall("joint")}
    units = {name: unit_of(slides=kind == "prismatic") for name, kind in kinds.items()}
    couplings = _couplings(root)
    for name, kind in kinds.items():
        if kind == "continuous":
            start, turns = units[name].to_si(robot.joints.get(name, 0.0)), np.inf if name in couplings else ENDLESS
            column = model.joints[model.getJointId(name)].idx_q
            model.lowerPositionLimit[column], model.upperPositionLimit[column] = start - turns, start + turns
    reduced = locked_model(JointedModel(model, units, couplings), robot, robot.locked)
    for number in range(1, reduced.model.njoints):
        if reduced.model.joints[number].nq != 1:
            raise WorldError(
                f"{robot.name}: joint {reduced.model.names[number]} is floating, expected one coordinate; "
                "add it to `locked`"
            )
    return reduced


def _couplings(root: ET.Element) -> dict[str, Coupling]:
    """Return how joints follow others, each by the one that follows none."""
    couplings: dict[str, Coupling] = {}
    for joint in root.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("type") not in ("fixed", "floating"):
            factor, offset = (float(mimic.get(key, text)) for key, text in (("multiplier", "1"), ("offset", "0")))
            couplings[str(joint.get("name"))] = Coupling(mimic.get("joint", ""), factor, offset)
    for name, one in couplings.items():
        while one.leader in couplings:
            next_one = couplings[one.leader]
            one = Coupling(next_one.leader, one.factor * next_one.factor, one.factor * next_one.offset + one.offset)
        couplings[name] = one
    return couplings


def locked_model(agent_model: JointedModel, agent: Agent, patterns: tuple[str, ...]) -> JointedModel:
    """Return the model with the joints that match a pattern, and those that follow them, fixed at initial values.

    Raises:
        WorldError: a pattern or an initial value matches no joint, or one that follows another joint.
    """
    import pinocchio as pin

    model, couplings = agent_model.model, agent_model.couplings
    names = list(model.names)[1:]
    for name in agent.joints:
        if name not in names:
            raise WorldError(f"{agent.name}: no joint {name!r}{did_you_mean(name, names)}")
        if name in couplings:
            leader = couplings[name].leader
            raise WorldError(f"{agent.name}: joint {name!r} follows {leader!r} (<mimic>); give the value of {leader!r}")
    for pattern in patterns:
        if not any(fnmatch(name, pattern) for name in names):
            raise WorldError(f"{agent.name}: no joint matches {pattern!r} in `locked`{did_you_mean(pattern, names)}")
    locked = {name for name in names if any(fnmatch(name, pattern) for pattern in patterns)}
    for name in locked & set(couplings):
        leader = couplings[name].leader
        if leader in names and leader not in locked:
            raise WorldError(f"{agent.name}: joint {name!r} in `locked` follows {leader!r} (<mimic>); lock {leader!r}")
    values = {name: agent_model.units[name].to_si(agent.joints.get(name, 0.0)) for name in names}
    values |= {name: one.factor * values.get(one.leader, 0.0) + one.offset for name, one in couplings.items()}
    # What follows a joint that does not move does not move either.
    locked |= {name for name, one in couplings.items() if one.leader in locked or one.leader not in names}
    fixed = pin.neutral(model)
    for name, value in values.items():
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 1:
            fixed[joint.idx_q] = value
    moving = {name: one for name, one in couplings.items() if name not in locked}
    numbers = [model.getJointId(name) for name in names if name in locked]
    return JointedModel(_reduced(model, numbers, fixed) if numbers else model, agent_model.units, moving)


def _reduced(model: pin.Model, numbers: list[int], fixed: Array) -> pin.Model:
    """Return a model without some of its joints, which Pinocchio looks for by names that links may have as well."""
    import pinocchio as pin

    model, names, aside = model.copy(), set(model.names), " (link)"
    links = [number for number, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY]
    for number in links:
        if model.frames[number].name in names:
            model.frames[number].name += aside
    reduced = pin.buildReducedModel(model, numbers, fixed)
    for number in range(reduced.nframes):
        reduced.frames[number].name = reduced.frames[number].name.removesuffix(aside)
    return reduced
