"""What the executive commands: motions and grippers; and robots that do exactly that."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lgp.execution.limits import robot_columns
from lgp.execution.segment import Move
from lgp.world.model import World

Array = NDArray[np.float64]


class Robots(Protocol):
    """All robots of a scene; the human is not among them."""

    def follow(self, move: Move) -> None:
        """Move from now on; of the configurations of everybody, robots take their own joints."""
        ...

    def grip(self, hand: str, closed: bool) -> None:
        """Close or open a gripper."""
        ...


class SimulatedRobots:
    """Robots that follow exactly.

    Args:
        world: whose robots.
        q: (nq,) first configuration of everybody.
        closed: hands whose grippers are closed at first.

    Attributes:
        columns: of q that belong to robots.
        q: (nq,) present configuration; only `columns` mean anything.
        speed: (nq,) present velocity.
        closed: hands whose grippers are closed.
        stuck: hands whose grippers do not obey, for trying faults.
    """

    def __init__(self, world: World, q: Array, closed: frozenset[str] = frozenset()) -> None:
        self.columns = robot_columns(world)
        self.q, self.speed = np.array(q, dtype=float), np.zeros(len(q))
        self.closed = set(closed)
        self.stuck: set[str] = set()
        self._time = self._began = 0.0
        self._move: Move | None = None

    def follow(self, move: Move) -> None:
        """Move from now on."""
        self._move, self._began = move, self._time

    def grip(self, hand: str, closed: bool) -> None:
        """Close or open a gripper, unless it is stuck."""
        if hand not in self.stuck:
            (self.closed.add if closed else self.closed.discard)(hand)

    def step(self, time: float) -> None:
        """Go on to a time [s]."""
        self._time = time
        if self._move is not None:
            since = time - self._began
            self.q[self.columns] = self._move.at(since)[self.columns]
            self.speed[self.columns] = self._move.velocity(since)[self.columns]
