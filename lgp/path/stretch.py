"""A quick no: switches that are farther away than the hand gets with every joint at its best (`lgp.world.span`).

A necessary condition only, and a true one: what it refuses no configuration meets. The rest is left to the solver.
"""

from __future__ import annotations

import numpy as np

from lgp.path.phases import Phases
from lgp.world.holders import placed, resting
from lgp.world.model import World
from lgp.world.scene import Table, Thing
from lgp.world.span import Span, Top, span

LEAST = 1e-3
"""[m] Misses below this are left to the solver."""


class Stretch:
    """The spans of the hands of a world, each worked out when first asked for.

    Args:
        world: the kinematics.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self._spans: dict[str, Span] = {}

    def refusal(self, phases: Phases) -> str:
        """Return why the hand of the last switch cannot get there, "" if it may.

        Only hands that grasp from a table or place on one are judged.
        """
        number = phases.count - 1
        switch = phases.switches[number]
        scene = self.world.scene
        if switch.kind not in ("grasp", "place"):
            return ""
        thing = scene.things[switch.thing]
        table, moved = switch.table or thing.on, bool(switch.table)
        for earlier in phases.switches[:number] if switch.kind == "grasp" else ():
            if earlier.thing == switch.thing:
                table, moved = earlier.table, True
        if table not in scene.tables:
            return ""
        top = _where(scene.tables[table], thing, moved)
        grip = thing.grip(scene.hands[switch.hand].kind)
        miss = self._span(switch.hand).beyond(top) - grip.slide - float(np.linalg.norm(grip.at))
        if miss < LEAST:
            return ""
        what = f"{switch.thing} on {table}" if switch.kind == "grasp" else f"where {switch.thing} lies on {table}"
        return (
            f"phase {number + 1}, {phases.label(number)}: {switch.hand} stays at least {miss:.3f} m away from {what}, "
            "however its joints are stretched"
        )

    def _span(self, hand: str) -> Span:
        if hand not in self._spans:
            self._spans[hand] = span(self.world, self.world.scene.hands[hand])
        return self._spans[hand]


def _where(table: Table, thing: Thing, moved: bool) -> Top:
    """Return where the middle of an object on a table can be: at its first place, or anywhere once it was moved."""
    yaw = np.radians(table.yaw)
    sides = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0]])
    x, y, halves = (0.0, 0.0, placed(table, thing, 0).upper[:2]) if moved else (*thing.at[:2], np.zeros(2))
    return Top(resting(table, thing, x, y, 0.0, "z" if moved else thing.up)[1], halves, sides)
