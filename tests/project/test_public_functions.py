"""Every public function: wrong types end in the package's own error, one line; names are documented and no room's."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import dreba
import lgp
import reba
from tests.support.paths import DATASETS, ROOT
from tests.support.says import says
from tests.support.wrong_values import refuses

PACKAGES = {"reba": reba, "dreba": dreba, "lgp": lgp}
MODEL = dreba.load("quadratic")
POSES = dreba.sample(300, rng=1)
SCORES = reba.score(pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 70.0]}))
POSTURES = SCORES.postures
RECORDING = DATASETS / "balancing_keypoints.trc"
READ = {
    "path": RECORDING,
    "profile": "auto",
    "start": None,
    "end": None,
    "topic": None,
    "body": None,
    "neutral": "none",
    "strict": False,
    "rate": None,
}
GOOD: dict[str, dict[str, Any]] = {
    "reba.angle_table": {"data": POSES.angles},
    "reba.camera_pictures": {"scores": SCORES, "look": "pixelated", "topic": ""},
    "reba.compare": {"a": SCORES, "b": SCORES},
    "reba.info": {"path": RECORDING},
    "reba.read": READ,
    "reba.read_blocks": {**READ, "seconds": 60.0},
    "reba.read_scores": {"path": "nowhere.parquet"},
    "reba.score": {"postures": POSTURES, "rules": "measured", "activity": "auto", "missing": "range", "error": None},
    "reba.score_array": {
        "angles": POSES.angles,
        "factors": None,
        "rules": "measured",
        "missing": "range",
        "error": None,
    },
    "reba.score_parts": {"trunk": 1, "neck": 1, "legs": 1, "upper_arm": 1, "lower_arm": 1, "wrist": 1},
    "reba.score_probabilities": {"angles": POSES.angles, "factors": None, "error": "optical", "missing": "neutral"},
    "reba.write_postures": {"postures": POSTURES, "path": "postures.parquet"},
    "reba.write_report": {"scores": SCORES, "path": "report.html"},
    "reba.write_scores": {"scores": SCORES, "path": "scores.parquet"},
    "dreba.compare": {"models": {"quadratic": MODEL}, "poses": POSES},
    "dreba.delta_payload": {"load": 3.0},
    "dreba.domain_of": {"which": "human"},
    "dreba.evaluate": {"model": MODEL, "poses": POSES},
    "dreba.export_model": {"model": MODEL, "path": "model.c", "to": "c"},
    "dreba.fit_to": {"model": dreba.QuadraticModel(), "train": POSES, "held_out": POSES},
    "dreba.load": {"path": "quadratic"},
    "dreba.models": {},
    "dreba.read_poses": {"path": RECORDING, "joints": "measured"},
    "dreba.sample": {"n": 50, "classes": (1, 2, 3), "rng": 1},
    "dreba.write_report": {"model": MODEL, "poses": POSES, "path": "model.html"},
    "lgp.audit_plan": {"plan": None},
    "lgp.experiment_all": {"folder": "all", "runs": -1, "seed": -1},
    "lgp.experiment_screwdriver": {"folder": "screwdriver", "cost": "nowhere.json", "runs": -1},
    "lgp.experiment_toolbox": {"folder": "toolbox", "cost": "nowhere.json", "weight": -1.0},
    "lgp.improve": {
        "scores": SCORES,
        "at": 7.0,
        "hands": "both",
        "stature": 1.75,
        "sex": "male",
        "cost": "convex",
        "heights": None,
        "distances": None,
        "step": 0.1,
    },
    "lgp.load_scene": {"which": "screwdriver"},
    "lgp.plan": {"scene": "screwdriver", "cost": None, "slices": -1, "depth": -1},
    "lgp.register_action": {"name": "stir", "kind": lgp.ActionKind(("hand", "object"))},
    "lgp.register_cost_term": {"name": "reach", "term": lambda at: at},
    "lgp.replan": {"plan": None, "now": 0.0, "poses": None, "joints": None, "cost": None},
    "lgp.run_plan": {"folder": "run", "seed": 0, "speed": 0.0},
    "lgp.run_study": {"logs": None},
    "lgp.shipped_scenes": {},
    "lgp.write_page": {"plan": None, "folder": "page"},
    "lgp.write_trajectories": {"plan": None, "path": "robots.mcap"},
}
"""Arguments of each function; those whose run takes long have two wrong values, so that one of them is always wrong."""
MANY = {"lgp.replan", "reba.read", "reba.score_array", "reba.score_parts", "dreba.fit_to"}
"""Functions with more positional arguments, as the contract has them."""
PATH_METHODS = {
    "Poses.load": dreba.Poses.load,
    "Poses.save": POSES.save,
    "Surrogate.save": MODEL.save,
    "Rules.load": reba.Rules.load,
    "Rules.save": reba.PRESETS["paper"].save,
    "Plan.load": lgp.Plan.load,
}
"""Methods that take a path alone."""


def functions() -> dict[str, Callable[..., Any]]:
    return {
        f"{package}.{name}": getattr(module, name)
        for package, module in PACKAGES.items()
        for name in module.__all__
        if inspect.isfunction(getattr(module, name))
    }


def test_the_list_is_complete() -> None:
    assert set(functions()) == set(GOOD)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # a path in the old place of the scores
@pytest.mark.parametrize("name", sorted(GOOD))
def test_wrong_types_end_in_one_line(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    function, good = functions()[name], GOOD[name]
    for argument in {**good, **inspect.signature(function).parameters}:
        refuses(
            f"{name}({argument}=)",
            lambda wrong, argument=argument: function(**{**good, argument: wrong}),
            (MODEL, POSES, SCORES, [SCORES]),
        )


@pytest.mark.parametrize("method", PATH_METHODS.values(), ids=PATH_METHODS)
def test_methods_refuse_what_is_no_path(method: Callable[[Any], Any], tmp_path: Path) -> None:
    for wrong in (None, 3, b"x", object(), [], np.zeros(3)):
        with pytest.raises(reba.RebaError) as error:
            method(wrong)
        says(error, "expected a path")


@pytest.mark.parametrize("name", sorted(GOOD))
def test_paths_come_second_and_options_by_keyword(name: str) -> None:
    kinds = inspect.signature(functions()[name]).parameters.values()
    positional = [each.name for each in kinds if each.kind is inspect.Parameter.POSITIONAL_OR_KEYWORD]
    if name.partition(".")[2].startswith(("write_", "export_")):
        assert positional[-1] in ("path", "folder"), "what is written comes first, then the path"
    assert positional == positional[:3] or name in MANY, "more than three arguments are given by keyword"


@pytest.mark.parametrize("package", sorted(PACKAGES))
def test_no_public_name_is_a_room(package: str) -> None:
    inside = (ROOT / package).iterdir()
    rooms = {path.stem for path in inside if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert set(PACKAGES[package].__all__) & (rooms - {"__init__"}) == set()


@pytest.mark.parametrize("package", sorted(PACKAGES))
def test_every_public_name_is_in_the_reference_with_a_docstring(package: str) -> None:
    module = PACKAGES[package]
    page = (ROOT / "docs" / f"api_{package}.md").read_text(encoding="utf-8")
    missing = [name for name in module.__all__ if name != "__version__" and f":: {name}\n" not in page]
    assert missing == []
    bare = [name for name in module.__all__ if callable(getattr(module, name)) and not getattr(module, name).__doc__]
    assert bare == []
