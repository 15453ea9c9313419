"""Meshes of the person: a skin that bends with the bones (linear blend skinning), a head, hands and shoes."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lgp.kinematics import human
from lgp.page.mesh import Mesh, Solid, painted, surface
from lgp.scene import body_measures as body_measures_
from reba.arrays import Array
from reba.posture.columns import SIDES

TABLE = Path(__file__).parent / "data" / "person.toml"
INFLUENCES = 4
"""Number of bones with a weight at a vertex of the skin."""
SOFT = 0.012
"""[m] Length over which the weight of a bone decays by a factor e with its distance."""


@dataclass(frozen=True, eq=False)
class Skin:
    """A mesh that moves with several bones.

    Attributes:
        mesh: in the binding posture, in the frame of the person.
        bones: names of the joints.
        inverse: (B, 4, 4) from that frame into each bone in the binding posture.
        index: (n, 4) bones of each vertex.
        weight: (n, 4), rows sum to 1.
    """

    mesh: Mesh
    bones: tuple[str, ...]
    inverse: Array
    index: NDArray[np.int64]
    weight: Array


@dataclass(frozen=True, eq=False)
class PersonModel:
    """A person: the skin, and rigid parts as (joint, mesh in the frame of the joint)."""

    skin: Skin
    parts: tuple[tuple[str, Mesh], ...]


@cache
def figure(stature: float, sex: str, number: int = 0) -> PersonModel:
    """Return the meshes of a person of a stature [m] and a sex, "male" or "female", in the shirt of a number.

    Raises:
        SceneError: the stature is out of range, or the sex is unknown.
    """
    table = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    table["colours"]["shirt"] = table["shirts"][number % len(table["shirts"])]
    shape = _Shape(table, stature, sex)
    parts = [("head", "")] + [(part, side) for part in ("hand", "shoe") for side in SIDES]
    return PersonModel(shape.skin(), tuple(shape.part(part, side) for part, side in parts))


class _Shape:
    """Solids of the table person.toml on the joints of a person in its posture `bind`."""

    def __init__(self, table: dict[str, Any], stature: float, sex: str) -> None:
        import pinocchio as pin

        self.table, self.scale = table, stature / table["stature"]
        self.ankle = body_measures_.lengths(stature, sex)["ankle_height"]
        model = human.human_model(stature, sex)
        data, q = model.createData(), np.zeros(model.nq)
        for pattern, degrees in table["bind"].items():
            for side in SIDES:
                q[model.joints[model.getJointId(pattern.format(side=side))].idx_q] = np.radians(degrees)
        pin.forwardKinematics(model, data, q)
        self.place = {name: data.oMi[number].copy() for number, name in enumerate(model.names)}

    def skin(self) -> Skin:
        entries = [(entry, side) for entry in self.table["body"]["solids"] for side in _sides(entry)]
        solids = [self.solid(entry, side) for entry, side in entries]
        mesh = self.mesh(self.table["body"], solids)
        distance = np.stack([solid.distance(mesh.vertices) for solid in solids], axis=1)
        bones = tuple(dict.fromkeys(solid.bone for solid in solids))
        nearest = np.stack(
            [distance[:, [solid.bone == bone for solid in solids]].min(axis=1) for bone in bones], axis=1
        )
        hold = np.exp(-(nearest - nearest.min(axis=1, keepdims=True)) / (SOFT * self.scale))
        index = np.argsort(-hold, axis=1, kind="stable")[:, :INFLUENCES]
        weight = np.take_along_axis(hold, index, axis=1)
        return Skin(
            mesh,
            bones,
            np.stack([self.place[bone].inverse().homogeneous for bone in bones]),
            index,
            weight / weight.sum(axis=1, keepdims=True),
        )

    def part(self, name: str, side: str) -> tuple[str, Mesh]:
        """Return joint and mesh of a rigid part; the left one is the mirror image of the right one."""
        entry = self.table[name]
        joint = entry["joint"].format(side="right")
        solids = [self.solid(solid, which) for solid in entry["solids"] for which in _sides(solid) or ("right",)]
        floor = self.place[joint].translation[2] - self.ankle if entry.get("flat") else -np.inf
        mesh = self.mesh(entry, solids, floor)
        local, faces = (mesh.vertices - self.place[joint].translation) @ self.place[joint].rotation, mesh.faces
        if side == "left":
            local, faces = local * (1.0, 1.0, -1.0), faces[:, ::-1]
        return entry["joint"].format(side=side), Mesh(local, faces, mesh.colours, mesh.gloss)

    def mesh(self, entry: dict[str, Any], solids: list[Solid], floor: float = -np.inf) -> Mesh:
        skin = surface(solids, entry["voxel"] * self.scale, entry["blend"] * self.scale, floor)
        return painted(skin, solids, self.table["colours"], entry["gloss"])

    def solid(self, entry: dict[str, Any], side: str) -> Solid:
        start, end = (self.point(entry.get(key, entry["from"]), side) for key in ("from", "to"))
        joint = entry["from"][0].format(side=side)
        return Solid(
            entry.get("bone", entry["from"][0]).format(side=side),
            entry["colour"],
            start,
            end,
            tuple(radius * self.scale for radius in entry["radii"]),
            self.place[joint].rotation,
        )

    def point(self, entry: list[Any], side: str) -> Array:
        joint, toward, share, *offset = entry
        place = self.place[joint.format(side=side)]
        mirror = np.array([1.0, 1.0, -1.0 if side == "left" else 1.0])
        point = place.translation + place.rotation @ (np.array(offset) * mirror * self.scale)
        if toward:
            point = point + share * (self.place[toward.format(side=side)].translation - place.translation)
        return np.asarray(point)


def _sides(entry: dict[str, Any]) -> tuple[str, ...]:
    return SIDES if entry.get("sided") else ("right",)
