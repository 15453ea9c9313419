"""The contract every registered kind of surrogate keeps; adding a kind to the registry adds it here."""

from __future__ import annotations

import json
import re
import warnings
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.utils.estimator_checks import check_estimator

import dreba
import reba
from dreba.surrogates.serialization import from_dict, to_dict
from reba.posture.columns import COLUMNS, INDEX
from tests.support.says import says

KINDS = sorted(dreba.KINDS)
QUICK = {"net": {"epochs": 3}, "graduated": {"updates": 200}}
"""Parameters that make a kind without a shipped model quick to fit; how good it is does not matter here."""


@cache
def poses() -> dreba.Poses:
    return dreba.sample(1500, rng=11)


@cache
def fitted(kind: str) -> dreba.Surrogate:
    """The shipped model of a kind, or a quick fit."""
    if kind in dreba.models():
        return dreba.load(kind)
    loaded = dreba.sample(1500, range(1, 16), factors=["load", "coupling", "activity"], rng=11)
    return dreba.KINDS[kind](**QUICK.get(kind, {})).fit(loaded, loaded.reba, factors=loaded.factors)


@cache
def some(n: int) -> np.ndarray:
    return dreba.sample(max(n, 10), rng=12).angles[:n]


def temperatures(model: dreba.Surrogate) -> tuple[float | None, ...]:
    return (None, *model.temperatures_)


def mirrored(angles: np.ndarray) -> np.ndarray:
    """Left and right exchanged, side bends and twists of the midline negated."""
    swap = {"left": "right", "right": "left"}
    other = [INDEX[re.sub("(left|right)$", lambda side: swap[side[0]], column)] for column in COLUMNS]
    signs = [-1.0 if c.startswith(("trunk", "neck")) and not c.endswith("flexion") else 1.0 for c in COLUMNS]
    return angles[:, other] * signs


@pytest.mark.parametrize("kind", KINDS)
def test_gradient_and_hessian_agree_with_finite_differences(kind: str) -> None:
    model = fitted(kind)
    extras = {"load": 6.0, "coupling": (1, 2), "activity": 1}
    step = 1e-4
    for temperature in temperatures(model):
        for pose in some(6):
            moved = np.stack([pose + step * axis for axis in (*np.eye(22), *-np.eye(22))])
            values = model.value(moved, temperature=temperature, **extras)
            slope = (values[:22] - values[22:]) / (2 * step)
            assert model.gradient(pose, temperature=temperature, **extras) == pytest.approx(slope, abs=2e-6)
            slopes = model.gradient(moved, temperature=temperature, **extras)
            bend = (slopes[:22] - slopes[22:]) / (2 * step)
            assert model.hessian(pose, temperature=temperature, **extras) == pytest.approx(bend, abs=2e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_single_poses_batches_and_predict_agree(kind: str) -> None:
    model = fitted(kind)
    angles = some(20)
    values, gradients = model.value_and_gradient(angles)
    assert values.shape == (20,)
    assert gradients.shape == (20, 22)
    assert model.hessian(angles).shape == (20, 22, 22)
    assert model.predict(angles) == pytest.approx(values, abs=1e-9)
    assert model.gradient(angles) == pytest.approx(gradients, abs=1e-12)
    assert isinstance(model.value(angles[3]), float)
    assert model.value(angles[3]) == pytest.approx(values[3], abs=1e-9)
    assert model.gradient(angles[3]) == pytest.approx(gradients[3], abs=1e-12)
    assert model.hessian(angles[3]).shape == (22, 22)


@pytest.mark.parametrize("kind", KINDS)
def test_factors_may_differ_between_poses(kind: str) -> None:
    model = fitted(kind)
    drawn = dreba.sample(15, range(1, 16), factors=["load", "coupling", "activity"], rng=3)
    together = model.value(drawn.angles, **drawn.task_factors._asdict())
    for row in range(15):
        alone = model.value(drawn.angles[row], **drawn.task_factors.rows(row)._asdict())
        assert alone == pytest.approx(together[row], abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_gauss_newton_factor_is_positive_or_refused(kind: str) -> None:
    model = fitted(kind)
    try:
        factor = model.gauss_newton(some(2)[0])
    except dreba.ModelError as error:
        says(error, repr(kind), "Gauss-Newton", "hessian()")
        return
    assert factor.shape[1] == 22
    if model.convex and not model.temperatures_:
        assert factor.T @ factor == pytest.approx(model.hessian(some(2)[0]), abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_file_reads_back_equal(kind: str, tmp_path: Path) -> None:
    model = fitted(kind)
    path = tmp_path / "model.json"
    model.save(path)
    again = dreba.load(path)
    assert type(again) is type(model)
    assert again.joints_ == model.joints_
    assert again.temperatures_ == model.temperatures_
    for temperature in temperatures(model):
        assert np.array_equal(
            again.value(some(20), temperature=temperature), model.value(some(20), temperature=temperature)
        )
    assert to_dict(again) == to_dict(model)


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_content_is_refused(kind: str) -> None:
    data = json.loads(json.dumps(to_dict(fitted(kind))))
    for name in data["parameters"]["learned"]:
        broken = json.loads(json.dumps(data))
        del broken["parameters"]["learned"][name]
        with pytest.raises(dreba.ModelError):
            from_dict(broken)
    data["parameters"]["learned"]["surprise_"] = 1.0
    with pytest.raises(dreba.ModelError):
        from_dict(data)


@pytest.mark.parametrize("kind", KINDS)
def test_left_and_right_are_alike(kind: str) -> None:
    model = fitted(kind)
    if not model.mirror:
        pytest.skip(f"{kind} does not claim it")
    angles = some(50)
    for temperature in temperatures(model):
        straight = model.value(angles, coupling=(1, 3), temperature=temperature)
        turned = model.value(mirrored(angles), coupling=(3, 1), temperature=temperature)
        assert turned == pytest.approx(straight, abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_convex_where_claimed(kind: str) -> None:
    model = fitted(kind)
    if not model.convex:
        pytest.skip(f"{kind} does not claim it")
    a, b = some(200)[:100], some(200)[100:]
    share = np.linspace(0.05, 0.95, 100)[:, None]
    between = model.value(share * a + (1 - share) * b)
    assert (between <= share[:, 0] * model.value(a) + (1 - share[:, 0]) * model.value(b) + 1e-9).all()
    assert np.linalg.eigvalsh(model.hessian(a)).min() >= -1e-9


def test_a_claim_belongs_to_a_model_and_not_to_its_kind() -> None:
    assert dreba.QuadraticModel().convex
    assert not dreba.QuadraticModel(curvature="any").convex
    assert fitted("quadratic").convex
    for free in (False, True):
        model = dreba.QuadraticModel(curvature="any", free=free).fit(poses().angles, poses().reba)
        assert model.convex == (np.linalg.eigvalsh(model.hessian(np.zeros(22))).min() >= 0)
    assert not model.convex


@pytest.mark.parametrize("kind", KINDS)
def test_monotone_where_claimed(kind: str) -> None:
    model = fitted(kind)
    if not model.monotone:
        pytest.skip(f"{kind} does not claim it")
    domain = dreba.domain_of("human")
    sharpest = min(model.temperatures_, default=None)
    for column in COLUMNS:
        edges, points = domain.bins_of(column)
        middles = (np.array(edges[:-1]) + edges[1:]) / 2
        values = []
        for middle in middles:
            angles = some(20).copy()
            angles[:, INDEX[column]] = middle
            values.append(model.value(angles, temperature=sharpest))
        for i, j in pairwise(np.argsort(points, kind="stable")):
            if points[i] < points[j]:
                assert (values[i] <= values[j] + 0.05).all(), column


@pytest.mark.parametrize("kind", KINDS)
def test_bad_input_is_refused_in_one_line(kind: str) -> None:
    model = fitted(kind)
    with pytest.raises(dreba.ModelError) as error:
        model.value(np.zeros((3, 5)))
    says(error, "expected")
    with pytest.raises(dreba.ModelError) as error:
        clone(model).fit(np.full((10, 22), np.nan), np.ones(10))
    says(error, "NaN")
    with pytest.raises(dreba.ModelError) as error:
        clone(model).fit(poses().angles, poses().reba, sample_weight=np.ones(3))
    says(error, "sample_weight", "(3,)")
    with pytest.raises(dreba.ModelError) as error:
        clone(model).fit(poses().angles, poses().reba, factors=reba.Factors(support="unilateral"))
    says(error, "support", "leave such poses out")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("factors", "name"),
    [
        ({"load": -1.0}, "load"),
        ({"load": [1.0, 2.0, 3.0]}, "load"),
        ({"load": "heavy"}, "load"),
        ({"coupling": 4}, "coupling"),
        ({"coupling": (0, 9)}, "coupling"),
        ({"coupling": ("fair", "firm")}, "coupling"),
        ({"coupling": [1, 2, 3]}, "coupling"),
        ({"coupling_left": "firm"}, "coupling"),
        ({"coupling": None}, "coupling"),
        ({"coupling": [[0, 1, 2]]}, "coupling"),
        ({"activity": "running"}, "activity"),
        ({"activity": None}, "activity"),
        ({"static": "perhaps"}, "static"),
        ({"activity": 1, "static": True}, "activity"),
        ({"load": None}, "load"),
        ({"activity": np.nan}, "activity"),
        ({"activity": [1, 2, 3]}, "activity"),
        ({"temperature": "warm"}, "temperature"),
    ],
)
def test_wrong_factors_are_refused_by_every_kind(kind: str, factors: dict[str, object], name: str) -> None:
    for method in (fitted(kind).value, fitted(kind).gradient, fitted(kind).hessian):
        with pytest.raises(dreba.ModelError) as error:
            method(some(2), **factors)
        says(error, name, "expected")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("given", "points"),
    [
        ({"coupling": "poor"}, {"coupling": (2, 2)}),
        ({"coupling": ("fair", "unacceptable")}, {"coupling": (1, 3)}),
        ({"coupling": np.array(["fair", "good", "poor"])}, {"coupling": (np.array([1, 0, 2]), np.array([1, 0, 2]))}),
        ({"coupling": ["fair", "good", "poor"]}, {"coupling": (np.array([1, 0, 2]), np.array([1, 0, 2]))}),
        ({"coupling": np.array([[0, 1], [1, 2], [3, 0]])}, {"coupling": (np.array([0, 1, 3]), np.array([1, 2, 0]))}),
        ({"coupling_left": "poor"}, {"coupling": (2, 0)}),
        ({"coupling_right": pd.Series(["good", "fair", "poor"])}, {"coupling": (0, np.array([0, 1, 2]))}),
        ({"load": pd.Series([0.0, 6.0, 12.0])}, {"load": np.array([0.0, 6.0, 12.0])}),
        ({"activity": "static,repeated"}, {"activity": 2}),
        ({"activity": "none"}, {"activity": 0}),
        ({"static": True, "unstable": [False, True, True]}, {"activity": np.array([1, 2, 2])}),
    ],
)
def test_factors_are_taken_as_words_and_arrays(kind: str, given: dict[str, object], points: dict[str, object]) -> None:
    model = fitted(kind)
    assert model.value(some(3), **given) == pytest.approx(model.value(some(3), **points), abs=1e-12)


@pytest.mark.parametrize("name", dreba.models())
def test_shipped_models_rise_with_the_factors_about_as_exact_reba_does(name: str) -> None:
    model = dreba.load(name)
    balanced = dreba.sample(2000, rng=4)
    for given in ({"load": 12.0}, {"coupling": "poor"}, {"load": 15.0, "coupling": "unacceptable", "static": True}):
        exact = (reba.score_array(balanced.angles, given).reba.astype(float) - balanced.reba).mean()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", dreba.FactorWarning)
            rise = (model.value(balanced.angles, **given) - model.value(balanced.angles)).mean()
        known = {"coupling_left": "coupling", "static": "activity"}
        if {known.get(factor, factor) for factor in given} <= set(model.factors_):
            assert rise == pytest.approx(exact, rel=0.3)
        else:
            assert model.get_params()["payload_only"]


@pytest.mark.parametrize("kind", ["quadratic", "convex", "net"])
def test_a_factor_that_was_never_learned_warns_once_and_files_name_the_known_ones(kind: str, tmp_path: Path) -> None:
    model = dreba.KINDS[kind](**QUICK.get(kind, {})).fit(poses().angles, poses().reba)
    known = {"quadratic": ("load", "activity"), "convex": ("activity",), "net": ("activity",)}[kind]
    assert model.factors_ == known
    with pytest.warns(dreba.FactorWarning, match="coupling is given") as caught:
        value = model.value(some(3), coupling="poor")
    assert len(caught) == 1
    assert np.array_equal(value, model.value(some(3), coupling="poor"))
    assert np.array_equal(value, model.value(some(3)))
    model.gradient(some(3), coupling=np.array([0, 1, 2]))  # a second warning would be an error
    model.save(tmp_path / "model.json")
    assert json.loads((tmp_path / "model.json").read_text())["payload"]["known"] == list(known)
    assert dreba.load(tmp_path / "model.json").factors_ == known


def test_files_without_the_names_of_known_factors_are_read() -> None:
    data = json.loads(json.dumps(to_dict(fitted("quadratic"))))
    for key in ("known", "load"):
        del data["payload"][key]
    assert from_dict(data).factors_ == ("load", "coupling", "activity")


@pytest.mark.parametrize("kind", ["quadratic", "convex"])
def test_seated_poses_are_those_with_straight_knees(kind: str) -> None:
    factors = reba.Factors(support="sitting", unstable=True)
    seated = dreba.sample(1500, range(2, 11), factors=factors, rng=11)
    model = dreba.KINDS[kind]().fit(seated, seated.reba, factors=seated.factors)
    straight = seated.angles.copy()
    straight[:, [INDEX["knee_flexion_left"], INDEX["knee_flexion_right"]]] = 0.0
    again = dreba.KINDS[kind]().fit(straight, seated.reba, factors=reba.Factors(unstable=True))
    assert np.array_equal(model.value(some(20)), again.value(some(20)))
    assert (
        dreba.evaluate(model, seated).rmse
        == dreba.evaluate(model, dreba.Poses(straight, seated.reba, reba.Factors(unstable=True))).rmse
    )
    assert dreba.evaluate(model, seated).rmse < 2.0


@pytest.mark.parametrize("method", ["value", "gradient", "value_and_gradient", "hessian", "gauss_newton"])
def test_unknown_factors_are_refused_by_name(method: str) -> None:
    with pytest.raises(dreba.ModelError) as error:
        getattr(fitted("convex"), method)(some(2), laod=3.0)
    says(error, "'laod'", "did you mean 'load'", "load, coupling, activity, temperature")


@pytest.mark.parametrize("kind", KINDS)
def test_unmeasured_angles_are_refused_and_tables_are_read_by_name(kind: str) -> None:
    model = fitted(kind)
    gap = some(3).copy()
    gap[1, 4] = np.nan
    for method in (model.value, model.gradient, model.hessian):
        with pytest.raises(dreba.ModelError) as error:
            method(gap)
        says(error, "NaN")
        with pytest.raises(dreba.ModelError) as error:
            method([["a"] * 22])
        says(error, "number", "degrees")
    table = pd.DataFrame(some(5), columns=list(COLUMNS))[sorted(COLUMNS)]
    assert model.value(table) == pytest.approx(model.value(some(5)), abs=1e-12)
    with pytest.raises(dreba.ModelError) as error:
        model.value(table.drop(columns="neck_twist"))
    says(error, "neck_twist")


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        ("quadratic", {"omega_load": "heavy"}),
        ("quadratic", {"class_power": -1}),
        ("quadratic", {"free": "maybe"}),
        ("soft", {"ladder": "abc"}),
        ("soft", {"ladder": (1.0, 2.0)}),
        ("soft", {"seed": -1}),
        ("soft", {"updates": True}),
        ("convex", {"knots": True}),
        ("convex", {"width": None}),
        ("graduated", {"first": "net"}),
        ("graduated", {"ladder": ()}),
        ("graduated", {"temperature": "warm"}),
        ("graduated", {"updates": 0}),
        ("net", {"layers": (0,)}),
        ("net", {"epochs": 0}),
    ],
)
def test_wrong_parameters_are_refused_in_one_line(kind: str, parameters: dict[str, object]) -> None:
    ((name, value),) = parameters.items()
    with pytest.raises(dreba.ModelError) as error:
        dreba.KINDS[kind](**parameters).fit(poses().angles, poses().reba)
    says(error, f"{name} is {value!r}", "expected")


@pytest.mark.parametrize("kind", KINDS)
def test_files_with_wrong_joints_or_numbers_are_refused(kind: str, tmp_path: Path) -> None:
    data = to_dict(fitted(kind))
    names = data["joints"]["names"]
    with pytest.raises(dreba.ModelError) as error:
        from_dict({**data, "joints": {"names": [names[0]] * 22, "unit": "deg"}})
    says(error, "twice", "damaged")
    with pytest.raises(dreba.ModelError) as error:
        from_dict({**data, "version": data["version"] + 1})
    says(error, "version", "update dreba")
    path = tmp_path / "long.json"
    path.write_text('{"format": "dreba-model", "version": ' + "9" * 5000 + "}")
    with pytest.raises(dreba.ModelError) as error:
        dreba.load(path)
    says(error, "damaged")


@pytest.mark.parametrize("kind", KINDS)
def test_files_with_wrong_parameters_are_refused(kind: str) -> None:
    data = json.loads(json.dumps(to_dict(fitted(kind))))
    options = data["parameters"]["options"]
    for change in ({"surprise": 1}, {"joints": ["trunk_flexion"]}, dict.fromkeys(dreba.KINDS[kind].allowed, "abc")):
        broken = {**data, "parameters": {**data["parameters"], "options": {**options, **change}}}
        with pytest.raises(dreba.ModelError) as error:
            from_dict(broken)
        says(error, next(iter(change)))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("angle", [1e9, -400.0, np.inf])
def test_angles_that_no_body_has_are_refused(kind: str, angle: float) -> None:
    model = fitted(kind)
    wrong = some(20).copy()
    wrong[7, 3] = angle
    facts = ("neck_flexion", "pose 7", "-360 to 360") if np.isfinite(angle) else ("infinity",)
    for method in (model.value, model.gradient, model.hessian, model.value_and_gradient, model.predict):
        with pytest.raises(dreba.ModelError) as error:
            method(wrong)
        says(error, *facts)
    with pytest.raises(dreba.ModelError) as error:
        clone(model).fit(wrong, np.ones(20))
    says(error, *facts)
    assert np.isfinite(model.value(np.full(22, 360.0)))


@pytest.mark.parametrize("kind", KINDS)
def test_radians_are_warned_about_everywhere(kind: str) -> None:
    model = fitted(kind)
    small = np.radians(some(20))
    for method in (model.value, model.predict, model.gradient, model.value_and_gradient, model.hessian):
        with pytest.warns(dreba.RadiansWarning, match="degrees") as caught:
            method(small)
        assert len(caught) == 1
    with pytest.warns(dreba.RadiansWarning) as caught:
        dreba.evaluate(model, dreba.Poses(small, np.ones(20, np.uint8)))
    assert len(caught) == 1
    model.value(small[0])  # one pose may well be at rest


@pytest.mark.parametrize("kind", ["quadratic", "convex"])
def test_a_plain_fit_keeps_its_error_per_class(kind: str) -> None:
    model = dreba.KINDS[kind]().fit(poses().angles, poses().reba)
    found = dreba.evaluate(model, poses())
    assert model.about_.rmse == {str(score): round(error.rmse, 4) for score, error in found.classes.items()}
    assert model.about_.provenance["rmse_on"] == "the poses of the fit"


CHECKED = {
    **{kind: dreba.KINDS[kind](**QUICK.get(kind, {})) for kind in KINDS},
    "quadratic, free": dreba.QuadraticModel(free=True),
    "quadratic, free, lowest": dreba.QuadraticModel(free=True, minimum="lowest"),
    "soft": dreba.SoftModel(updates=2),
    "graduated": dreba.GraduatedModel(updates=2),
}


@pytest.mark.parametrize("name", CHECKED)
@pytest.mark.filterwarnings("ignore")  # the checks warn about what they skip
def test_scikit_learn_estimator_checks(name: str) -> None:
    expected = CHECKED[name].expected_failed_checks
    found = check_estimator(CHECKED[name], expected_failed_checks=expected)
    assert {check["check_name"] for check in found if check["status"] == "xfail"} == set(expected)
    assert {check["check_name"] for check in found if check["status"] == "passed"} & set(expected) == set()
    assert (expected == {}) == ("free" in name)
    assert all(len(reason) > 20 for reason in expected.values())


@pytest.mark.parametrize("kind", KINDS)
def test_a_weight_of_zero_leaves_a_pose_out(kind: str) -> None:
    quick = {**QUICK, "soft": {"updates": 5}, "graduated": {"updates": 5}}.get(kind, {})
    loaded = dreba.sample(600, range(1, 16), factors=["load", "coupling", "activity"], rng=11)
    weights = np.ones(600)
    weights[::3] = 0.0
    far = loaded.angles.copy()
    far[::3] = np.sign(far[::3]) * 170.0  # far outside all others, where knots and scales would follow
    left = loaded.rows(weights > 0)
    model = dreba.KINDS[kind](**quick).fit(far, loaded.reba, sample_weight=weights, factors=loaded.factors)
    again = dreba.KINDS[kind](**quick).fit(left, left.reba, factors=left.factors)
    assert model.value(some(20), load=6.0) == pytest.approx(again.value(some(20), load=6.0), abs=1e-6)
