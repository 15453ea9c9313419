"""Ways to solve reach tasks: the same conditions for all, and what each adds."""

from __future__ import annotations

import numpy as np
import pytest

import dreba
import reba
from dreba.evaluation import reach_methods as reach
from dreba.evaluation.reach_tasks import starts, stored_tasks
from dreba.evaluation.staged_minimiser import BUDGET
from dreba.evaluation.usefulness import enable

pytestmark = pytest.mark.slow


def test_models_of_all_columns_in_another_order_solve_the_same_tasks() -> None:
    poses = dreba.sample(300, rng=1)
    model, other = (
        dreba.QuadraticModel(joints=joints).fit(poses, poses.reba) for joints in (None, tuple(reversed(reba.COLUMNS)))
    )
    (one,), (two,) = reach.one_stage(model).objectives, reach.one_stage(other).objectives
    for pose in poses.angles[:5]:
        assert two(pose)[0] == pytest.approx(one(pose)[0], abs=1e-6)
        assert two(pose)[1] == pytest.approx(one(pose)[1], abs=1e-6)


@pytest.mark.parametrize("cost", [reach.distance_to_rest, reach.comfort])
def test_costs_without_reba_are_least_at_rest_and_their_gradients_agree(cost: object) -> None:
    assert callable(cost)
    pose = np.linspace(-30.0, 60.0, 22)
    slope = [(cost(pose + e)[0] - cost(pose - e)[0]) / 2e-4 for e in 1e-4 * np.eye(22)]
    assert cost(pose)[1] == pytest.approx(slope, abs=1e-6)
    rest = np.where([column.startswith("lower_arm") for column in reba.COLUMNS], 80.0, 0.0)
    assert cost(rest)[0] == 0.0


def test_every_method_has_the_same_budget_and_what_it_adds_is_in_its_name() -> None:
    soft = dreba.load("soft")
    methods = reach.methods_of({"soft": soft})
    names = [method.full_name for method in methods]
    assert len(set(names)) == len(names)
    assert {"distance to rest", "comfort (homing)", "soft", "soft, graduated"} < set(names)
    assert all(f"{method.name}, free start, polish" in names for method in methods)  # what one may add, each may
    given = [stored.task for stored in stored_tasks("wide")[:3]]
    initial = starts("random", 3, 5).reshape(3, 1, 22)
    for method in methods:
        assert 0 < reach.run(method, given, initial).evaluations <= BUDGET, method.full_name


def test_stages_and_polish_lower_the_true_score() -> None:
    soft = dreba.load("soft")
    given = [stored.task for stored in stored_tasks("bench")[:6]]
    initial = starts("random", 6, 5).reshape(6, 1, 22)
    sharp, staged = (reach.run(way, given, initial) for way in (reach.one_stage(soft, "", 1.0), reach.graduated(soft)))
    polished = reach.run(reach.Method("", reach.graduated(soft).objectives, polished=True), given, initial)
    assert polished.scores.mean() <= staged.scores.mean() < sharp.scores.mean()


def test_standard_errors_are_over_tasks() -> None:
    scores = np.repeat([[1], [3], [2], [4]], 50, axis=1)
    result = reach.ReachResult(scores, 0.0, 0.0, 0.0, 0.0)
    mean, error = reach.mean_and_error(result.by_task)
    assert mean == 2.5
    assert error == pytest.approx(np.std([1, 3, 2, 4], ddof=1) / 2.0)  # fifty starts of a task say no more than one


def test_rows_of_a_comparison() -> None:
    narrow = dreba.QuadraticModel(joints=reba.COLUMNS[:3])
    poses = dreba.sample(300, rng=1)
    narrow.fit(poses.angles[:, :3], poses.reba)
    found = enable({"convex": dreba.load("convex"), "narrow": narrow}, 2)
    assert found["left_out"] == ["narrow"]
    assert found["certified"]["tasks"] <= found["tasks"] == 2
    assert {row["start"] for row in found["rows"]} == {"random", "neutral"}
    assert {row["solver"] for row in found["rows"]} == {found["solver"]}
    nulls = [row for row in found["rows"] if row["name"] in ("distance to rest", "distance to rest, free start")]
    assert [row["difference"] for row in nulls] == [0.0] * 4
    assert all(row["certified"] <= row["reba"] for row in found["rows"])
    assert {row["name"]: row["model"] for row in found["rows"] if "convex" in row["name"]} == {
        "convex": "convex",
        "convex, free start": "convex",
        "convex, free start, polish": "convex",
    }
    assert not any(row["model"] for row in found["rows"] if row["name"].startswith(("distance", "comfort")))
    advised = found["recommended"]["name"]
    means = {row["name"]: 0.0 for row in found["rows"]}
    for row in found["rows"]:
        means[row["name"]] += row["reba"] / 2.0
    assert found["recommended"]["reba"] == pytest.approx(means[advised])
    assert means[advised] <= means["distance to rest"]
    with pytest.raises(dreba.ModelError, match="81 reach tasks"):
        enable({"convex": dreba.load("convex")}, 81)
