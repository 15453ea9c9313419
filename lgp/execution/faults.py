"""Faults that a simulated run injects: kind, action, amount."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from lgp.errors import LgpError
from lgp.execution.simulation import SimulatedTracker, SimulatedWorld
from lgp.execution.tracked_scene import on_table
from lgp.execution.worker import Worker
from lgp.logic.task import Action
from reba.checks import shown
from reba.errors import did_you_mean

KINDS: Final[dict[str, tuple[float, str]]] = {
    "moved": (0.10, "the object is pushed aside on its table, by the amount [m]"),
    "away": (0.0, "the object is put onto the table farthest from its own"),
    "dropped": (0.0, "the object slips out of the hand"),
    "lost": (2.0, "the object is lost from tracking, for the amount [s]"),
    "stuck": (0.0, "every hand of the action: a gripper ignores its commands, a person does not move"),
    "killed": (0.0, "the process is killed (SIGKILL); continue with --resume"),
}
"""Kind -> default amount, effect."""
WHEN = 0.5
"""Share of the motion of an action after which its fault happens; `lost` and `stuck` begin with it."""
EDGE = 0.03
"""[m] Smallest distance from the edge of its table of an object that is pushed aside."""
LARGEST = 1000.0
"""Largest amount of a fault [m, s]."""
_TEXT = re.compile(r"(?P<kind>[a-z]+)@(?P<action>\d{1,6})(?::(?P<amount>[\d.]+))?")


@dataclass(frozen=True)
class Fault:
    """One fault.

    Attributes:
        kind: one of `KINDS`.
        action: number of the action, from 0.
        amount: metres or seconds, see `KINDS`.
    """

    kind: str
    action: int
    amount: float


def parse_fault(text: str) -> Fault:
    """Return the fault of a text KIND@ACTION[:AMOUNT]; actions count from 1, as plans print them.

    Raises:
        LgpError: the text has another form, or the kind is unknown.

    >>> parse_fault("moved@1:0.2")
    Fault(kind='moved', action=0, amount=0.2)
    """
    match = _TEXT.fullmatch(text.strip())
    if match is None or int(match["action"]) < 1:
        raise LgpError(f"fault {text!r}: expected KIND@ACTION or KIND@ACTION:AMOUNT, as in moved@1:0.1")
    if match["kind"] not in KINDS:
        hint = did_you_mean(match["kind"], KINDS) or f"; known are {', '.join(KINDS)}"
        raise LgpError(f"fault {text!r}: unknown kind{hint}")
    try:
        amount = float(match["amount"]) if match["amount"] else KINDS[match["kind"]][0]
    except ValueError as error:
        raise LgpError(f"fault {text!r}: {match['amount']!r} is not a number") from error
    if amount > LARGEST:
        raise LgpError(f"fault {shown(text)}: its amount is {amount:g}, expected up to {LARGEST:g}")
    return Fault(match["kind"], int(match["action"]) - 1, amount)


class Faults:
    """Injects faults into a simulated world, each once, in the first plan only."""

    def __init__(
        self,
        faults: tuple[Fault, ...],
        simulation: SimulatedWorld,
        tracker: SimulatedTracker,
        workers: Sequence[Worker],
        rng: np.random.Generator,
    ) -> None:
        self.waiting = list(faults)
        self.simulation, self.tracker, self.workers, self.rng = simulation, tracker, workers, rng
        self._due: list[tuple[float, Fault, Action]] = []

    def on_start(self, number: int, action: Action, seconds: float) -> None:
        """Schedule the faults of an action that starts now, whose motion takes some seconds."""
        for fault in [one for one in self.waiting if one.action == number]:
            self.waiting.remove(fault)
            delay = 0.0 if fault.kind in ("lost", "stuck") else WHEN * seconds
            self._due.append((self.simulation.time + delay, fault, action))

    def step(self, time: float) -> list[str]:
        """Inject the faults that are due at a time [s]; return a sentence about each."""
        due = [entry for entry in self._due if entry[0] <= time]
        self._due = [entry for entry in self._due if entry[0] > time]
        return [self._inject(fault, action) for _, fault, action in due]

    def _inject(self, fault: Fault, action: Action) -> str:
        scene = self.simulation.world.scene
        object_names = [name for name in action.arguments if name in scene.objects]
        hands = [name for name in action.arguments if name in scene.hands]
        if fault.kind == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        if fault.kind == "stuck":
            return self._jam(hands)
        if not object_names:
            return f"{fault.kind}: {action} has no object, no effect"
        name = object_names[0]
        if fault.kind == "lost":
            self.tracker.lost[name] = self.simulation.time + fault.amount
            return f"{name} is lost from tracking for {fault.amount:g} s"
        if fault.kind == "dropped":
            if not self.simulation.objects[name].hand:
                return f"dropped: {name} is in no hand, no effect"
            self.simulation.put(name)
            return f"{name} slips out of the hand"
        return self._displace(fault, name)

    def _displace(self, fault: Fault, name: str) -> str:
        """Push an object aside on its table, or put it onto the farthest one."""
        table = self.simulation.view.table_under(name)
        if not table or self.simulation.objects[name].hand:
            return f"{fault.kind}: {name} lies on no table, no effect"
        if fault.kind == "away":
            tables = {other: self.simulation.view.table(other) for other in self.simulation.world.scene.tables}
            own = np.array(tables[table].position)
            far = max(tables, key=lambda other: float(np.linalg.norm(np.array(tables[other].position) - own)))
            self.simulation.lay(name, far, 0.0, 0.0)
            return f"{name} is put onto {far}"
        x, y = self._free_position(name, table, fault.amount)
        self.simulation.lay(name, table, x, y)
        return f"{name} is pushed aside by {fault.amount:g} m"

    def _free_position(self, name: str, table: str, amount: float) -> tuple[float, float]:
        """Return x, y [m] on a table about `amount` from an object, in a random direction with room for it."""
        top = self.simulation.view.table(table)
        x, y, _, _ = on_table(top, self.simulation.pose(name))
        room = np.maximum(np.array(top.size) / 2.0 - EDGE, 0.0)
        first = self.rng.uniform(0.0, 2.0 * np.pi)
        angles = first + np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
        positions = np.clip(np.array([x, y]) + amount * np.stack([np.cos(angles), np.sin(angles)], axis=1), -room, room)
        reached = np.linalg.norm(positions - [x, y], axis=1)
        best = positions[int(np.argmax(reached > 0.95 * reached.max()))]
        return float(best[0]), float(best[1])

    def _jam(self, hands: list[str]) -> str:
        """Stop every hand of an action: a gripper keeps its state, and a person stays where they are."""
        scene = self.simulation.world.scene
        grippers = [name for name in hands if not scene.hands[name].human]
        self.simulation.robots.stuck.update(grippers)
        effects = [f"the gripper of {name} ignores its commands" for name in grippers]
        for worker in self.workers:
            if worker.name in {scene.hands[name].agent for name in hands}:
                worker.stuck = True
                effects.append(f"{worker.name} does not move")
        return " and ".join(effects)
