"""The constraints that actions bring themselves, asked again in the samples of an audit, with its own poses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from lgp.audit.agents import AgentModel
from lgp.audit.faults import LEVEL, TOUCHING
from lgp.audit.joint_tree import Frame, about, attached
from lgp.audit.samples import PER_SLICE, Poses, Samples
from lgp.errors import LgpError
from lgp.kinematics.actions import ActionKind
from lgp.kinematics.features import FullPose
from lgp.scene.model import Scene
from reba.arrays import Array, Indices

TOLERANCE: Final = {"m": TOUCHING, "rad": float(np.radians(LEVEL)), "": float(np.sin(np.radians(LEVEL)))}
"""By which a constraint may be missed, by its unit."""
BETWEEN: Final = 5.0
"""Factor of that for an equation along a phase: between two slices that meet it a motion departs from it."""


@dataclass(frozen=True)
class SampledMoment:
    """An action in some samples (n,), without derivatives: an `ActionMoment`."""

    samples: Samples
    poses: Mapping[str, Poses]
    arguments: Mapping[str, str]
    rows: Indices

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.samples.plan.scene

    def __getitem__(self, role: str) -> FullPose:
        """Return the placements of the argument in a role."""
        return self.place(self.arguments[role])

    def place(self, name: str) -> FullPose:
        """Return the placements of a hand, an object, a table or a frame."""
        rotation, position = self._poses(name)
        return FullPose(rotation[self.rows], position[self.rows], np.zeros((len(self.rows), 6, 1)))

    def _poses(self, name: str) -> Poses:
        if name in self.poses:
            return self.poses[name]
        if name in self.samples.hands:
            return self.samples.hands[name]
        if name in self.samples.tops:
            return self.samples.tops[name][:2]
        count = self.samples.count
        if name in self.scene.tables:
            table = self.scene.tables[name]
            top = about(np.array([0.0, 0.0, 1.0]), np.radians([table.yaw]))
            return np.repeat(top, count, axis=0), np.tile([*table.position, table.height], (count, 1))
        for model, placed in zip(self.samples.models, self.samples.frames, strict=True):
            frame = frames_of(model).get(name)
            if frame is not None:
                rotation, position = attached(*placed, [frame])
                return rotation[0], position[0]
        raise LgpError(f"the audit has no frame {name!r}")


def frames_of(model: AgentModel) -> Mapping[str, Frame]:
    """Return the frames of an agent, by full name: links and joints."""
    named = model.file.frames if model.file is not None else model.frames
    return {f"{model.agent.name}.{name}": frame for name, frame in named.items()}


def own_errors(
    samples: Samples, poses: Mapping[str, Poses], kind: ActionKind, arguments: Mapping[str, str], at: int
) -> Iterator[tuple[str, float, int]]:
    """Yield in words what is not met, by how much [m, rad, 1] and at which sample, for an action at sample `at`.

    Raises:
        LgpError: a constraint asks for a frame that the audit does not have.
    """
    for one in kind.constraints:
        before = max((int(switch) for switch in samples.switches if switch < at), default=0)
        rows = np.arange(before + PER_SLICE, at + 1) if one.along else np.array([at], np.intp)
        value = one.feature(SampledMoment(samples, poses, arguments, rows)).value
        missed: Array = (np.abs(value) if one.equal else value).max(axis=1)
        worst = int(missed.argmax())
        if missed[worst] > TOLERANCE[one.unit] * (BETWEEN if one.along and one.equal else 1.0):
            amount = float(missed[worst])
            yield f"not met by {_in_words(amount, one.unit)}: {one.says}", amount, int(rows[worst])


def _in_words(amount: float, unit: str) -> str:
    """Return an amount that is missed: 1.2 mm, 3.0 deg, 0.05."""
    return {"m": f"{1000 * amount:.1f} mm", "rad": f"{np.degrees(amount):.1f} deg"}.get(unit, f"{amount:.3f}")
