"""Speed limits of plans: kept where phases have fixed durations, or the plan says which joint needs how much longer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import lgp
from lgp.kinematics.world import World
from lgp.path.active_constraints import MotionConstraints
from lgp.path.bounds import PathBounds
from lgp.path.joint_constraints import JointConstraints
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.plan_record import Plan
from lgp.planner import follow, parse_sequence, task_of
from lgp.scene.model import Scene
from lgp.scene.scene_file import read_scene
from tests.support.gantry import TABLES, scene_values
from tests.support.lgp_worlds import differences
from tests.support.says import says

Array = NDArray[np.float64]
SEQUENCE = ["grasp(gantry.hand, box)", "place(gantry.hand, box, table.b)"]
SHORT = {"phase_seconds": 0.8, "slices": 4}
"""Too short for 2.4 m and more at this speed: 0.2 s are for the rest at the grasp."""


def scene(folder: Path, distance: float, **changes: Any) -> Scene:
    """Return a scene in which the gantry carries a box some way [m] in a second: 0.8 s of it after the rest."""
    far = TABLES | {"b": TABLES["b"] | {"position": [distance, 0.0]}}
    given = {"tables": far, "goal": ["placed(box, table.b)", "on_table(box)"], "phase_seconds": 1.0, "slices": 5}
    values = scene_values(folder, **given) | changes
    values["robots"]["gantry"]["joints"] = {"z": 1.25}
    return read_scene(values)


def planned(scene: Scene, **options: Any) -> Plan:
    return lgp.plan(scene, cost=None, sequence=SEQUENCE, **options)


@pytest.mark.parametrize("collisions", [False, True])
def test_a_plan_keeps_the_limits_that_the_least_accelerations_would_break(tmp_path: Path, collisions: bool) -> None:
    plan = planned(scene(tmp_path, 2.8), collisions=collisions)
    assert plan.feasible, plan.reason
    assert plan.audit["speed_joint"] == "gantry.x"
    assert 0.99 <= plan.audit["speed"] <= 1.001
    assert not [fault for fault in plan.audit["faults"] if fault["kind"] == "speed"]


@pytest.mark.parametrize("collisions", [False, True])
def test_where_no_motion_is_slow_enough_the_plan_says_which_joint_and_what_to_do(
    tmp_path: Path, collisions: bool
) -> None:
    plan = planned(scene(tmp_path, 2.6, **SHORT), collisions=collisions)
    assert not plan.feasible
    says(plan.reason, "phase 2, place", "gantry.x", "of 4 m/s", "phase_seconds", 'durations = "stretched" or "free"')
    # What it advises is enough.
    words = plan.reason.replace(",", " ").split()
    seconds = float(words[words.index("phase_seconds") + 2])
    assert SHORT["phase_seconds"] < seconds < 1.6
    longer = planned(scene(tmp_path, 2.6, phase_seconds=seconds, slices=8), collisions=collisions)
    assert longer.feasible, longer.reason


@pytest.mark.parametrize("collisions", [False, True])
def test_on_request_phases_are_stretched_until_the_limits_hold(tmp_path: Path, collisions: bool) -> None:
    plan = planned(scene(tmp_path, 2.6, **SHORT, durations="stretched"), collisions=collisions)
    assert plan.feasible, plan.reason
    first, second = plan.durations
    assert first == SHORT["phase_seconds"], "the one that needs no longer stays as it is"
    assert SHORT["phase_seconds"] < second < 1.4
    assert plan.audit["speed"] <= 1.001
    assert plan.time[-1] == pytest.approx(first + second)
    assert plan.status != "optimal"
    plan.save(tmp_path / "out")
    again = Plan.load(tmp_path / "out")
    assert lgp.Motion(again).phases.phase_durations == pytest.approx(plan.durations)


def test_a_plan_that_is_slow_enough_is_not_stretched(tmp_path: Path) -> None:
    fixed, stretched = (planned(scene(tmp_path, 1.0, durations=kind)) for kind in ("fixed", "stretched"))
    np.testing.assert_array_equal(fixed.path, stretched.path)
    assert stretched.durations == (1.0, 1.0)


def test_rows_have_the_derivatives_they_say(tmp_path: Path) -> None:
    given = scene(tmp_path, 2.6)
    world = World(given)
    phases = Phases.of(given, parse_sequence(task_of(given), SEQUENCE))
    rng = np.random.default_rng(0)
    # Rising in every joint: all are too fast, and pass their limits.
    path = world.initial_configuration + np.cumsum(rng.uniform(0.9, 1.5, (phases.total, world.nq)), axis=0)
    rows = MotionConstraints(JointConstraints(world, phases, world.initial_configuration), [], None)
    z = np.zeros(0)
    assert rows.add_violated(path, z) == len(rows) > 20
    problem = PathProblem(world, phases, active=rows)
    own = [number for number, row in enumerate(problem.constraints.in_rows) if row.kind in ("speed", "limit")]
    assert {problem.constraints.in_rows[number].kind for number in own} == {"speed", "limit"}
    z = np.zeros(problem.modes.size)

    def value(points: Array) -> Array:
        return np.array([problem.constraints.evaluate(*problem.split(point)).inequality[own] for point in points])

    jacobian = problem.constraints.jacobians(problem.constraints.evaluate(path, z), path, z)[1].toarray()[own]
    x = np.concatenate([path.ravel(), z])
    np.testing.assert_allclose(jacobian, differences(value, x[None])[0], atol=1e-6)


def test_multipliers_of_limits_are_not_those_of_other_rows(tmp_path: Path) -> None:
    """A free path at its speed limits is where the collision-free one starts; its active rows are not that one's."""
    given = scene(tmp_path, 2.8)
    bounds = PathBounds(World(given), collisions=True)
    skeleton = parse_sequence(task_of(given), SEQUENCE)
    follow(bounds, skeleton)
    free = bounds.solution("free_path", skeleton)
    assert free is not None
    assert len(free.result.y_in) == len(bounds.problem("path", bounds.phases(skeleton)).constraints.in_rows)
