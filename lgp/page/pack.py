"""A scene animation as plain data for the script of the page: integers in base64, readable without a server."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lgp.page.camera import ANGLE, NEAREST, ROOM, Shot
from lgp.page.mesh import Mesh
from lgp.page.person import Skin
from lgp.page.view import SceneAnimation
from reba.arrays import Array, Indices

FULL = 32767
"""Largest 16-bit integer, which stands for the largest length."""
DIRECTIONS = 2000
"""Number of directions whose outermost points frame a shot."""


def packed(view: SceneAnimation) -> dict[str, Any]:
    """Return a scene animation as plain data.

    Positions are little-endian 16-bit integers times a scale [m]; quaternions x, y, z, w are integers over 32767.
    """
    position = view.place[:, :, :3, 3]
    return {
        "angle": ANGLE,
        "room": ROOM,
        "nearest": NEAREST,
        "meshes": [_mesh(mesh) for mesh in view.meshes],
        "bodies": [
            {"mesh": body.mesh, "frame": body.frame, "place": _rounded(body.place.T.ravel())} for body in view.bodies
        ],
        "skins": [_skin(skin, frames) for skin, frames in view.skins],
        "frames": list(view.frames),
        "time": _rounded(view.time),
        "position": _lengths(position, np.zeros(3)),
        "rotation": _text((_quaternions(view.place[:, :, :3, :3]) * FULL).round().astype("<i2")),
        "ends": view.ends.tolist(),
        "shots": [_shot(shot) for shot in view.shots],
    }


def _mesh(mesh: Mesh) -> dict[str, Any]:
    middle = (mesh.vertices.max(axis=0) + mesh.vertices.min(axis=0)) / 2.0
    palette, index = np.unique(mesh.colours, axis=0, return_inverse=True)
    if len(palette) > 256:
        raise ValueError(f"a mesh has {len(palette)} colours, expected 256 or fewer")
    wide = "<u4" if len(mesh.vertices) > 0xFFFF else "<u2"
    return {
        "vertices": _lengths(mesh.vertices, middle),
        "faces": _text(mesh.faces.astype(wide)),
        "wide": wide == "<u4",
        "palette": palette.tolist(),
        "colours": _text(index.reshape(-1).astype("u1")),
        "gloss": mesh.gloss,
    }


def _skin(skin: Skin, frames: Indices) -> dict[str, Any]:
    return {
        "mesh": _mesh(skin.mesh),
        "frames": frames.tolist(),
        "inverse": [_rounded(inverse.T.ravel()) for inverse in skin.inverse],
        "index": _text(skin.index.astype("u1")),
        "weight": _text((skin.weight * 255.0).round().astype("u1")),
    }


def _shot(shot: Shot) -> dict[str, Any]:
    """Return a shot with only those points that are outermost in some direction: they give the same camera."""
    spread = np.random.default_rng(0).normal(size=(DIRECTIONS, 3))
    chosen = np.unique((shot.points @ spread.T).argmax(axis=0))
    return {"points": _rounded(shot.points[chosen].ravel()), "towards": _rounded(shot.towards)}


def _lengths(values: Array, middle: Array) -> dict[str, Any]:
    scale = max(float(np.abs(values - middle).max(initial=0.0)), 1e-6) / FULL
    return {
        "data": _text(((values - middle) / scale).round().astype("<i2")),
        "scale": scale,
        "middle": _rounded(middle),
    }


def _quaternions(rotation: Array) -> Array:
    """Return (T, F, 4) from (T, F, 3, 3), without jumps of sign from moment to moment."""
    from scipy.spatial.transform import Rotation

    quaternions = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_quat().reshape(*rotation.shape[:2], 4)
    jumps = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=2) < 0.0, -1.0, 1.0)
    quaternions[1:] *= np.cumprod(jumps, axis=0)[:, :, None]
    return np.asarray(quaternions)


def _rounded(values: Array) -> list[float]:
    return [float(value) for value in np.round(values, 6)]


def _text(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
