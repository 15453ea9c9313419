"""Polylines around what is in the way, checked by a test of their own at ten times the density."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lgp.path.random_trees import RESOLUTION, along, connect
from reba.arrays import Array, Flags

LOWER, UPPER = -np.ones(3), np.ones(3)
START, GOALS = np.array([-0.8, 0.0, 0.0]), np.array([[0.8, 0.0, 0.0], [0.8, 0.5, 0.0]])


def behind_wall_with_hole(q: Array) -> Flags:
    return ~((np.abs(q[:, 0]) < 0.1) & ((np.abs(q[:, 1] - 0.7) > 0.15) | (np.abs(q[:, 2] - 0.7) > 0.15)))


def behind_wall(q: Array) -> Flags:
    return np.abs(q[:, 0]) > 0.1


@pytest.mark.parametrize("seed", range(5))
def test_a_way_through_a_hole_is_found_and_free(seed: int) -> None:
    line = connect(START, GOALS, LOWER, UPPER, behind_wall_with_hole, np.random.default_rng(seed))
    assert line is not None
    assert line[0].tolist() == START.tolist()
    assert line[-1].tolist() in GOALS.tolist()
    assert ((line >= LOWER) & (line <= UPPER)).all()
    share = np.linspace(0.0, 1.0, 200)[:, None]
    dense = np.concatenate([first + share * (last - first) for first, last in pairwise(line)])
    # Between two configurations that are checked it may cut an edge of the wall by half their distance.
    assert np.abs(dense[~behind_wall_with_hole(dense), 0]).min(initial=1.0) > 0.1 - RESOLUTION


def test_without_a_way_there_is_none() -> None:
    assert connect(START, GOALS, LOWER, UPPER, behind_wall, np.random.default_rng(0)) is None


@given(st.integers(1, 40), st.integers(2, 6), st.integers(0, 1000))
def test_configurations_along_a_polyline_end_where_it_ends_and_never_turn_back(count: int, m: int, seed: int) -> None:
    line = np.sort(np.random.default_rng(seed).uniform(-1.0, 1.0, (m, 2)), axis=0)
    at = along(line, count)
    assert at.shape == (count, 2)
    assert np.allclose(at[-1], line[-1])
    assert (np.diff(np.concatenate([line[:1], at]), axis=0) >= -1e-12).all()
