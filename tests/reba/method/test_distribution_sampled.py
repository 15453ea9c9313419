"""The distribution of REBA against a million samples of the angles, scored by the core itself."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import reba
from tests.support import posture_samples as samples

pytestmark = pytest.mark.slow

SAMPLES = 1_000_000
GRAVITY = reba.Rules(upper_arm_reference="gravity")


def sampled(
    posture: NDArray[np.float64], error: reba.MeasurementError, rules: reba.Rules, factors: dict[str, object], seed: int
) -> NDArray[np.float64]:
    """Shares of REBA 1..15 among samples of the true angles of one posture."""
    rng = np.random.default_rng(seed)
    found = np.zeros(15)
    for _ in range(10):
        noise = rng.standard_normal((SAMPLES // 10, len(reba.COLUMNS)))
        angles = posture - np.array(error.bias) + np.array(error.sd) * noise
        found += np.bincount(reba.score_array(angles, factors, rules).reba, minlength=16)[1:]
    return found / SAMPLES


@pytest.mark.parametrize("case", range(12))
def test_equals_a_million_samples(case: int) -> None:
    """Every probability lies within five standard errors of its share among the samples."""
    rng = np.random.default_rng([11, case])
    names = ("optical", "inertial", "multi-camera", "one-camera")
    error = reba.MeasurementError.of(names[case % 4])
    if case >= 8:
        error = reba.MeasurementError.of(
            {column: {"sd": rng.uniform(0, 20), "bias": rng.uniform(-5, 5)} for column in reba.COLUMNS}
        )
    rules = reba.Rules(
        twist_and_bend=("one", "two")[case % 2],  # type: ignore[arg-type]
        two_sides=("worse", "worse", "left", "right")[case % 4],  # type: ignore[arg-type]
        trunk_upright=float(rng.choice([0.0, 5.0, 10.0])),
    )
    factors = samples.frame_factors(samples.random_factors(rng, 1), 0)
    posture = np.clip(samples.random_angles(rng, 1)[0], -120.0, 120.0)
    found = reba.score_probabilities(posture, factors, rules, error=error)[0]
    shares = sampled(posture, error, rules, factors, case)
    standard_error = np.sqrt(found * (1.0 - found) / SAMPLES)
    assert (np.abs(found - shares) <= 5.0 * standard_error + 1e-7).all(), np.column_stack([found, shares])


def test_arms_against_gravity_are_approximate_within_what_is_said() -> None:
    """Trunk and arms share columns there: P(REBA at most k) is within 0.05, and 0.01 on average."""
    rng = np.random.default_rng(12)
    error = reba.MeasurementError.of("inertial")
    worst = []
    for seed in range(10):
        posture = rng.normal(0.0, 25.0, len(reba.COLUMNS))
        posture[0] = rng.uniform(0.0, 80.0)
        found = reba.score_probabilities(posture, None, GRAVITY, error=error)[0]
        shares = sampled(posture, error, GRAVITY, {}, seed)
        worst.append(np.abs(found.cumsum() - shares.cumsum()).max())
    assert max(worst) < 0.05, worst
    assert np.mean(worst) < 0.01, worst
    scores = reba.score_array(np.zeros((1, 22)), None, GRAVITY, error=error)
    assert scores.distribution is not None
    assert not scores.distribution.exact
