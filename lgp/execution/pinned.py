"""A path problem of one action whose object ends up as the plan has it: in the same grip, or at a given spot.

What comes later was planned for that, so it stays as good as it was.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lgp.path.bounds import PathBounds
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem

Columns = NDArray[np.intp]

SLACK = 1e-5
"""[m, rad] Room around a pinned value, so that bounds do not become equations."""


class PinnedBounds(PathBounds):
    """The levels of a scene in which variables of the first action have given values.

    Args:
        pins: name of a variable without its number, such as `box.yaw` -> value [m, rad].
        resting: columns of q that stay where they start in the first slice.
        more: as `PathBounds` takes it.
    """

    def __init__(self, *args: Any, pins: Mapping[str, float], resting: Columns | None = None, **more: Any) -> None:
        super().__init__(*args, **more)
        self.pins = pins
        self.resting = np.zeros(0, np.intp) if resting is None else resting

    def problem(self, level: str, phases: Phases, *args: Any, **more: Any) -> PathProblem:
        """Return the problem of a level with narrow bounds around the pinned values."""
        problem = super().problem(level, phases, *args, **more)
        first = problem.n - problem.modes.size
        for at, name in enumerate(problem.modes.names, start=first):
            value = self.pins.get(name.removeprefix("0."))
            if value is not None and name.startswith("0."):
                inside = float(np.clip(value, problem.lower[at], problem.upper[at]))
                problem.lower[at], problem.upper[at] = inside - SLACK, inside + SLACK
        if level == "path":
            problem.lower[self.resting] = self.start[self.resting] - SLACK
            problem.upper[self.resting] = self.start[self.resting] + SLACK
        return problem
