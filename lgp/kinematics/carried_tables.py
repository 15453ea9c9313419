"""Tables that robots carry: each is a frame of the model, at the centre of its top, that stays level."""

from __future__ import annotations

from typing import Final

import numpy as np
import pinocchio as pin

from lgp.errors import WorldError
from lgp.kinematics.features import rotation_about_z
from lgp.scene.model import Scene
from reba.arrays import Array
from reba.errors import did_you_mean

LEVEL: Final = 1e-6
"""Sine of a tilt below which a top is level."""


def add_carried_tables(model: pin.Model, scene: Scene, configuration: Array) -> None:
    """Add the centre of the top of each table that a robot carries to a model, as a frame under its full name.

    Args:
        configuration: of all joints of the model [rad, m].

    Raises:
        WorldError: there is no such link, or the top is not level in all positions of the joints.
    """
    data = model.createData()
    spins = pin.computeJointJacobians(model, data, configuration)[3:5].copy()
    for full, table in scene.carried_tables.items():
        if not model.existFrame(table.frame):
            hint = did_you_mean(table.frame, [frame.name for frame in model.frames])
            raise WorldError(f"{full} is on {table.frame!r}, which no robot of the scene has{hint}; correct its frame")
        carrier = model.frames[model.getFrameId(table.frame)]
        top = pin.SE3(rotation_about_z(np.radians(table.yaw)), np.array([*table.position, table.height]))
        # Level in one position, and turned about the vertical alone: level in all.
        tilts = [
            str(model.names[joint])
            for joint in list(model.supports[carrier.parentJoint])[1:]
            if np.abs(spins[:, model.joints[joint].idx_v]).max() > LEVEL
        ]
        upright = (data.oMi[carrier.parentJoint] * carrier.placement).rotation[2, 2] > 1.0 - LEVEL
        if tilts or not upright:
            why = f"{tilts[0]} tilts it" if tilts else "its z does not point up"
            raise WorldError(
                f"{full} is on {table.frame}, but {why}; expected a link whose z stays vertical: "
                f"give another one{', or lock the joint' if tilts else ''}"
            )
        model.addFrame(pin.Frame(full, carrier.parentJoint, carrier.placement * top, pin.FrameType.OP_FRAME))
