"""A collision-free motion by sampling: the initial guess where no path near those that ignore bodies is one.

Phase by phase the acting limbs get random postures that satisfy the switch and are collision-free there, and random
trees lead to the nearest of them that can be reached (`random_trees`). Near the ends of a phase the contacts of its
actions may be as deep as at the end itself. All other joints stand still, so the motion is no optimum: the path is
solved from it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from lgp.path.collision_constraints import CollisionConstraints
from lgp.path.feasibility import CLOSE, project_to_feasible
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.path.random_trees import along, connect
from lgp.search.time_limit import time_is_up
from reba.arrays import Array, Flags, Indices

MOTIONS: Final = 2
"""Motions that are tried, from different seeds (a choice, as are the others here)."""
POSTURES: Final = 300
"""Random postures at a switch that are projected to its constraints."""
GOALS: Final = 5
"""Collision-free postures at a switch at which to stop."""
RADII: Final = (0.1, 1.0)
"""Share of the way from the posture before to a random one, first and last: near ones are preferred."""
NEAR_ENDS: Final = 0.4
"""[rad, m] Largest change of a joint from an end of a phase up to which its contacts are free."""

Motion = tuple[Array, Array]
"""Path (T, nq) [rad, m] and variables (nz,)."""


def sampled_motions(
    phases: Phases, initial_configuration: Array, sequence_of: Callable[[Phases], PathProblem],
    constraints: CollisionConstraints,
) -> Iterator[Motion]:  # fmt: skip
    """Yield collision-free motions of a sequence, none where no seed leads to one or time is up.

    Args:
        sequence_of: phases -> sequence problem.
        constraints: of the complete sequence; none need be active.
    """
    problems = [sequence_of(_first(phases, count)) for count in range(1, phases.count + 1)]
    for seed in range(MOTIONS):
        if time_is_up():
            return
        motion = _Sampler(problems, initial_configuration, constraints, np.random.default_rng(seed)).motion()
        if motion is not None:
            yield motion


def _first(phases: Phases, count: int) -> Phases:
    """Return the first phases of a sequence."""
    actions = int(np.count_nonzero(phases.phase_of < count))
    return replace(phases, actions=phases.actions[:actions], switches=phases.switches[:actions],
                   durations=phases.durations[:count])  # fmt: skip


class _Sampler:
    def __init__(
        self, problems: list[PathProblem], start: Array, constraints: CollisionConstraints, rng: np.random.Generator
    ) -> None:
        self.problems, self.constraints, self.rng = problems, constraints, rng
        self.keyframes, self.variables = start[None], np.zeros(0)

    def motion(self) -> Motion | None:
        parts: list[Array] = []
        for problem in self.problems:
            part = self._phase(problem)
            if part is None:
                return None
            parts.append(part)
        return np.concatenate(parts), self.variables

    def _phase(self, problem: PathProblem) -> Array | None:
        """Return the slices (S, nq) of the next phase, and remember how it ends."""
        phase, before = problem.phases.count - 1, self.keyframes[-1]
        switches = np.flatnonzero(problem.phases.phase_of == phase)
        limb = np.unique(np.concatenate([problem.constraints.limb(number) for number in switches.tolist()]))
        ends = list(self._ends(problem, limb))
        if not ends:
            return None
        ends.sort(key=lambda end: float(np.abs(end[0] - before).max()))
        world = problem.world
        # What a hand holds is in another place in it at each end, so each is tried alone.
        for keyframe, variables in ends:
            is_free = self._free_within(phase, limb, before, keyframe, variables)
            line = connect(before[limb], keyframe[limb][None], world.lower[limb], world.upper[limb], is_free, self.rng)
            if line is not None:
                self.keyframes = np.concatenate([self.keyframes, keyframe[None]])
                self.variables = variables
                part = np.tile(before, (problem.phases.slices, 1))
                part[:, limb] = along(line, problem.phases.slices)
                return part
        return None

    def _ends(self, problem: PathProblem, limb: Indices) -> Iterator[tuple[Array, Array]]:
        """Yield collision-free configurations (nq,) at the end of a phase, with the variables so far (nz,)."""
        world, before, count = problem.world, self.keyframes[-1], 0
        last = len(problem.knots) - 1
        free = np.zeros(problem.n, dtype=bool)
        free[last * world.nq + limb] = True
        free[len(problem.knots) * world.nq + len(self.variables) :] = True
        phase_of = problem.phases.phase_of
        for number in range(POSTURES):
            radius = RADII[0] + (RADII[1] - RADII[0]) * number / POSTURES
            keyframe = before.copy()
            random = self.rng.uniform(world.lower[limb], world.upper[limb])
            keyframe[limb] += radius * (random - keyframe[limb])
            q = np.concatenate([self.keyframes[1:], keyframe[None]])
            z = problem.modes.guess(q[phase_of])
            z[: len(self.variables)] = self.variables
            x, violation = project_to_feasible(problem, problem.join(q, z), free=free)
            keyframes, variables = problem.split(x)
            if violation <= CLOSE and self._is_free(keyframes[last], problem.phases.count - 1, variables):
                yield keyframes[last].copy(), variables.copy()
                count += 1
                if count == GOALS:
                    return

    def _is_free(self, keyframe: Array, phase: int, variables: Array) -> bool:
        limits = self.constraints.limits_of_phase(phase)[-1]
        return bool(self.constraints.keeps(keyframe[None], phase, self._all(variables), limits[None])[0])

    def _free_within(
        self, phase: int, limb: Indices, first: Array, last: Array, variables: Array
    ) -> Callable[[Array], Flags]:
        """Return the test of joints (n, k) of the limbs within a phase that begins and ends in configurations."""
        limits, z = self.constraints.limits_of_phase(phase), self._all(variables)
        inside = limits[len(limits) // 2]
        ends = [(end[limb], self._allowed_at(end, phase, z, inside, limits.min(axis=0))) for end in (first, last)]

        def is_free(joints: Array) -> Flags:
            q = np.tile(first, (len(joints), 1))
            q[:, limb] = joints
            required = np.tile(inside, (len(joints), 1))
            for end, allowed in ends:
                near = np.abs(joints - end).max(axis=1) <= NEAR_ENDS
                required[near] = np.minimum(required[near], allowed)
            return self.constraints.keeps(q, phase, z, required)

        return is_free

    def _allowed_at(self, end: Array, phase: int, z: Array, inside: Array, least: Array) -> Array:
        """Return the distances (pairs,) [m] to keep near an end (nq,) of a phase: what touches goes no deeper."""
        touching = np.isneginf(least) & np.isfinite(inside)
        allowed = np.where(touching, 0.0, least)
        pairs, depths = self.constraints.distances_at(end, phase, z)
        allowed[pairs] = np.where(touching[pairs], np.minimum(depths, 0.0), allowed[pairs])
        return allowed

    def _all(self, variables: Array) -> Array:
        """Return variables of the complete sequence; later ones count for nothing yet."""
        modes = self.constraints.collisions.modes
        return np.concatenate([variables, np.clip(0.0, modes.lower, modes.upper)[len(variables) :]])
