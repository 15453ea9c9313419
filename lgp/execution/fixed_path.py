"""A path problem in which some things are settled: how objects lie in hands and on tables, what some arms do.

What comes later was planned for an object in the same grip, or at a given spot, so it stays as good as it was. Hands
that hold a part when the sequence begins stand still until their next action, as hands that hold within it do.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lgp.path.apart import apart, settled
from lgp.path.bounds import PathBounds, Solution
from lgp.path.collision_rows import CollisionRows
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.search import Skeleton
from lgp.sqp import Options, Solver

Array = NDArray[np.float64]
Columns = NDArray[np.intp]

SLACK = 1e-5
"""[m, rad] Room around a pinned value, so that bounds do not become equations."""
FIRST = 0.05
"""[rad, m] Longest step from a planned motion before it is looked at which bodies it brings near each other."""
ROUGH = 2e-4
"""Promised decrease of the cost, relative to it, that a run does not wait for."""
BUDGET = 20
"""Iterations after which a path that started from the planned one is good enough, if it holds its constraints."""


@dataclass(frozen=True)
class Course:
    """How some joints move during the first action: columns of q (k,), their values (slices, k) after its start."""

    columns: Columns
    values: Array


class PinnedBounds(PathBounds):
    """The levels of a scene in which some variables and joints have given values.

    Args:
        pins: name of a variable, such as `0.box.yaw` -> value [m, rad].
        still: hands that stay where they start until their next action.
        course: of joints that move in a given way during the first action.
        resting: columns of q that stay where they start in the first slice.
        shapes: sequence -> motion that was planned for it in another world (1 + T, nq) and its variables (nz,); where
            bodies are in each other's way, the solver starts from that one.
        more: as `PathBounds` takes it.
    """

    def __init__(
        self,
        *args: Any,
        pins: Mapping[str, float] | None = None,
        still: Iterable[str] = (),
        course: Course | None = None,
        resting: Columns | None = None,
        shapes: Mapping[Skeleton, tuple[Array, Array]] | None = None,
        **more: Any,
    ) -> None:
        super().__init__(*args, **more)
        self.detours = False
        self.pins = {} if pins is None else pins
        self.still = {hand: np.flatnonzero(self.world.support(hand)) for hand in still}
        self.course = course
        self.resting = np.zeros(0, np.intp) if resting is None else resting
        self.shapes = {} if shapes is None else dict(shapes)

    def problem(self, level: str, phases: Phases, *args: Any, **more: Any) -> PathProblem:
        """Return the problem of a level with narrow bounds around the given values; poses leave joints free."""
        problem = super().problem(level, phases, *args, **more)
        first = problem.n - problem.modes.size
        for at, name in enumerate(problem.modes.names, start=first):
            if name in self.pins:
                inside = np.clip(self.pins[name], problem.lower[at], problem.upper[at])
                _pin(problem, np.array([at]), inside)
        if level == "pose":
            return problem
        nq = self.world.nq
        for row, at in enumerate(problem.kept.tolist()):
            for hand, columns in self.still.items():
                if at <= _until(phases, hand):
                    _pin(problem, row * nq + columns, self.start[columns])
            if self.course is not None and at < phases.slices:
                _pin(problem, row * nq + self.course.columns, self.course.values[at])
            if at == 0:
                _pin(problem, row * nq + self.resting, self.start[self.resting])
        return problem

    @property
    def _options(self) -> Options:
        options = super()._options
        return replace(options, decrease=max(options.decrease, ROUGH), kkt=max(options.kkt, ROUGH))

    def _path(self, phases: Phases, earlier: Solution | None) -> tuple[Solution | None, str]:
        shape = self.shapes.get(phases.actions)
        if shape is None or earlier is None or earlier.path is None:
            return super()._path(phases, earlier)
        near = CollisionRows(self.world, phases, self.start).extend(earlier.path, earlier.variables)
        found = self._reshaped(phases, *shape) if near else None
        return super()._path(phases, earlier) if found is None else (found, "")

    def _reshaped(self, phases: Phases, shape: Array, variables: Array) -> Solution | None:
        """Return the path that a planned one (1 + T, nq) becomes in this world, None if it becomes none."""
        rows = CollisionRows(self.world, phases, self.start)
        fade = np.maximum(1.0 - np.arange(1, len(shape)) / phases.slices, 0.0)
        guess = shape[1:] + fade[:, None] * (self.start - shape[0])
        rows.extend(guess, variables)
        make = partial(self.problem, "path", phases)
        problem = make(apart=rows)
        options = replace(settled(self._options), longest_step=FIRST, iterations=1)
        result = Solver(options).solve(problem, problem.join(guess, variables))
        limited = replace(self._options, iterations=min(BUDGET, self._options.iterations))
        return self._judged(*apart(lambda given: make(apart=given), rows, result, limited))[0]


def _pin(problem: PathProblem, unknowns: Columns, values: Array) -> None:
    """Leave some unknowns hardly any room around values."""
    problem.lower[unknowns], problem.upper[unknowns] = values - SLACK, values + SLACK


def _until(phases: Phases, hand: str) -> int:
    """Return the slice of a hand's first action, the last slice if it has none."""
    acts = [number for number, switch in enumerate(phases.switches) if hand in switch.hands]
    return int(phases.keys[acts[0] if acts else -1])
