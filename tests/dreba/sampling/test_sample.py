"""Random poses: balanced, exactly distributed, reproducible, and refused for classes out of reach."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2, ks_2samp

import dreba
import reba
from dreba.domain import DOMAINS
from dreba.sampling.classes import true_scores
from reba.posture.columns import COLUMNS, INDEX
from tests.support.says import says

ALL_FACTORS = ["load", "coupling", "activity"]
NARROW = dataclasses.replace(
    dreba.domain_of("human"),
    limits={c: ((-8.0, 24.0) if "lower_arm" not in c else (50.0, 110.0)) for c in COLUMNS},
)
"""Limits so near to upright that low classes are frequent among uniform draws."""


@pytest.mark.parametrize("domain", DOMAINS)
@pytest.mark.parametrize("weights", ["bins", "volume", "cells"])
def test_classes_are_even_and_limits_kept(domain: str, weights: str) -> None:
    poses = dreba.sample(1003, rng=5, domain=domain, weights=weights)
    assert set(poses.counts) == set(range(1, 11))
    assert max(poses.counts.values()) - min(poses.counts.values()) == 1
    space = dreba.domain_of(domain)
    assert (poses.angles >= space.low).all()
    assert (poses.angles <= space.high).all()


@pytest.mark.parametrize("domain", ["human", "human_description"])
def test_scores_are_exact(domain: str) -> None:
    poses = dreba.sample(1500, range(1, 16), rng=5, domain=domain, factors=ALL_FACTORS)
    exact = reba.score_array(poses.angles, poses.factors, dreba.domain_of(domain).rules).reba
    assert np.array_equal(poses.reba, exact)
    assert set(poses.counts.values()) == {100}


@settings(max_examples=25, deadline=None)
@given(st.sets(st.integers(1, 10), min_size=1), st.integers(0, 2**40), st.booleans())
def test_any_classes_any_seed(classes: set[int], seed: int, stratified: bool) -> None:
    poses = dreba.sample(40, sorted(classes), rng=seed, stratified=stratified)
    assert set(poses.counts) == classes
    again = dreba.sample(40, sorted(classes), rng=seed, stratified=stratified)
    assert np.array_equal(poses.angles, again.angles)


@pytest.mark.parametrize(("domain", "classes"), [(NARROW, (1, 2, 3, 4)), ("human", (7, 8, 9, 10))])
def test_volume_weights_equal_rejection(domain: dreba.Domain | str, classes: tuple[int, ...]) -> None:
    """Within a class, poses are distributed as uniform draws that were kept because they had it."""
    space = dreba.domain_of(domain)
    rng = np.random.default_rng(8)
    uniform = space.low + (space.high - space.low) * rng.random((150_000, 22))
    scores = reba.score_array(uniform, None, space.rules).reba
    drawn = dreba.sample(20_000, classes, domain=space, rng=9, weights="volume")
    p_values = []
    for score in classes:
        kept = uniform[scores == score][:5000]
        assert len(kept) > 400
        own = drawn.angles[drawn.reba == score]
        p_values += [ks_2samp(kept[:, i], own[:, i]).pvalue for i in range(22)]
        # Angles of one part depend on each other only through the class: products would show a wrong joint draw.
        for a, b in (("trunk_flexion", "neck_flexion"), ("upper_arm_flexion_left", "upper_arm_flexion_right")):
            pair = [np.abs(part[:, INDEX[a]]) * np.abs(part[:, INDEX[b]]) for part in (kept, own)]
            p_values.append(ks_2samp(*pair).pvalue)
    # Bonferroni: with the right distribution the smallest of about 100 p_values is below 1e-5 once in a thousand seeds.
    assert min(p_values) > 1e-5


def test_bins_of_the_authors_equal_their_rejection_sampler() -> None:
    """Domain "paper": a bin per joint drawn uniformly, an angle inside it, kept if it has the class."""
    space = dreba.domain_of("paper")
    rng = np.random.default_rng(3)
    angles = np.zeros((120_000, 22))
    for column in space.columns:
        edges, points = space.bins_of(column)
        bins = rng.integers(len(points), size=len(angles))
        low, high = np.array(edges)[bins], np.array(edges)[bins + 1]
        angles[:, INDEX[column]] = low + (high - low) * rng.random(len(angles))
    scores = true_scores(space, angles, None)
    drawn = dreba.sample(8000, (7, 9), domain="paper", rng=4)
    p_values = [
        ks_2samp(angles[scores == score][:4000, INDEX[c]], drawn.angles[drawn.reba == score][:, INDEX[c]]).pvalue
        for score in (7, 9)
        for c in space.columns
    ]
    assert min(p_values) > 1e-5


def test_weights_cells_give_every_combination_of_part_scores_the_same_probability() -> None:
    poses = dreba.sample(20_000, [2], rng=1, weights="cells")
    scores = reba.score_array(poses.angles)
    parts = (
        "trunk",
        "neck",
        "legs",
        *(f"{p}_{s}" for p in ("upper_arm", "lower_arm", "wrist") for s in ("left", "right")),
    )
    _, counts = np.unique(np.stack([scores[p] for p in parts], axis=1), axis=0, return_counts=True)
    statistic = ((counts - counts.mean()) ** 2 / counts.mean()).sum()
    assert statistic < chi2.ppf(0.99999, len(counts) - 1)


def test_stratified_fills_scores_to_within_one_pose() -> None:
    def counts(stratified: bool) -> np.ndarray:
        poses = dreba.sample(3000, [8], rng=2, weights="cells", stratified=stratified)
        scores = reba.score_array(poses.angles)
        return np.bincount(scores.score_a.astype(int) * 10 + scores.score_b_left, minlength=100)

    large = counts(True) * 1.0
    expected = dreba.sample(300_000, [8], rng=2, weights="cells", stratified=True)
    scores = reba.score_array(expected.angles)
    target = np.bincount(scores.score_a.astype(int) * 10 + scores.score_b_left, minlength=100) / 100
    # One pose for each of up to nine scores of the right arm that a pair of Score A and left Score B goes with.
    assert np.abs(large - target).max() <= 2.0
    assert np.abs(counts(False) - target).max() > 5.0


@pytest.mark.parametrize("side", ["left", "right"])
def test_one_arm_leaves_the_other_at_rest(side: str) -> None:
    other = "right" if side == "left" else "left"
    poses = dreba.sample(500, rng=1, arms=side)
    scores = reba.score_array(poses.angles)
    assert (scores[f"score_b_{other}"] == 1).all()
    assert np.array_equal(scores.reba, scores[f"reba_{side}"])


def test_without_adjustments_twists_are_zero_and_high_classes_gone() -> None:
    poses = dreba.sample(400, range(1, 9), rng=1, adjustments=False)
    assert not poses.angles[:, [INDEX["trunk_twist"], INDEX["wrist_twist_left"]]].any()
    with pytest.raises(dreba.SampleError) as error:
        dreba.sample(400, [11], rng=1, adjustments=False)
    says(error, "class 11", "reachable: 1, 2")


def test_shared_factors_count() -> None:
    factors = reba.Factors(load=12.0, support="unilateral", arm_supported_left=True)
    poses = dreba.sample(500, range(4, 9), rng=1, factors=factors)
    assert np.array_equal(poses.reba, reba.score_array(poses.angles, factors).reba)


@pytest.mark.parametrize(
    ("wrong", "fact"),
    [
        ({"classes": [12]}, "class 12 cannot be reached in domain 'human' with no factors drawn; reachable: 1, 2"),
        ({"classes": [16]}, "not a REBA score"),
        ({"classes": [3, 3]}, "once"),
        ({"classes": []}, "at least one"),
        ({"n": 5}, "one pose for each of 10"),
        ({"domain": "humann"}, "did you mean 'human'"),
        ({"weights": "even"}, "bins, volume, cells"),
        ({"factors": ["shock"]}, "load, coupling, activity"),
        ({"factors": reba.Factors(load=np.ones(3))}, "array"),
        ({"arms": "middle"}, "both, left or right"),
        ({"rng": -1}, "seed"),
    ],
)
def test_bad_requests_are_one_clear_line(wrong: dict, fact: str) -> None:
    with pytest.raises(reba.RebaError) as error:
        dreba.sample(**{"n": 100, **wrong})
    says(error, fact)


def test_generator_is_recorded_so_that_poses_can_be_drawn_again() -> None:
    rng = np.random.default_rng(77)
    rng.random(5)
    poses = dreba.sample(50, rng=rng)
    state = poses.provenance["generator"]
    again = np.random.default_rng(0)
    again.bit_generator.state = state
    assert np.array_equal(dreba.sample(50, rng=again).angles, poses.angles)


@pytest.mark.parametrize(
    "arguments",
    [{"n": True}, {"n": 10**13}, {"classes": 5}, {"factors": "load"}, {"factors": 3}, {"domain": 5}, {"domain": None}],
)
def test_wrong_types_are_refused_in_one_line(arguments: dict[str, object]) -> None:
    with pytest.raises(reba.RebaError) as error:
        dreba.sample(**{"n": 100, "rng": 1, **arguments})
    says(error, "expected", next(iter(arguments.values())))


def test_shared_factors_are_kept_in_the_provenance() -> None:
    poses = dreba.sample(20, [5], factors=reba.Factors(load=7.0), rng=1)
    assert poses.provenance["shared_factors"]["load"] == 7.0


def test_domains_in_radians_are_told() -> None:
    human = dreba.domain_of("human")
    small = {column: (low / 57.3, high / 57.3) for column, (low, high) in human.limits.items()}
    domain = dataclasses.replace(human, limits=small).hold(lower_arm_flexion=80.0)
    with pytest.warns(reba.RadiansWarning, match="degrees") as caught:
        dreba.sample(20, [1], domain=domain, rng=1)
    assert [warning.filename for warning in caught] == [__file__]
