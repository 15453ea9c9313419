"""The model of an experiment is what its file was at the start, and resuming with another one is refused."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

import dreba
from lgp.errors import LgpError
from lgp.experiments.cost_model import cost_model
from lgp.experiments.runs import RunStore
from lgp.experiments.screwdriver_experiment import experiment_screwdriver
from lgp.experiments.variants import setting, settings_of
from tests.support.says import says


def saved(path: Path, kind: str) -> Path:
    dreba.load(kind).save(path)
    return path


def test_a_model_stays_what_its_file_was(tmp_path: Path) -> None:
    file = saved(tmp_path / "own.json", "quadratic")
    read = cost_model(str(file))
    saved(file, "convex")
    sent = pickle.loads(pickle.dumps(read))
    assert (sent, hash(sent)) == (read, hash(read))
    assert sent.model().kind == "quadratic"
    assert cost_model(read) is read
    assert cost_model(file).settings()["cost_hash"] != read.settings()["cost_hash"]
    assert cost_model("convex").settings() == {"cost": "convex"}


def test_runs_of_another_model_under_the_same_name_are_not_continued(tmp_path: Path) -> None:
    pytest.importorskip("statsmodels")
    file, folder = saved(tmp_path / "own.json", "quadratic"), tmp_path / "results"
    chosen, scene = setting("ours", "screwdriver", file, None, None)
    settings = settings_of("screwdriver", chosen, scene, chosen.collisions)
    RunStore(folder, {**settings, **cost_model(str(file)).settings(), "seed": 0, "depth": 4})
    saved(file, "convex")
    with pytest.raises(LgpError) as error:
        experiment_screwdriver(folder, variant="ours", runs=1, cost=str(file))
    says(error, folder, "cost_hash", "another folder")
