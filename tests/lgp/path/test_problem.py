"""Parts of a path model: leg reach, convexified curvature, the ergonomic Hessian in blocks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dreba
from lgp.kinematics.posture import PostureMap
from lgp.path.constraints import BLEND, LegReachConstraint
from lgp.path.costs import CondensedQuadratic, eliminate_slices, quadratic
from lgp.path.ergonomics import Ergonomics
from lgp.path.hessian import MIN_CURVATURE_SHARE, Convexity
from tests.support.lgp_worlds import human_world


@pytest.fixture(scope="module")
def standing() -> tuple[np.ndarray, LegReachConstraint]:
    world = human_world("solved")
    legs, rng = LegReachConstraint(world), np.random.default_rng(0)
    q = np.tile(world.start, (40, 1))
    q[:, legs.columns] += 0.02 * rng.normal(size=(40, len(legs.columns)))
    q[:5, legs.columns] = world.start[legs.columns]
    return q, legs


def test_one_constraint_bounds_the_reach_of_both_legs(standing: tuple[np.ndarray, LegReachConstraint]) -> None:
    q, legs = standing
    both = PostureMap(human_world("solved")).reach(q)[0]
    value, _ = legs.evaluate(q)
    assert (value >= both.max(axis=1)).all()
    assert (value <= both.max(axis=1) + BLEND * np.log(2.0) + 1e-12).all()


def test_leg_reach_has_its_stated_gradient_and_convex_curvature(
    standing: tuple[np.ndarray, LegReachConstraint],
) -> None:
    q, legs = standing
    _, slope = legs.evaluate(q)
    for at, column in enumerate(legs.columns):
        step = np.zeros(q.shape[1])
        step[column] = 1e-7
        difference = (legs.evaluate(q + step)[0] - legs.evaluate(q - step)[0]) / 2e-7
        assert slope[:, at] == pytest.approx(difference, abs=1e-5)
    assert np.linalg.eigvalsh(legs.curvature(q)).min() > -1e-9


def convexity(joints: int = 3) -> tuple[Convexity, np.ndarray]:
    """One switch in the last of four slices whose rows hold the first joint."""
    condensed = eliminate_slices(quadratic(4, 0.5, stop=True), np.array([3]))
    columns = np.arange(joints)
    stiff = 2.0 * float(condensed.cost[0, 0])
    return Convexity([(columns, condensed)], [columns], [columns], (joints, 0)), np.full(joints, stiff)


def test_negative_curvature_is_used_where_accelerations_or_rows_outweigh_it() -> None:
    test, stiff = convexity()
    jacobian = np.array([[1.0, 0.0, 0.0]])
    kept = np.diag([-50.0 * stiff[0], -0.9 * stiff[1], 2.0])
    assert test.convexify([kept], [jacobian], 0.0)[0] == pytest.approx(kept)
    # The second joint is held by nothing but its stiffness, most of which may be used up.
    for steep in (3.0, 9.0):
        (found,) = test.convexify([np.diag([0.0, -steep * stiff[1], 2.0])], [jacobian], 0.0)
        assert found == pytest.approx(np.diag([0.0, -(1.0 - MIN_CURVATURE_SHARE) * stiff[1], 2.0]), rel=1e-4)


def test_far_from_its_constraints_a_model_has_no_negative_curvature() -> None:
    test, stiff = convexity()
    kept = np.diag([-0.5 * stiff[0], 1.0, 0.0])
    assert test.convexify([kept], [np.eye(3)], 1.0)[0] == pytest.approx(np.diag([0.0, 1.0, 0.0]))


def test_variables_without_cost_have_no_negative_curvature() -> None:
    condensed = CondensedQuadratic(np.array([[1.0]]), np.array([[1.0]]))
    falling, both = np.diag([0.0, -1.0]), np.array([0, 1])
    # Rows that tie the variable to the joint hold it; rows on the joint alone do not.
    for row, kept in (([1.0, 0.0], 0.0), ([1.0, -1.0], -1.0)):
        test = Convexity([(np.array([0]), condensed)], [both], [both], (1, 1))
        (found,) = test.convexify([falling], [np.array([row])], 0.0)
        assert found == pytest.approx(np.diag([0.0, kept]), abs=1e-5)


def two_switches(joints: int) -> tuple[Convexity, list[np.ndarray], np.ndarray]:
    """Switches in two of eight slices, their columns, and the least cost (2 joints, 2 joints) through both."""
    condensed = eliminate_slices(quadratic(8, 0.5, stop=True), np.array([3, 7]))
    columns = [np.arange(joints), joints + np.arange(joints)]
    test = Convexity([(np.arange(joints), condensed)], columns, columns, (joints, 0))
    return test, columns, np.kron(2.0 * condensed.cost, np.eye(joints))


def test_large_curvature_of_one_switch_does_not_reduce_that_of_another() -> None:
    test, _, cost = two_switches(2)
    steep, mild = np.diag([0.0, -1e3 * cost[1, 1]]), np.diag([-0.05 * cost[2, 2], 0.0])
    jacobian = np.zeros((1, 2))
    found = test.convexify([steep, mild], [jacobian, jacobian], 0.0)
    assert found[1] == pytest.approx(mild)
    assert steep[1, 1] < found[0][1, 1] < 0.0


@given(seed=st.integers(0, 10_000), size=st.floats(-2.0, 3.0))
@settings(max_examples=60, deadline=None)
def test_convexified_models_have_one_minimum(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    test, columns, cost = two_switches(4)
    bends = [10.0**size * cost.max() * (root + root.T) for root in rng.normal(size=(2, 4, 4))]
    jacobians = list(rng.normal(size=(2, 2, 4)))
    found = test.convexify(bends, jacobians, 0.0)
    matrix = cost.copy()
    for part, block, jacobian in zip(columns, found, jacobians, strict=True):
        matrix[np.ix_(part, part)] += block + 1e4 * cost.max() * jacobian.T @ jacobian
    assert np.linalg.eigvalsh(matrix).min() > 0.0
    for bend, block in zip(bends, found, strict=True):
        # Between the curvature itself and its convex part.
        values, vectors = np.linalg.eigh(bend)
        convex = (vectors * np.maximum(values, 0.0)) @ vectors.T
        slack = 1e-9 * np.abs(bend).max()
        assert np.linalg.eigvalsh(block - bend).min() > -slack
        assert np.linalg.eigvalsh(convex - block).min() > -slack


@pytest.mark.parametrize(("kind", "sums"), [("convex", True), ("soft", False)])
def test_the_ergonomic_hessian_has_convex_blocks(kind: str, sums: bool) -> None:
    world = human_world("solved")
    cost = Ergonomics(world, dreba.load(kind))
    assert (len(cost.parts) > 5) == sums
    assert sorted(np.concatenate(cost.parts).tolist()) == sorted(set(np.concatenate(cost.parts).tolist()))
    q = np.tile(world.start, (6, 1))
    q[:, cost.columns] += 0.1 * np.random.default_rng(1).normal(size=(6, len(cost.columns)))
    q = np.clip(q, world.lower, world.upper)
    value, gradient, bends = cost.quadratic_model(q, np.zeros(6))
    assert value == pytest.approx(cost.value(q, np.zeros(6)))
    assert [bend.shape for bend in bends] == [(6, len(part), len(part)) for part in cost.parts]
    assert all(np.linalg.eigvalsh(bend).min() > -1e-6 * np.abs(bend).max() for bend in bends)
    for at, column in enumerate(cost.columns):
        step = np.zeros(world.nq)
        step[column] = 1e-6
        difference = (cost.value(q + step, np.zeros(6)) - cost.value(q - step, np.zeros(6))) / 2e-6
        assert gradient[:, at] == pytest.approx(difference, abs=1e-3 * max(1.0, np.abs(gradient).max()))


def test_the_hessian_of_a_sum_holds_the_curvature_of_the_angles() -> None:
    world = human_world("solved")
    cost = Ergonomics(world, dreba.load("convex"))
    q = world.start[None].copy()
    # Away from the knots of the hinges, where second derivatives jump.
    for name, value in (("clavicle_joint_X", 0.05), ("shoulder_Z", 0.65), ("shoulder_X", 0.33)):
        q[0, world.column[f"human.right_{name}"]] = value
    part = next(p for p in cost.parts if world.column["human.right_shoulder_Z"] in cost.columns[p])
    number = [np.array_equal(part, other) for other in cost.parts].index(True)
    columns = cost.columns[part]

    def gradient(at: np.ndarray) -> np.ndarray:
        return cost.quadratic_model(at, np.zeros(1))[1][0, part]

    true = np.array([(gradient(q + 1e-5 * row) - gradient(q - 1e-5 * row)) / 2e-5 for row in np.eye(world.nq)[columns]])
    values, vectors = np.linalg.eigh(0.5 * (true + true.T))
    clipped = (vectors * np.maximum(values, 0.0)) @ vectors.T
    assert cost.quadratic_model(q, np.zeros(1))[2][number][0] == pytest.approx(clipped, abs=1e-2 * np.abs(values).max())
