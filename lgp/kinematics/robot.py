"""Robots: where their URDF is, and a Pinocchio model with the joints that do not move locked."""

from __future__ import annotations

from fnmatch import fnmatch
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lgp.errors import WorldError
from lgp.scene.model import Agent, Robot
from lgp.scene.scene_file import known_robots
from reba.errors import did_you_mean

if TYPE_CHECKING:
    import pinocchio as pin

PACKAGE = "example-robot-data"
FOLDER = "cmeel.prefix/share/example-robot-data/robots"
"""Where the package keeps its robots, below its place of installation."""


def urdf_of(model: str) -> Path:
    """Return the URDF of a robot: a path, a known name, or a path below the robots of example-robot-data.

    Raises:
        WorldError: there is no such file, or the package that holds it is not installed.
    """
    path = Path(model)
    if path.suffix == ".urdf" and path.is_file():
        return path
    known = known_robots()
    if model not in known and path.suffix != ".urdf":
        hint = did_you_mean(model, known)
        raise WorldError(f"robot {model!r} is neither known ({', '.join(known)}) nor the path of a .urdf file{hint}")
    inside = known[model]["urdf"] if model in known else model
    try:
        found = Path(str(metadata.distribution(PACKAGE).locate_file(f"{FOLDER}/{inside}")))
    except metadata.PackageNotFoundError as error:
        raise WorldError(
            f"robot {model!r} needs the package {PACKAGE}; install it with: pip install 'dreba[robots]'"
        ) from error
    if not found.is_file():
        raise WorldError(f"{PACKAGE} {metadata.version(PACKAGE)} has no {inside}; give the path of a .urdf file")
    return found


def robot_model(robot: Robot) -> pin.Model:
    """Return the model of a robot, its locked joints held at their first value (0 if none is given).

    Raises:
        WorldError: the URDF cannot be read, or a joint turns without end and is not locked.
    """
    import pinocchio as pin

    path = urdf_of(robot.model)
    try:
        model = pin.buildModelFromUrdf(str(path))
    except (ValueError, RuntimeError) as error:
        raise WorldError(f"{path}: cannot be read as URDF ({' '.join(str(error).split())})") from error
    reduced = locked_model(model, robot, robot.locked)
    for number in range(1, reduced.njoints):
        if reduced.joints[number].nq != 1:
            raise WorldError(
                f"{robot.name}: joint {reduced.names[number]} turns without end; add it to the robot's `locked`"
            )
    return reduced


def locked_model(model: pin.Model, agent: Agent, patterns: tuple[str, ...]) -> pin.Model:
    """Return the model without the joints that match a pattern, held at the agent's first values.

    Raises:
        WorldError: a pattern or a first value names no joint.
    """
    import pinocchio as pin

    names = list(model.names)[1:]
    held = pin.neutral(model)
    for name, value in agent.joints.items():
        if name not in names:
            raise WorldError(f"{agent.name}: no joint {name!r}{did_you_mean(name, names)}")
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 1:
            held[joint.idx_q] = value if slides(joint) else np.radians(value)
    for pattern in patterns:
        if not any(fnmatch(name, pattern) for name in names):
            raise WorldError(f"{agent.name}: no joint matches {pattern!r} in `locked`{did_you_mean(pattern, names)}")
    numbers = [model.getJointId(name) for name in names if any(fnmatch(name, pattern) for pattern in patterns)]
    return pin.buildReducedModel(model, numbers, held) if numbers else model


def slides(joint: pin.JointModel) -> bool:
    """Return whether a joint slides instead of turning."""
    return "P" in joint.shortname().removeprefix("JointModel")[:2]
