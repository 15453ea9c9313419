"""The paper's model: polynomials, weights, payload, errors per class beside Table I."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dreba
import reba
from dreba.domain import Bins
from dreba.surrogates.metrics import distance_to_published, evaluation_of
from dreba.surrogates.quadratic import build_qp, fit_polynomial, residual, solve
from dreba.surrogates.serialization import from_dict, to_dict
from reba.posture.columns import COLUMNS, INDEX
from tests.support.says import says

COMMITTED = {
    "neck_side_bend": (0.303, (-45, 0, 45), (1, 0, 1)),
    "neck_flexion": (1.008, (-35, 10, 55), (1, 0, 1)),
    "neck_twist": (0.524, (-45, 0, 45), (1, 0, 1)),
    "trunk_side_bend": (1.519, (-45, 0, 45), (1, 0, 1)),
    "trunk_flexion": (1.399, (-90, 0, 90), (3, 0, 3)),
    "trunk_twist": (1.856, (-45, 0, 45), (1, 0, 1)),
    "knee_flexion": (0.416, (-60, 0, 60), (2, 0, 2)),
    "upper_arm_abduction": (0.243, (-45, 0, 45), (1, 0, 1)),
    "upper_arm_flexion": (0.554, (-90, 0, 90), (3, 0, 3)),
    "lower_arm_flexion": (0.107, (0, 60, 100), (1, 0, 1)),
    "wrist_deviation": (0.096, (-45, 0, 45), (1, 0, 1)),
    "wrist_flexion": (0.843, (-45, 0, 45), (1, 0, 1)),
    "wrist_twist": (0.698, (-45, 0, 45), (1, 0, 1)),
}
"""What the paper's authors published as code in 2017 (github.com/buschbapti/handovers, reba_assess.py, commit 0d3ba79):
weight, angles [deg] and the values of the polynomial through them. Both sides are added. Facts to compare with."""
COMMITTED_BIAS = -0.206


def committed_model() -> dreba.QuadraticModel:
    """The authors' model in our form: their polynomials and weights, put in as if read from a file."""
    poses = dreba.sample(100, domain="paper", rng=1)
    data = to_dict(dreba.QuadraticModel(domain="paper").fit(poses.angles, poses.reba))
    polynomials, weights = np.zeros((22, 3)), np.zeros(22)
    for column in COLUMNS:
        name = column.removesuffix("_left").removesuffix("_right")
        if name in COMMITTED:
            weights[INDEX[column]], angles, values = COMMITTED[name]
            polynomials[INDEX[column]] = np.polyfit(angles, values, 2)[::-1]
    data["parameters"]["learned"] |= {
        "polynomials_": polynomials.tolist(), "weights_": weights.tolist(), "intercept_": COMMITTED_BIAS,
    }  # fmt: skip
    return from_dict(data)


def test_committed_weights_reproduce_table_1() -> None:
    poses = dreba.sample(50_000, domain="paper", rng=2)
    found = dreba.evaluate(committed_model(), poses)
    assert distance_to_published(found) <= 0.20
    assert found.rmse == pytest.approx(1.50, abs=0.10)


def test_refit_in_the_authors_domain_beats_the_published_error() -> None:
    train, held_out = (dreba.sample(10_000, domain="paper", rng=seed) for seed in (1, 2))
    found = dreba.evaluate(dreba.QuadraticModel(domain="paper").fit(train.angles, train.reba), held_out)
    assert found.rmse <= 1.47
    letter = dreba.QuadraticModel(domain="paper", curvature="any").fit(train.angles, train.reba)
    assert dreba.evaluate(letter, held_out).rmse <= found.rmse
    free = dreba.QuadraticModel(free=True).fit(train.angles, train.reba)
    assert dreba.evaluate(free, held_out).rmse <= 1.45


def test_class_power_moves_the_error_towards_the_printed_row() -> None:
    train, held_out = (dreba.sample(10_000, domain="paper", rng=seed) for seed in (1, 2))
    plain, low = (
        dreba.evaluate(dreba.QuadraticModel(domain="paper", class_power=p).fit(train.angles, train.reba), held_out)
        for p in (0.0, 1.0)
    )
    assert low.classes[1].rmse < plain.classes[1].rmse
    assert low.rmse > plain.rmse
    assert distance_to_published(low) < distance_to_published(plain)


@pytest.mark.parametrize("free", [False, True])
def test_the_fit_is_a_weighted_least_squares_optimum(free: bool) -> None:
    poses = dreba.sample(3000, rng=4)
    weights = np.random.default_rng(0).uniform(0.1, 3.0, 3000)
    model = dreba.QuadraticModel(free=free).fit(poses.angles, poses.reba, sample_weight=weights)
    best = np.average((model.predict(poses.angles) - poses.reba) ** 2, weights=weights)
    rng = np.random.default_rng(1)
    for _ in range(20):
        data = to_dict(model)
        learned = data["parameters"]["learned"]
        factor = np.repeat(rng.uniform(0.97, 1.03, 14), [1] * 6 + [2] * 8)
        name = "polynomials_" if free else "weights_"
        learned[name] = (np.array(learned[name]) * (factor[:, None] if free else factor)).tolist()
        learned["intercept_"] += rng.normal(0, 0.05)
        other = from_dict(data)
        assert np.average((other.value(poses.angles) - poses.reba) ** 2, weights=weights) > best


def test_weights_are_not_negative_and_sides_alike() -> None:
    poses = dreba.sample(3000, rng=4)
    model = dreba.QuadraticModel().fit(poses.angles, poses.reba)
    assert (model.weights_ >= 0).all()
    assert (model.polynomials_[:, 2] >= 0).all()
    for column in COLUMNS:
        if column.endswith("left"):
            assert model.weights_[INDEX[column]] == model.weights_[INDEX[column.replace("left", "right")]]


def test_columns_may_be_named_and_fewer() -> None:
    poses = dreba.sample(2000, rng=4)
    some = ("trunk_flexion", "neck_flexion", "upper_arm_flexion_left", "upper_arm_flexion_right")
    model = dreba.QuadraticModel(joints=some).fit(poses.angles[:, [INDEX[c] for c in some]], poses.reba)
    assert model.joints_ == some
    assert dreba.evaluate(model, poses).n == 2000
    with pytest.raises(dreba.ModelError) as error:
        dreba.QuadraticModel(joints=("trunk", "neck", "a", "b")).fit(poses.angles[:, :4], poses.reba)
    says(error, "'trunk'", "no part table", "free=True")
    with pytest.raises(dreba.ModelError) as error:
        dreba.QuadraticModel(joints=some).fit(poses.angles, poses.reba)
    says(error, "4 joints", "22 columns")


def test_polynomial_is_the_least_squares_fit_to_the_steps() -> None:
    bins = Bins((-30.0, -5.0, 20.0, 60.0, 110.0), (2, 1, 3, 4))
    angle = np.linspace(-30, 110, 140_001)
    steps = np.array(bins.points)[np.searchsorted(bins.edges[1:-1], angle)]
    assert fit_polynomial(bins, convex=False) == pytest.approx(np.polyfit(angle, steps, 2)[::-1], rel=2e-3)
    concave = Bins((0.0, 10.0, 90.0), (0, 1))
    assert fit_polynomial(concave, convex=False)[2] < 0
    line = np.polyfit(angle := np.linspace(0, 90, 90_001), angle > 10, 1)[::-1]
    assert fit_polynomial(concave) == pytest.approx([*line, 0.0], rel=2e-3)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 12))
def test_quadratic_program_is_solved_to_its_optimality_conditions(seed: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    features, targets = rng.normal(size=(40, k)), rng.normal(size=40)
    free = rng.random(k) < 0.3
    program = build_qp(features, targets, rng.random(40), free)
    weights = solve(program)
    assert (weights[~free] >= 0).all()
    assert residual(program, weights * program.scale) < 1e-8


@pytest.mark.parametrize(
    ("load", "tree", "linear"),
    [(0.0, 0, 0.0), (4.9, 0, 0.98), (5.0, 1, 1.0), (10.0, 1, 2.0), (10.1, 2, 2.02), (30.0, 2, 6.0)],
)
def test_payload_follows_equations_3_and_4(load: float, tree: int, linear: float) -> None:
    assert dreba.delta_payload(load) == tree
    assert dreba.delta_payload(load, "linear") == pytest.approx(linear)
    poses = dreba.sample(500, rng=4)
    model = dreba.QuadraticModel(payload="linear").fit(poses.angles, poses.reba)
    pose = poses.angles[0]
    assert model.value(pose, load=load, activity=2) == pytest.approx(model.value(pose) + linear + 2)


def test_factors_of_training_poses_are_taken_off() -> None:
    train = dreba.sample(6000, range(1, 16), rng=4, factors=["load", "coupling", "activity"])
    model = dreba.QuadraticModel().fit(train.angles, train.reba, factors=train.factors)
    assert model.coupling_weight_ > 0.1
    with_factors = dreba.evaluate(model, train)
    without = evaluation_of("quadratic", model.value(train.angles), train.reba)
    assert with_factors.rmse < 0.75 * without.rmse


def test_bad_parameters_and_units_are_pointed_out() -> None:
    poses = dreba.sample(300, rng=4)
    for wrong, fact in (
        ({"payload": "cubic"}, "tree, linear"),
        ({"curvature": "some"}, "nonnegative, any"),
        ({"omega_load": 0.0}, "above 0"),
        ({"domain": "mars"}, "unknown"),
    ):
        with pytest.raises(reba.RebaError) as error:
            dreba.QuadraticModel(**wrong).fit(poses.angles, poses.reba)
        says(error, fact, *wrong.values())
    with pytest.warns(dreba.RadiansWarning, match="degrees"):
        dreba.QuadraticModel().fit(np.radians(poses.angles), poses.reba)
    with pytest.raises(dreba.ModelError) as error:
        dreba.delta_payload(-1.0)
    says(error, "-1.0", "kilograms")
