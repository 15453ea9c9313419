"""Bounds of a search without geometry: random costs that grow with the level and the number of actions."""

from __future__ import annotations

import math
import random

from lgp.logic.task import Action
from lgp.search.records import BoundResult, Skeleton


class RandomBounds:
    """Costs drawn from a seed: each action costs something, later levels cost more, some are infeasible."""

    levels = ("pose", "sequence", "path")

    def __init__(self, seed: int, infeasible: float = 0.2, direct: bool = False, prefix_level: str = "") -> None:
        self.seed, self.infeasible, self.direct, self.prefix_level = seed, infeasible, direct, prefix_level
        self.calls: list[tuple[str, Skeleton]] = []

    def is_lower_bound(self, level: str) -> bool:
        return True

    def least_cost(self, actions: int) -> float:
        return 0.0

    def objects(self, action: Action) -> tuple[str, ...]:
        return (action.arguments[1],)

    def displaced(self, skeleton: Skeleton) -> int:
        return 0

    def _draw(self, *what: object) -> random.Random:
        return random.Random(repr((self.seed, *what)))

    def _bad(self, skeleton: Skeleton, level: int) -> int:
        """How many actions it takes until the sequence is infeasible, 0 if never; later levels find more."""
        for end in range(1, len(skeleton) + 1):
            words = [str(action) for action in skeleton[:end]]
            if not self.direct and len(words) == 1 and "human" in words[0]:
                return end
            if any(self._draw("bad", stage, words).random() < self.infeasible / 3 for stage in range(level + 1)):
                return end
        return 0

    def solve(self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = math.inf) -> BoundResult:
        self.calls.append((level, skeleton))
        stage = 1 if level == self.prefix_level else self.levels.index(level)
        end = self._bad(skeleton, stage)
        if end:
            return BoundResult(False, math.inf, f"{level}: {skeleton[end - 1]} cannot be reached")
        steps = [str(action) for action in skeleton]
        cost = sum(self._draw("cost", steps[: i + 1]).uniform(1, 3) for i in range(len(steps)))
        return BoundResult(True, cost * (0.5, 0.9, 1.0)[stage], payload=tuple(steps))
