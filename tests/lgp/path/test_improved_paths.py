"""The path of the best plan is solved again from slightly disturbed ones."""

from __future__ import annotations

import math

import pytest

import dreba
import lgp
from lgp.errors import LgpError
from lgp.kinematics.world import World
from lgp.path.bounds import PathBounds
from lgp.path.ergonomics import Ergonomics
from lgp.planner import follow, parse_sequence, plan_of, task_of
from lgp.scene.model import Scene
from lgp.search.records import SearchResult
from lgp.search.time_limit import time_limit
from tests.support.lgp_worlds import needs_robots

pytestmark = [pytest.mark.slow, needs_robots]

LINES = (
    "grasp(baxter.right, screwdriver)",
    "place(baxter.right, screwdriver, table.center)",
    "grasp(human.right_hand, screwdriver)",
)


def scene_at(left: float, center: float, right: float) -> Scene:
    return lgp.load_scene("screwdriver").with_heights({"left": left, "center": center, "right": right})


def followed(**options: bool) -> tuple[PathBounds, SearchResult]:
    scene = scene_at(1.1, 0.9, 1.0)
    bounds = PathBounds(World(scene), slices=8, **{"collisions": True, **options})
    return bounds, follow(bounds, parse_sequence(task_of(scene), LINES))


def test_an_improved_path_is_cheaper_or_the_known_one_and_is_stored() -> None:
    bounds, result = followed()
    with time_limit(0.0):
        assert bounds.improved(result.skeleton) is result.payload  # no time: it may be asked for again
    better = bounds.improved(result.skeleton)
    assert better is result.payload or better.costs.total < 0.98 * result.cost
    assert better is bounds.improved(result.skeleton) is bounds.solution("path", result.skeleton)
    phases = bounds.phases(result.skeleton)
    rest = bounds.problem("path", phases).constraints.residuals(better.path, better.variables)
    assert max(rest["equality"], rest["inequality"]) <= 1e-6
    depth, words = bounds.paths.collision_constraints(phases).deepest_penetration(better.path, better.variables)
    assert depth <= 1e-6, words


@pytest.mark.parametrize("options", [{"collisions": False}, {"multi_start": False}])
def test_what_has_other_starts_or_none_is_not_improved(options: dict[str, bool]) -> None:
    bounds, result = followed(**options)
    assert bounds.improved(result.skeleton) is result.payload


def test_a_sequence_without_a_path_has_nothing_to_improve() -> None:
    bounds, result = followed(multi_start=False)
    with pytest.raises(LgpError, match="no path is known"):
        bounds.improved(result.skeleton[:1])


def test_a_plan_states_the_cost_of_the_improved_motion() -> None:
    plan = lgp.plan(scene_at(1.1, 0.9, 1.0), None)
    known = [node.costs["path"] for node in plan.tree if node.goal and "path" in node.costs]
    assert math.isclose(plan.costs["total"], min(known), rel_tol=1e-9)
    assert plan.search["bound"] <= plan.costs["total"] * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("heights", "table"),
    [((1.2218835927963827, 0.968993123729791, 1.1113900218032626), "table.right"),
     ((1.3880395945039918, 1.2703605841024839, 1.1123823134831605), "table.center")],
)  # fmt: skip
def test_no_edge_passes_between_the_points_of_a_path(heights: tuple[float, float, float], table: str) -> None:
    scene = scene_at(*heights)
    world = World(scene)
    bounds = PathBounds(world, Ergonomics(world, dreba.load("convex")), collisions=True)
    lines = [line.replace("table.center", table) for line in LINES]
    result = follow(bounds, parse_sequence(task_of(scene), lines))
    bounds.improved(result.skeleton)
    plan = plan_of(bounds, follow(bounds, result.skeleton))
    assert plan.audit["faults"] == []
