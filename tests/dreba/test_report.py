"""The report of a model: its figures and sections."""

from __future__ import annotations

import pytest

import dreba
from dreba.report import render


@pytest.fixture(scope="module")
def model() -> dreba.QuadraticModel:
    fitted = dreba.QuadraticModel()
    dreba.fit_to(fitted, dreba.sample(1000, rng=1), dreba.sample(1000, rng=2), command="dreba fit")
    return fitted


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
