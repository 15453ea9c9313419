"""Effect sizes, standard errors within participants and tests of assumptions against their definitions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize, stats

from lgp.statistics.effect_sizes import effect_size, friedman, normality, sphericity, within_errors


def test_interval_of_the_effect_size_is_that_of_the_noncentral_t() -> None:
    differences = np.random.default_rng(1).normal(0.7, 1.0, 12)
    found = effect_size(differences)
    t = found.dz * np.sqrt(12)
    for end, tail in ((found.dz_low, 0.975), (found.dz_high, 0.025)):
        centre = optimize.brentq(lambda nc, tail=tail: stats.nct.cdf(t, 11, nc) - tail, -20, 20)
        assert end == pytest.approx(centre / np.sqrt(12), abs=1e-6)
    assert found.g / found.dz == pytest.approx(1 - 3 / (4 * 11 - 1), abs=1e-3)
    assert found.g_low / found.dz_low == pytest.approx(found.g / found.dz)


def test_effect_sizes_that_cannot_be_given() -> None:
    assert np.isnan(effect_size(np.array([1.0])).dz)
    assert np.isnan(effect_size(np.full(5, 2.0)).dz)
    assert effect_size(np.zeros(5)).dz == 0.0
    assert effect_size(np.array([1.0, 2.0])).g == 0.0


@settings(max_examples=30, deadline=None)
@given(st.integers(3, 12), st.integers(0, 10_000))
def test_within_errors_ignore_who_is_high(people: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(people, 2))
    raised = values + rng.normal(0, 50, (people, 1))
    expected = np.std(values[:, 0] - values[:, 1], ddof=1) / np.sqrt(2 * people)
    assert within_errors(values) == pytest.approx([expected] * 2)
    assert within_errors(raised) == pytest.approx(within_errors(values), rel=1e-6)


def test_sphericity_is_mauchlys() -> None:
    rng = np.random.default_rng(5)
    values = rng.normal(size=(15, 3)) * [1.0, 1.0, 6.0]
    contrasts = np.array([[1, -1, 0], [1, 1, -2]]) / np.sqrt([[2], [6]])
    covariance = np.cov(values @ contrasts.T, rowvar=False)
    w = np.linalg.det(covariance) / (np.trace(covariance) / 2) ** 2
    chi = -(14 - (2 * 4 + 2 + 2) / 12) * np.log(w)
    found = sphericity(values)
    assert found is not None
    assert found.statistic == pytest.approx(chi)
    assert found.p == pytest.approx(stats.chi2.sf(chi, 2))
    assert found.p < 0.001
    assert sphericity(values[:, :2]) is None
    assert friedman(values[:, :2]) is None


def test_checks_without_data_say_nan() -> None:
    assert np.isnan(normality(np.array([1.0, 2.0])).p)
    assert np.isnan(normality(np.full(8, 1.0)).p)
    flat = sphericity(np.ones((8, 3)))
    assert flat is not None
    assert np.isnan(flat.p)
    ranks = friedman(np.ones((8, 3)))
    assert ranks is not None
    assert np.isnan(ranks.p)
