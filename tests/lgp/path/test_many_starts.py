"""Sequences from many starts: derivatives on stacked arrays, and the minimum that one start misses."""

import numpy as np
import pytest

import dreba
from lgp.kinematics.world import World
from lgp.path.bounds import PathBounds
from lgp.path.ergonomics import Ergonomics
from lgp.path.many_starts import ManyStarts
from lgp.planner import follow, parse_sequence, task_of
from lgp.scene.scene_file import load_scene

HEIGHTS = {"left": 1.5486, "center": 0.9118, "right": 1.0233}
LINES = (
    "grasp(baxter.right, screwdriver)",
    "place(baxter.right, screwdriver, table.center)",
    "grasp(human.right_hand, screwdriver)",
)


@pytest.fixture(scope="module")
def bounds() -> PathBounds:
    world = World(load_scene("screwdriver").with_heights(HEIGHTS))
    return PathBounds(world, Ergonomics(world, dreba.load("convex")))


@pytest.fixture(scope="module")
def many(bounds: PathBounds) -> ManyStarts:
    actions = parse_sequence(task_of(bounds.world.scene), LINES)
    return ManyStarts(bounds.problem("sequence", bounds.phases(actions)))


def test_points_solved_at_once_have_the_derivatives_that_they_say(many: ManyStarts) -> None:
    # Near the rest posture, where no rotation between hand and object is half a turn.
    rng = np.random.default_rng(3)
    u = many.problem.join(*_rest(many))[None, many.columns] + 0.05 * rng.uniform(-1.0, 1.0, (3, many.n))
    values = many.evaluate(u)
    model = many.linearise(u, np.zeros_like(values[1]), np.zeros_like(values[2]))
    for number in range(many.n):
        step = np.zeros(many.n)
        step[number] = 1e-6
        ahead, behind = many.evaluate(u + step), many.evaluate(u - step)
        cost, eq, ineq = ((high - low) / 2e-6 for high, low in zip(ahead, behind, strict=True))
        np.testing.assert_allclose(model.gradient[:, number], cost, atol=1e-4 * max(1.0, np.abs(cost).max()))
        np.testing.assert_allclose(model.eq_jac[:, :, number], eq, atol=1e-5)
        np.testing.assert_allclose(model.in_jac[:, :, number], ineq, atol=1e-5)


def test_a_point_has_the_same_values_alone_and_among_others(many: ManyStarts) -> None:
    u = many.starts(0)[:, many.columns]
    together = many.evaluate(u)
    for number in (0, len(u) - 1):
        for one, every in zip(many.evaluate(u[number : number + 1]), together, strict=True):
            np.testing.assert_allclose(one[0], every[number], atol=1e-12)


def test_solutions_are_points_of_the_sequence_problem(many: ManyStarts) -> None:
    found = many.minima(many.problem.join(*_rest(many))[None])
    assert found.starts == 33
    assert 1 <= found.agreed <= found.starts
    for point in found.points:
        values = many.problem.constraints.evaluate(*many.problem.split(point))
        assert np.abs(values.equality).max() < 2e-3
        assert values.inequality.max() < 2e-3


@pytest.mark.slow
def test_the_best_motion_is_found_where_one_start_misses_it(bounds: PathBounds) -> None:
    actions = parse_sequence(task_of(bounds.world.scene), LINES)
    alone = follow(PathBounds(bounds.world, bounds.ergonomics, multi_start=False), actions)
    best = follow(bounds, actions)
    assert best.cost < 0.9 * alone.cost
    assert alone.payload.starts == (1, 1)
    assert best.payload.starts[0] >= 2


def _rest(many: ManyStarts) -> tuple[np.ndarray, np.ndarray]:
    q = np.tile(many.problem.initial_configuration, (len(many.problem.knots), 1))
    return q, many.problem.modes.guess(q)
