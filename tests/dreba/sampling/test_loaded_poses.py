"""Poses repeated with random factors: every model of the command knows what load, coupling and activity add."""

from __future__ import annotations

import numpy as np
import pytest

import dreba
import reba
from dreba.sampling.loaded_poses import EVERY, with_factors


def skewed() -> dreba.Poses:
    """Poses as a recording has them: hundreds of classes 8 to 10, and two of class 2."""
    poses = dreba.sample(3000, rng=7)
    return poses.rows(
        np.flatnonzero(np.isin(poses.reba, [8, 9, 10]) | (np.cumsum(poses.reba == 2) <= 2) & (poses.reba == 2))
    )


@pytest.mark.parametrize("kind", ["quadratic", "convex"])
def test_rare_classes_do_not_decide_what_a_factor_adds(kind: str) -> None:
    poses = skewed()
    exact = reba.score_array(poses.angles, {"coupling": "unacceptable"}).reba - poses.reba.astype(float)
    rises = []
    for seed in range(4):
        train, weights = with_factors(poses, np.random.default_rng(seed), poses.balancing_weights())
        model = dreba.KINDS[kind]().fit(train, train.reba, sample_weight=weights, factors=train.factors)
        assert model.factors_ == ("load", "coupling", "activity")
        rises.append(np.mean(model.value(poses.angles, coupling="unacceptable") - model.value(poses.angles)))
    assert rises == pytest.approx([exact.mean()] * 4, abs=0.4)


def test_a_part_of_the_poses_is_repeated_with_their_true_scores() -> None:
    poses = dreba.sample(500, rng=8)
    for weights in (None, np.ones(500)):
        loaded, of_all = with_factors(poses, np.random.default_rng(0), weights)
        more = len(loaded) - 500
        assert more == (100 if weights is None else 500)
        assert (loaded.angles[:500] == poses.angles).all()
        assert (reba.score_array(loaded.angles, loaded.factors).reba == loaded.reba).all()
        assert of_all is None if weights is None else of_all.sum() == pytest.approx(500 * (1 + 1 / EVERY))


def test_factors_that_differ_already_are_kept() -> None:
    poses = dreba.sample(300, range(1, 16), factors=["load", "coupling", "activity"], rng=9)
    weights = np.ones(300)
    assert with_factors(poses, np.random.default_rng(0), weights) == (poses, weights)
