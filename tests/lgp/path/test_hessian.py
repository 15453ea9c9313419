"""Convexification: negative curvature that accelerations and constraints outweigh is used; one minimum is left."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.path.costs import CondensedQuadratic, acceleration_quadratic, eliminate_slices
from lgp.path.hessian import MIN_CURVATURE_SHARE, Convexity


def convexity(joints: int = 3) -> tuple[Convexity, np.ndarray]:
    """One switch in the last of four slices whose rows hold the first joint."""
    condensed = eliminate_slices(acceleration_quadratic(4, 0.5, stop=True), np.array([3]))
    columns = np.arange(joints)
    stiff = 2.0 * float(condensed.cost[0, 0])
    return Convexity([(columns, condensed)], [columns], [columns], (joints, 0)), np.full(joints, stiff)


def test_negative_curvature_is_used_where_accelerations_or_rows_outweigh_it() -> None:
    test, stiff = convexity()
    jacobian = np.array([[1.0, 0.0, 0.0]])
    expected = np.diag([-50.0 * stiff[0], -0.9 * stiff[1], 2.0])
    assert test.convexify([expected], [jacobian], 0.0)[0] == pytest.approx(expected)
    # The second joint is held by nothing but its stiffness, most of which may be used up.
    for steep in (3.0, 9.0):
        (convexified,) = test.convexify([np.diag([0.0, -steep * stiff[1], 2.0])], [jacobian], 0.0)
        assert convexified == pytest.approx(np.diag([0.0, -(1.0 - MIN_CURVATURE_SHARE) * stiff[1], 2.0]), rel=1e-4)


def test_far_from_its_constraints_a_model_has_no_negative_curvature() -> None:
    test, stiff = convexity()
    expected = np.diag([-0.5 * stiff[0], 1.0, 0.0])
    assert test.convexify([expected], [np.eye(3)], 1.0)[0] == pytest.approx(np.diag([0.0, 1.0, 0.0]))


def test_variables_without_cost_have_no_negative_curvature() -> None:
    condensed = CondensedQuadratic(np.array([[1.0]]), np.array([[1.0]]))
    falling, both = np.diag([0.0, -1.0]), np.array([0, 1])
    # Rows that tie the variable to the joint hold it; rows on the joint alone do not.
    for row, expected in (([1.0, 0.0], 0.0), ([1.0, -1.0], -1.0)):
        test = Convexity([(np.array([0]), condensed)], [both], [both], (1, 1))
        (convexified,) = test.convexify([falling], [np.array([row])], 0.0)
        assert convexified == pytest.approx(np.diag([0.0, expected]), abs=1e-5)


def two_switches(joints: int) -> tuple[Convexity, list[np.ndarray], np.ndarray]:
    """Switches in two of eight slices, their columns, and the least cost (2 joints, 2 joints) through both."""
    condensed = eliminate_slices(acceleration_quadratic(8, 0.5, stop=True), np.array([3, 7]))
    columns = [np.arange(joints), joints + np.arange(joints)]
    test = Convexity([(np.arange(joints), condensed)], columns, columns, (joints, 0))
    return test, columns, np.kron(2.0 * condensed.cost, np.eye(joints))


def test_large_curvature_of_one_switch_does_not_reduce_that_of_another() -> None:
    test, _, cost = two_switches(2)
    steep, mild = np.diag([0.0, -1e3 * cost[1, 1]]), np.diag([-0.05 * cost[2, 2], 0.0])
    jacobian = np.zeros((1, 2))
    convexified = test.convexify([steep, mild], [jacobian, jacobian], 0.0)
    assert convexified[1] == pytest.approx(mild)
    assert steep[1, 1] < convexified[0][1, 1] < 0.0


@given(seed=st.integers(0, 10_000), size=st.floats(-2.0, 3.0))
@settings(max_examples=60, deadline=None)
def test_convexified_models_have_one_minimum(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    test, columns, cost = two_switches(4)
    hessians = [10.0**size * cost.max() * (root + root.T) for root in rng.normal(size=(2, 4, 4))]
    jacobians = list(rng.normal(size=(2, 2, 4)))
    convexified = test.convexify(hessians, jacobians, 0.0)
    matrix = cost.copy()
    for part, block, jacobian in zip(columns, convexified, jacobians, strict=True):
        matrix[np.ix_(part, part)] += block + 1e4 * cost.max() * jacobian.T @ jacobian
    assert np.linalg.eigvalsh(matrix).min() > 0.0
    for hessian, block in zip(hessians, convexified, strict=True):
        # Between the curvature itself and its convex part.
        values, vectors = np.linalg.eigh(hessian)
        convex = (vectors * np.maximum(values, 0.0)) @ vectors.T
        slack = 1e-9 * np.abs(hessian).max()
        assert np.linalg.eigvalsh(block - hessian).min() > -slack
        assert np.linalg.eigvalsh(convex - block).min() > -slack
