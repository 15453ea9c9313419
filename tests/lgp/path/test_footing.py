"""Objects are put down with half of their footprint on the table, and plans say where that cannot be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import lgp
from lgp.errors import SceneError
from lgp.kinematics.world import World
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.plan_record import Plan
from lgp.planner import parse_sequence, task_of
from lgp.scene.model import Scene
from lgp.scene.scene_file import read_scene
from tests.support.gantry import TABLES, scene_values
from tests.support.lgp_worlds import differences
from tests.support.says import says

Array = NDArray[np.float64]
SEQUENCE = ["grasp(gantry.hand, box)", "place(gantry.hand, box, table.b)"]
ROD = {"size": [0.4, 0.05, 0.05], "mass": 1.0, "on": "table.a"}


def scene(folder: Path, turned: float, **table: Any) -> Scene:
    """Return a scene in which the gantry, which does not turn, puts a rod down turned as it is [deg]."""
    values = scene_values(
        folder,
        tables={"a": TABLES["a"], "b": {**TABLES["b"], **table}},
        objects={"box": {**ROD, "at": [0.0, 0.0, turned]}},
        goal=["placed(box, table.b)", "on_table(box)"],
    )
    values["robots"]["gantry"]["joints"] = {"z": 1.25}
    return read_scene(values)


def planned(scene: Scene, **options: Any) -> Plan:
    return lgp.plan(scene, cost=None, sequence=SEQUENCE, collisions=False, **options)


@pytest.mark.parametrize(
    ("yaw", "table"),
    [
        (-45.0, {"position": [1.0, 1.0]}),
        (135.0, {"position": [-1.0, -1.0]}),
        (20.0, {"position": [1.0, 0.2], "yaw": 65.0}),
        (-45.0, {"position": [1.0, 1.0], "size": [0.25, 0.25]}),
    ],
)
def test_half_of_a_rod_is_on_the_table_whose_corner_is_nearest(
    tmp_path: Path, yaw: float, table: dict[str, Any]
) -> None:
    plan = planned(scene(tmp_path, yaw, **table))
    assert plan.feasible, plan.reason
    assert not [fault for fault in plan.audit["faults"] if fault["kind"] == "resting"], plan.audit["faults"]


def test_a_table_that_is_too_narrow_is_named(tmp_path: Path) -> None:
    plan = planned(scene(tmp_path, 0.0, size=[0.15, 0.4]))
    assert not plan.feasible
    says(plan.reason, "place(2, gantry.hand, box, table.b)", "37 % of the footprint of box is on table.b")
    along = planned(scene(tmp_path, 90.0, size=[0.15, 0.4]))
    assert along.feasible, along.reason


def test_an_object_that_would_fall_at_first_is_named(tmp_path: Path) -> None:
    with pytest.raises(SceneError) as caught:
        lgp.plan(_at_a_corner(tmp_path), cost=None)
    says(caught.value, "objects.box", "% of its footprint on table.a", "move it", "size")


def _at_a_corner(folder: Path) -> Scene:
    return read_scene(scene_values(folder, objects={"box": {**ROD, "at": [0.18, 0.18, -45.0]}}))


def test_rows_have_the_derivatives_they_say(tmp_path: Path) -> None:
    given = scene(tmp_path, 0.0)
    world = World(given)
    problem = PathProblem(world, Phases.of(given, parse_sequence(task_of(given), SEQUENCE)))
    own = [number for number, row in enumerate(problem.constraints.in_rows) if row.kind == "footing"]
    assert len(own) == 1
    path = np.tile(world.initial_configuration, (problem.phases.total, 1))

    def value(points: Array) -> Array:
        return np.array([problem.constraints.evaluate(path, z).inequality[own] for z in points])

    z = np.random.default_rng(0).uniform(0.05, 0.15, problem.modes.size)
    jacobian = problem.constraints.jacobians(problem.constraints.evaluate(path, z), path, z)[1].toarray()[own]
    np.testing.assert_allclose(jacobian[:, -len(z) :], differences(value, z[None])[0], atol=1e-6)
