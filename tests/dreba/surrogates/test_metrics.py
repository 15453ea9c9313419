"""Error metrics: what their names say, Table I, wrong values."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.stats import spearmanr

import dreba
from dreba.surrogates.metrics import PUBLISHED, distance_to_published, evaluation_of
from tests.support.says import says


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
    with pytest.raises(dreba.ModelError) as error:
        distance_to_published(evaluation_of("any", np.ones(2), np.array([2, 3])))
    says(error, "REBA 1", "classes 1 to 10")


def test_nothing_to_evaluate_is_refused() -> None:
    with pytest.raises(dreba.ModelError) as error:
        evaluation_of("any", np.zeros(0), np.zeros(0))
    says(error, "at least one")
    with pytest.raises(dreba.ModelError) as error:
        evaluation_of("any", np.array([np.inf]), np.ones(1))
    says(error, "not finite", "angles")
