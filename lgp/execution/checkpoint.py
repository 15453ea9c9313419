"""Checkpoint of a run: what a restart needs, as plain data in the log, and read back without trust in the log."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from lgp.errors import LgpError
from lgp.execution.events import LONGEST_RUN
from lgp.execution.simulation import Placement
from lgp.kinematics.world import World
from reba.arrays import Array
from reba.toml_table import TomlTable

YEAR_3000: Final = 3.3e10
"""[s since 1970] Latest time that is read."""
_FOLDER: Final = re.compile(r"\.|replans/[1-9][0-9]{0,5}")
_TURN: Final = 1e-3
"""Largest error of a rotation matrix: written numbers are exact to 1e-15."""


@dataclass(frozen=True)
class Checkpoint:
    """State of a run and of its world.

    Attributes:
        epoch: wall-clock time at which the run began [s].
        time: since then [s].
        q: (nq,) configuration of human and robots [rad, m].
        closed: hands whose grippers are closed.
        objects: true placements in a simulated world; none with a recorded one.
        number: of the current action.
        folder: of the plan in force, relative to that of the first plan: "." or "replans/N".
        replans: number of plans made so far.
    """

    epoch: float
    time: float
    q: Array
    closed: frozenset[str]
    objects: Mapping[str, Placement]
    number: int
    folder: str
    replans: int

    def record(self) -> dict[str, Any]:
        """Return plain data, as the log holds them."""
        placed = {
            name: {
                "hand": at.hand,
                "table": at.table,
                "rotation": at.rotation.tolist(),
                "position": at.position.tolist(),
            }
            for name, at in self.objects.items()
        }
        plain = {"q": self.q.tolist(), "closed": sorted(self.closed), "things": placed}
        return {"epoch": self.epoch, "time": self.time, **plain} | {
            "number": self.number,
            "folder": self.folder,
            "replans": self.replans,
        }

    @staticmethod
    def read(data: Any) -> Checkpoint:
        """Return the checkpoint of a record.

        Raises:
            LgpError: a member is missing or wrong.
        """
        table = TomlTable("the checkpoint", data, LgpError)
        folder = table.text("folder")
        if not _FOLDER.fullmatch(folder):
            raise LgpError(f"the checkpoint: folder is {folder!r}, expected '.' or 'replans/N'")
        return Checkpoint(
            epoch=table.number("epoch", low=0.0, high=YEAR_3000),
            time=table.number("time", low=0.0, high=LONGEST_RUN),
            q=np.array(table.series("q")),
            closed=frozenset(table.texts("closed")),
            objects={name: _placement(one) for name, one in table.tables("things").items()},
            number=table.whole("number"),
            folder=folder,
            replans=table.whole("replans"),
        )

    def check(self, world: World, actions: int) -> None:
        """Check that the checkpoint is one of a plan with this world and number of actions.

        Raises:
            LgpError: it is not.
        """
        hands, objects = world.scene.hands, world.scene.objects
        if len(self.q) != len(world.joints):
            raise LgpError(f"the checkpoint: q has {len(self.q)} numbers, expected {len(world.joints)}")
        if self.number >= actions:
            raise LgpError(f"the checkpoint: action {self.number + 1} of a plan with {actions}")
        unknown = [name for name in sorted(self.closed) if name not in hands]
        unknown += [at.hand for at in self.objects.values() if at.hand and at.hand not in hands]
        if unknown:
            raise LgpError(f"the checkpoint: {unknown[0]!r} is no hand of the scene")
        carried = ["", *world.scene.carried_tables]
        astray = [at.table for at in self.objects.values() if at.table not in carried]
        if astray:
            raise LgpError(f"the checkpoint: {astray[0]!r} is no table that a robot of the scene carries")
        if self.objects and self.objects.keys() != objects.keys():
            names = sorted(self.objects.keys() ^ objects.keys())
            raise LgpError(f"the checkpoint: its objects are not those of the scene ({names[0]!r})")


def _placement(table: TomlTable) -> Placement:
    rows = [TomlTable(table.where, {"rotation": row}, LgpError) for row in _rows(table)]
    rotation = np.array([row.vector("rotation", 3, low=-1.0 - _TURN, high=1.0 + _TURN) for row in rows])
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > _TURN or np.linalg.det(rotation) < 0.0:
        raise LgpError(f"{table.where}: rotation is no rotation matrix")
    position = np.array(table.vector("position", 3))
    return Placement(table.text("hand"), rotation, position, table.text("table", ""))


def _rows(table: TomlTable) -> list[Any]:
    rows = table.values.get("rotation")
    if not isinstance(rows, list) or len(rows) != 3:
        raise LgpError(f"{table.where}: rotation is no rotation matrix")
    return rows
