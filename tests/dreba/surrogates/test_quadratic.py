"""The paper's model: polynomials, weights, payload, errors per class beside Table I."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dreba
import reba
from dreba.domain import Bins
from dreba.surrogates.bounded_qp import build_qp, residual, solve
from dreba.surrogates.metrics import distance_to_published, evaluation_of
from dreba.surrogates.part_polynomials import fit_polynomial, lowest_class
from dreba.surrogates.serialization import from_dict, to_dict
from reba.posture.columns import COLUMNS, INDEX
from tests.support.says import says


def test_the_published_coefficients_reproduce_table_1() -> None:
    model = dreba.load("busch2018")
    found = dreba.evaluate(model, dreba.sample(50_000, domain="paper", rng=2))
    assert distance_to_published(found) <= 0.20
    assert found.rmse == pytest.approx(1.50, abs=0.10)
    assert "buschbapti/handovers" in model.about_.provenance["source"]
    elbow = INDEX["lower_arm_flexion_left"]
    assert -model.linear_[elbow] / model.twice_curvature_[elbow] == pytest.approx(50.0)
    assert model.weights_[INDEX["trunk_twist"]] == 1.856
    assert model.intercept_ == -0.206


def test_the_model_of_the_paper_knows_the_payload_and_nothing_else() -> None:
    model = dreba.load("busch2018")
    assert model.factors_ == ("load",)
    pose = np.zeros(22)
    assert model.value(pose, load=2.5) == pytest.approx(model.value(pose) + 0.5)
    with pytest.warns(dreba.FactorWarning, match="knows load only") as caught:
        assert model.value(pose, coupling="poor", activity=2) == model.value(pose)
    assert len(caught) == 2


def test_the_minimum_of_each_polynomial_is_in_its_class_of_lowest_points() -> None:
    poses = dreba.sample(3000, rng=4)
    domain = dreba.domain_of("human")
    for free in (False, True):
        model = dreba.QuadraticModel(free=free, minimum="lowest").fit(poses, poses.reba)
        c1, c2 = model.linear_, model.twice_curvature_ / 2.0
        for column, index in INDEX.items():
            low, high = lowest_class(domain.bins_of(column))
            if c2[index]:
                assert low - 1e-6 <= -c1[index] / (2.0 * c2[index]) <= high + 1e-6
            else:
                assert c1[index] == 0.0
    edges = (-30.0, -5.0, 20.0, 60.0, 110.0)
    angle = np.linspace(-30.0, 110.0, 14_001)
    steps = np.array((2, 1, 3, 4))[np.searchsorted(edges[1:-1], angle)]

    def error(parabola: np.ndarray) -> float:
        return float(((np.polyval(parabola[::-1], angle) - steps) ** 2).mean())

    best = fit_polynomial(Bins(edges, (2, 1, 3, 4)), minimum=(-3.0, 15.0))
    for vertex in np.linspace(-3.0, 15.0, 19):
        column = np.column_stack([np.ones_like(angle), (angle - vertex) ** 2])
        level, curvature = np.linalg.lstsq(column, steps, rcond=None)[0]
        parabola = np.array([level + curvature * vertex**2, -2.0 * curvature * vertex, curvature])
        assert error(best) <= error(parabola) + 1e-4


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
