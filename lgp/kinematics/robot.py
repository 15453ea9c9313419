"""Robot models: URDF to a reduced Pinocchio model without the locked joints."""

from __future__ import annotations

import os
from fnmatch import fnmatch
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lgp.errors import WorldError
from lgp.kinematics.urdf import read_urdf
from lgp.scene.model import Agent, Robot
from lgp.scene.scene_file import known_robots
from reba.errors import did_you_mean
from reba.extras import missing

if TYPE_CHECKING:
    import pinocchio as pin

PACKAGE = "example-robot-data"
FOLDER = "cmeel.prefix/share/example-robot-data/robots"
"""Folder of the robots inside the installed package."""


def urdf_of(model: str) -> Path:
    """Return the URDF file of a robot: a path, a known name, or a path below the robots of example-robot-data.

    Raises:
        WorldError: there is no such file, or the package that holds it is not installed.
    """
    path = Path(model)
    if path.suffix == ".urdf" and os.path.isfile(path):
        return path
    known = known_robots()
    if model not in known and path.suffix != ".urdf":
        hint = did_you_mean(model, known)
        raise WorldError(f"robot model is {model!r}, expected {', '.join(known)} or the path of a .urdf file{hint}")
    inside = known[model]["urdf"] if model in known else model
    try:
        path = Path(str(metadata.distribution(PACKAGE).locate_file(f"{FOLDER}/{inside}")))
    except metadata.PackageNotFoundError as error:
        raise missing(PACKAGE, f"robot {model!r}") from error
    if not os.path.isfile(path):
        raise WorldError(f"{PACKAGE} {metadata.version(PACKAGE)} has no {inside}; give the path of a .urdf file")
    return path


def robot_model(robot: Robot) -> pin.Model:
    """Return the Pinocchio model of a robot, its locked joints fixed at their initial value, 0 by default.

    Raises:
        WorldError: the URDF cannot be read or is damaged, or a joint that is not locked is continuous.
    """
    import pinocchio as pin

    path = urdf_of(robot.model)
    _, text = read_urdf(path)
    try:
        model = pin.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise WorldError(f"{path}: cannot be read as URDF ({reason}); give a valid .urdf file") from error
    reduced = locked_model(model, robot, robot.locked)
    for number in range(1, reduced.njoints):
        if reduced.joints[number].nq != 1:
            raise WorldError(
                f"{robot.name}: joint {reduced.names[number]} is continuous, expected limits; add it to `locked`"
            )
    return reduced


def locked_model(model: pin.Model, agent: Agent, patterns: tuple[str, ...]) -> pin.Model:
    """Return the model with the joints that match a pattern fixed at the agent's initial values.

    Raises:
        WorldError: a pattern or an initial value matches no joint.
    """
    import pinocchio as pin

    names = list(model.names)[1:]
    fixed = pin.neutral(model)
    for name, value in agent.joints.items():
        if name not in names:
            raise WorldError(f"{agent.name}: no joint {name!r}{did_you_mean(name, names)}")
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 1:
            fixed[joint.idx_q] = value if slides(joint) else np.radians(value)
    for pattern in patterns:
        if not any(fnmatch(name, pattern) for name in names):
            raise WorldError(f"{agent.name}: no joint matches {pattern!r} in `locked`{did_you_mean(pattern, names)}")
    numbers = [model.getJointId(name) for name in names if any(fnmatch(name, pattern) for pattern in patterns)]
    return pin.buildReducedModel(model, numbers, fixed) if numbers else model


def slides(joint: pin.JointModel) -> bool:
    """Return whether a joint is prismatic."""
    return "P" in joint.shortname().removeprefix("JointModel")[:2]
