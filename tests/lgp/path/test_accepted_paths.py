"""A path that is moved to the nearest feasible one is looked at once more, between its slices too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lgp.path.paths as paths
from lgp.kinematics.world import World
from lgp.path.bounds import PathBounds
from lgp.path.problem import PathProblem
from lgp.planner import parse_sequence, task_of
from lgp.scene.scene_file import load_scene
from reba.arrays import Array

pytestmark = pytest.mark.slow
SEQUENCE = [
    "grasp(baxter.right, screwdriver)",
    "place(baxter.right, screwdriver, table.center)",
    "grasp(human.right_hand, screwdriver)",
]


def test_what_the_last_correction_breaks_is_corrected_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """A joint that rests at its limit passes it between two slices as soon as it rests no longer."""
    scene = load_scene("screwdriver")
    world = World(scene)
    bounds = PathBounds(world, collisions=False)
    skeleton = parse_sequence(task_of(scene), SEQUENCE)
    phases = bounds.phases(skeleton)
    solver = bounds.paths
    active = solver.active(phases, collision_free=False)
    problem = solver.problem_of(phases)(active)
    solution = bounds.solve("path", skeleton, bounds.solve("sequence", skeleton, None)).payload
    solve, looked_at = paths.nearest_feasible, []
    returned: list[Array] = []

    def nearest_feasible(problem: PathProblem, x: Array, tolerance: float) -> tuple[Array, float]:
        point, violation = solve(problem, x, tolerance)
        returned.append(point)
        return point, violation

    def add_violated(q: Array, z: Array) -> int:
        looked_at.append(q.copy())
        return int(len(looked_at) == 1)

    monkeypatch.setattr(paths, "nearest_feasible", nearest_feasible)
    monkeypatch.setattr(active, "add_violated", add_violated)
    x = solution.result.x.copy()
    x[: problem.n - problem.modes.size] += 1e-4
    begin = replace(solution.result, x=np.clip(x, problem.lower, problem.upper), inequality=5e-3)
    answer, reason = solver.accept(problem, begin)
    assert answer is not None, reason
    assert np.array_equal(looked_at[0], problem.split(returned[0])[0])
    assert len(looked_at) == 2, "once more after the path was solved with what it broke"
