"""Several persons with common places: derivatives, one place for all, mean and largest cost; bounds of a family."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import lgp
from lgp.experiments.common_places import CommonPlaces, common_variables
from lgp.experiments.family_bounds import FamilyBounds, MemberBounds
from lgp.experiments.manikins import family
from lgp.kinematics.world import World
from lgp.path.ergonomics import Ergonomics
from lgp.planner import parse_sequence, task_of
from lgp.search.records import Budget
from lgp.search.tree_search import search
from tests.support.lgp_worlds import needs_robots

pytestmark = [pytest.mark.slow, needs_robots]
SEQUENCE = (
    "grasp(baxter.left, screwdriver)", "place(baxter.left, screwdriver, table.left)",
    "grasp(human.right_hand, screwdriver)",
)  # fmt: skip
SLICES = 3
CHANGES = {"cost.model": "busch2018", "cost.weight": 4.0, "phase_seconds": 2.5, "cost.time_weight": 0.0}


@cache
def members() -> dict[str, MemberBounds]:
    """Return the levels of the smallest and the tallest member."""
    base = lgp.load_scene("screwdriver", CHANGES).with_heights({"left": 1.45, "center": 1.5, "right": 1.5})
    chosen = {}
    for one in (family().members[0], family().members[-1]):
        world = World(one.scene(base))
        chosen[one.name] = MemberBounds(world, Ergonomics(world, lgp_model()), slices=SLICES, multi_start=False)
    return chosen


def lgp_model() -> object:
    import dreba

    return dreba.load("busch2018")


@cache
def joint(worst: bool) -> CommonPlaces:
    bounds = members()
    first = next(iter(bounds.values()))
    skeleton = parse_sequence(task_of(first.world.scene), SEQUENCE)
    return CommonPlaces([one.problem("path", one.phases(skeleton)) for one in bounds.values()], worst=worst)


def test_only_places_on_tables_are_in_common() -> None:
    problem = joint(False).problems[0]
    names = problem.modes.names
    common = [name for name, both in zip(names, common_variables(problem.phases, names), strict=True) if both]
    assert common == ["1.screwdriver.x", "1.screwdriver.y", "1.screwdriver.yaw"]
    assert joint(False).n == sum(one.n for one in joint(False).problems) - 3


@pytest.mark.parametrize("worst", [False, True])
def test_the_model_is_that_of_the_values(worst: bool) -> None:
    problem = joint(worst)
    rng = np.random.default_rng(1)
    # Off the middle of the tables, where every constraint has a slope.
    start = np.concatenate([problem.problems[0].initial_configuration] * (3 * SLICES))
    points = [np.concatenate([start, np.zeros(one.modes.size)]) for one in problem.problems]
    x = np.clip(problem.join(points) + 0.05 * rng.standard_normal(problem.n), problem.lower, problem.upper)
    direction = rng.standard_normal(problem.n)
    _, equal, limits = problem.evaluate(x)
    model = problem.linearise(x, np.zeros(len(equal)), np.zeros(len(limits)))
    low, high = (problem.evaluate(x + step * direction) for step in (-1e-6, 1e-6))
    assert model.gradient @ direction == pytest.approx((high[0] - low[0]) / 2e-6, rel=1e-4, abs=1e-4)
    np.testing.assert_allclose(model.eq_jac @ direction, (high[1] - low[1]) / 2e-6, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(model.in_jac @ direction, (high[2] - low[2]) / 2e-6, rtol=1e-3, atol=1e-3)
    assert model.in_jac.has_sorted_indices
    assert (model.hessian.diagonal() >= 0.0).all()


def test_one_sequence_and_one_place_serve_all_and_bounds_are_below() -> None:
    bounds = members()
    task = task_of(next(iter(bounds.values())).world.scene)
    found = {worst: search(task, FamilyBounds(bounds, worst=worst), Budget(depth=4)) for worst in (False, True)}
    for result in found.values():
        assert result.status.name == "OPTIMAL"
        variables = np.array([one.variables[:20] for one in result.payload])
        modes = next(iter(bounds.values())).problem("path", next(iter(bounds.values())).phases(result.skeleton)).modes
        placed = [number for number, name in enumerate(modes.names) if name.startswith("1.screwdriver.")]
        np.testing.assert_allclose(variables[0][placed], variables[1][placed], atol=1e-9)
        # Their own relaxation: a path of one's own also keeps limits between slices, which families have none of.
        alone = [one.solve("sequence", result.skeleton, None).cost for one in bounds.values()]
        costs = [one.costs.total for one in result.payload]
        # Who shares a place does not pay less than with one of their own.
        assert all(common >= own * (1.0 - 1e-3) for common, own in zip(costs, alone, strict=True))
    assert found[True].cost <= max(one.costs.total for one in found[False].payload) * (1.0 + 1e-3)
    assert found[False].cost <= np.mean([one.costs.total for one in found[True].payload]) * (1.0 + 1e-3)
