"""Errors per class, model files, reports and provenance."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import spearmanr

import dreba
from dreba.report import render
from dreba.surrogates.metrics import PUBLISHED, distance_to_published, evaluation_of
from tests.support.paths import ROOT


@pytest.fixture(scope="module")
def model() -> dreba.QuadraticModel:
    found = dreba.QuadraticModel()
    dreba.fit_to(found, dreba.sample(1000, rng=1), dreba.sample(1000, rng=2), command="dreba fit")
    return found


def test_figures_are_what_their_names_say() -> None:
    scores = np.array([1, 1, 2, 3, 3, 3])
    values = np.array([1.2, 0.4, 2.6, 2.0, 3.1, 3.4])
    found = evaluation_of("any", values, scores)
    assert found.classes[1].n == 2
    assert found.classes[1].rmse == pytest.approx(np.sqrt((0.2**2 + 0.6**2) / 2))
    assert found.classes[1].bias == pytest.approx(-0.2)
    assert found.classes[3].bias == pytest.approx((-1.0 + 0.1 + 0.4) / 3)
    assert found.rmse == pytest.approx(np.sqrt(np.mean((values - scores) ** 2)))
    assert found.rounded_accuracy == pytest.approx(4 / 6)
    assert found.spearman == pytest.approx(spearmanr(values, scores).statistic)
    assert found.to_dict()["overall"]["n"] == 6


def test_a_constant_model_has_no_rank_correlation() -> None:
    found = evaluation_of("any", np.ones(5), np.arange(1, 6))
    assert np.isnan(found.spearman)
    json.dumps(found.to_dict(), allow_nan=False)


def test_distance_to_the_published_row() -> None:
    scores = np.repeat(list(PUBLISHED), 2)
    errors = np.repeat(list(PUBLISHED.values()), 2) * np.tile([1, -1], 10)
    assert distance_to_published(evaluation_of("any", scores + errors, scores)) == pytest.approx(0.0)
    with pytest.raises(dreba.ModelError, match="REBA 1"):
        distance_to_published(evaluation_of("any", np.ones(2), np.array([2, 3])))


def test_nothing_to_evaluate_is_refused() -> None:
    with pytest.raises(dreba.ModelError, match="at least one"):
        evaluation_of("any", np.zeros(0), np.zeros(0))
    with pytest.raises(dreba.ModelError, match="not finite"):
        evaluation_of("any", np.array([np.inf]), np.ones(1))


def test_a_model_remembers_where_it_comes_from(model: dreba.QuadraticModel, tmp_path: Path) -> None:
    model.save(tmp_path / "model.json")
    about = dreba.load(tmp_path / "model.json").about_
    assert about.domain["name"] == "human"
    assert set(about.rmse) == {str(score) for score in range(1, 11)}
    assert about.provenance["train"]["seed"] == 1
    assert about.provenance["held_out"]["seed"] == 2
    assert about.provenance["command"] == "dreba fit"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"version": 2}, "update dreba"),
        ({"version": 0}, "expected 1"),
        ({"format": "other"}, "not a model file"),
        ({"kind": "quadratc"}, "did you mean 'quadratic'"),
        ({"surprise": 1}, "unknown key 'surprise'"),
        ({"rmse": None}, "damaged"),
        ({"joints": {"names": ["a"], "unit": "rad"}}, "damaged"),
        ({"joints": {"names": ["a"], "unit": "deg"}}, "do not fit"),
        ({"payload": {}}, "payload"),
    ],
)
def test_wrong_files_are_refused_in_one_line(
    model: dreba.QuadraticModel, tmp_path: Path, change: dict, words: str
) -> None:
    path = tmp_path / "model.json"
    model.save(path)
    data = json.loads(path.read_text())
    path.write_text(json.dumps({**data, **change}))
    with pytest.raises(dreba.ModelError) as caught:
        dreba.load(path)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", ["", "{", "[]", "3", '{"format": NaN}', "[" * 100_000, "\x00\xff"])
def test_damaged_files_are_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "model.json"
    path.write_text(content, encoding="latin-1")
    with pytest.raises(dreba.ModelError):
        dreba.load(path)


def test_every_cut_of_a_file_is_refused(model: dreba.QuadraticModel, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    model.save(path)
    text = path.read_text().rstrip()
    for end in range(0, len(text), max(len(text) // 60, 1)):
        path.write_text(text[:end])
        with pytest.raises(dreba.ModelError):
            dreba.load(path)


def test_unfitted_models_and_missing_files() -> None:
    with pytest.raises(dreba.ModelError, match="not fitted"):
        dreba.QuadraticModel().save("never.json")
    with pytest.raises(dreba.ModelError, match="cannot be read as a model"):
        dreba.load("no such file.json")


@pytest.mark.parametrize("name", dreba.models())
def test_shipped_models_load_and_hold_their_stated_error(name: str) -> None:
    found = dreba.load(name)
    domain = found.about_.domain["name"]
    held_out = dreba.sample(4000, domain=domain, rng=(0, 9))
    errors = dreba.evaluate(found, held_out).classes
    for score, rmse in found.about_.rmse.items():
        assert errors[int(score)].rmse == pytest.approx(rmse, abs=0.15)
    command, *rest = found.about_.provenance["command"].split()
    made_by_script = command == "python" and (ROOT / rest[0]).is_file()
    assert made_by_script or (command == "dreba" and rest[0] == "fit")


def test_report_holds_its_figures(model: dreba.QuadraticModel) -> None:
    poses = dreba.sample(500, rng=3)
    html = render(model, poses, name="<mine>", command="dreba fit")
    assert "&lt;mine&gt;" in html
    assert "<mine>" not in html
    assert f"{dreba.evaluate(model, poses).classes[4].rmse:.2f}" in html
    for part in ("errors", "values", "polynomials", "weights", "sweeps"):
        assert f'id="{part}"' in html
    assert "https://" not in html.split("<script>")[0]
    free = dreba.QuadraticModel(free=True).fit(poses.angles, poses.reba)
    assert 'id="polynomials"' not in render(free, poses)


def test_a_domain_record_is_saved_by_its_name(tmp_path: Path) -> None:
    domain = dreba.domain_of("human").hold(trunk_twist=0.0)
    poses = dreba.sample(500, range(1, 9), domain=domain, rng=1)
    found = dreba.QuadraticModel(domain=domain)
    dreba.fit_to(found, poses, poses)
    found.save(tmp_path / "model.json")
    again = dreba.load(tmp_path / "model.json")
    assert again.get_params()["domain"] == "human"
    assert again.about_.domain["limits"]["trunk_twist"] == [0.0, 0.0]
    assert np.array_equal(again.predict(poses.angles), found.predict(poses.angles))


def test_radians_are_warned_about(model: dreba.QuadraticModel) -> None:
    poses = dreba.sample(50, rng=3)
    with pytest.warns(dreba.RadiansWarning, match="degrees"):
        dreba.evaluate(model, dreba.Poses(np.radians(poses.angles), poses.reba))
