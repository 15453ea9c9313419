"""Shipped models and model files by path."""

from __future__ import annotations

from pathlib import Path

import pytest

import dreba
from dreba.surrogates.library import SHIPPED
from tests.support.paths import ROOT
from tests.support.says import says


@pytest.mark.parametrize("content", ["", "{", "[]", "3", '{"format": NaN}', "[" * 100_000, "\x00\xff"])
def test_damaged_files_are_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "model.json"
    path.write_text(content, encoding="latin-1")
    with pytest.raises(dreba.ModelError):
        dreba.load(path)


def test_unfitted_models_and_missing_files() -> None:
    with pytest.raises(dreba.ModelError) as error:
        dreba.QuadraticModel().save("never.json")
    says(error, "not fitted", "fit")
    with pytest.raises(dreba.ModelError) as error:
        dreba.load("no such file.json")
    says(error, "cannot be read", "quadratic")


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


@pytest.mark.parametrize("name", dreba.models())
def test_a_shipped_file_says_all_that_a_model_file_says_now(name: str, tmp_path: Path) -> None:
    found = dreba.load(name)
    found.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (SHIPPED / f"{name}.json").read_bytes()
    told = found.about_.provenance
    assert told["rmse_on"] == "held-out poses"
    assert {"command", "held_out", "version"} <= set(told)
    assert "train" in told or "source" in told
