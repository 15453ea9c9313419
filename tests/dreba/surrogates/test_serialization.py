"""Model files: provenance, strict reading, damaged files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import dreba
from tests.support.says import says


@pytest.fixture(scope="module")
def model() -> dreba.QuadraticModel:
    fitted = dreba.QuadraticModel()
    dreba.fit_to(fitted, dreba.sample(1000, rng=1), dreba.sample(1000, rng=2), command="dreba fit")
    return fitted


def test_a_model_remembers_where_it_comes_from(model: dreba.QuadraticModel, tmp_path: Path) -> None:
    model.save(tmp_path / "model.json")
    about = dreba.load(tmp_path / "model.json").about_
    assert about.domain["name"] == "human"
    assert set(about.rmse) == {str(score) for score in range(1, 11)}
    assert about.provenance["train"]["seed"] == 1
    assert about.provenance["held_out"]["seed"] == 2
    assert about.provenance["command"] == "dreba fit"


@pytest.mark.parametrize(
    ("change", "fact"),
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
    model: dreba.QuadraticModel, tmp_path: Path, change: dict, fact: str
) -> None:
    path = tmp_path / "model.json"
    model.save(path)
    data = json.loads(path.read_text())
    path.write_text(json.dumps({**data, **change}))
    with pytest.raises(dreba.ModelError) as error:
        dreba.load(path)
    says(error, path, fact)


def test_every_cut_of_a_file_is_refused(model: dreba.QuadraticModel, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    model.save(path)
    text = path.read_text().rstrip()
    for end in range(0, len(text), max(len(text) // 60, 1)):
        path.write_text(text[:end])
        with pytest.raises(dreba.ModelError):
            dreba.load(path)


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
