"""Wrong arguments of classes and functions end in one line of the package's own, never in an error from inside."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dreba
import reba
from tests.support.says import says

POSES = dreba.sample(60, rng=1)
WRONG: tuple[Any, ...] = (
    None, 3, -1, 2.5, "x", [], [1], {}, {"a": 1}, object(), np.zeros(3), np.array(["a"]), True, float("nan"), (1, 2, 3),
    b"x", 10**400, np.zeros(()), np.zeros((0, 22)), range(2), POSES,
)  # fmt: skip
QUICK = {"soft": {"updates": 1}, "graduated": {"updates": 1}, "net": {"epochs": 1}}
DOMAIN = {"name": "own", "limits": {"trunk_flexion": (0, 90)}}
HUMAN = dreba.domain_of("human")
SOFT, CONVEX = dreba.load("soft"), dreba.load("convex")


def calls() -> dict[str, Callable[[Any], Any]]:
    """Return calls of one wrong argument each, by what is wrong."""
    found: dict[str, Callable[[Any], Any]] = {}
    for kind, of in dreba.KINDS.items():
        quick = QUICK.get(kind, {})
        for name in of().get_params(deep=False):
            found[f"{kind} {name}"] = lambda w, of=of, name=name, quick=quick: of(**{**quick, name: w}).fit(
                POSES, POSES.reba
            )
        found[f"{kind} X"] = lambda w, of=of, quick=quick: of(**quick).fit(w, POSES.reba)
        found[f"{kind} y"] = lambda w, of=of, quick=quick: of(**quick).fit(POSES, w)
        found[f"{kind} sample_weight"] = lambda w, of=of, quick=quick: of(**quick).fit(POSES, POSES.reba, w)
        found[f"{kind} factors"] = lambda w, of=of, quick=quick: of(**quick).fit(POSES, POSES.reba, factors=w)
    for name in ("value", "gradient", "hessian", "gauss_newton", "predict", "value_and_gradient", "tables"):
        found[f"soft.{name}"] = getattr(SOFT, name)
    for name in ("load", "coupling", "activity", "temperature", "coupling_left", "static"):
        found[f"value {name}"] = lambda w, name=name: SOFT.value(POSES.angles, **{name: w})
    found["score X"], found["score y"] = lambda w: CONVEX.score(w, POSES.reba), lambda w: CONVEX.score(POSES, w)
    found["score sample_weight"] = lambda w: CONVEX.score(POSES, POSES.reba, w)
    found["Stage.objective"] = lambda w: dreba.load("graduated").stages_[0].objective()(w)
    found["Domain.load_file"] = dreba.Domain.load_file
    found["GraduatedModel.of first"] = lambda w: dreba.GraduatedModel.of(w, SOFT)
    found["GraduatedModel.of soft"] = lambda w: dreba.GraduatedModel.of(CONVEX, w)
    for name in ("name", "limits", "rules", "bins", "sides", "load"):
        found[f"Domain {name}"] = lambda w, name=name: dreba.sample(
            20, [1, 2], domain=dreba.Domain(**{**DOMAIN, name: w}), rng=1
        )
    found["Domain.hold"] = lambda w: HUMAN.hold(trunk_flexion=w)
    found["Domain.only"], found["Domain.bins_of"] = HUMAN.only, HUMAN.bins_of
    found["Domain.from_dict"], found["domain_of"] = dreba.Domain.from_dict, dreba.domain_of
    for name in ("n", "classes", "domain", "rng", "weights", "stratified", "factors", "adjustments", "arms"):
        found[f"sample {name}"] = lambda w, name=name: dreba.sample(**{"n": 20, "classes": [2, 3], "rng": 1, name: w})
    for name in ("angles", "reba"):
        found[f"Poses {name}"] = lambda w, name=name: dreba.Poses(
            **{"angles": POSES.angles, "reba": POSES.reba, name: w}
        )
    found["Poses.rows"] = POSES.rows
    found["Poses.split share"] = lambda w: POSES.split(w, np.random.default_rng(0))
    found["Poses.split rng"] = lambda w: POSES.split(0.2, w)
    found["evaluate temperature"] = lambda w: dreba.evaluate(SOFT, POSES, w)
    found["fit_to sample_weight"] = lambda w: dreba.fit_to(dreba.QuadraticModel(), POSES, POSES, w)
    for name in ("to", "temperature", "first", "name", "joint_map", "hessian"):
        found[f"export_model {name}"] = lambda w, name=name: dreba.export_model(CONVEX, "cost", **{"to": "c", name: w})
    for name in ("rules", "joints", "hold"):
        found[f"read_poses {name}"] = lambda w, name=name: dreba.read_poses("poses.parquet", **{name: w})
    return found


CALLS = calls()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_argument_is_answered_in_one_line(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    POSES.save("poses.parquet")
    for wrong in WRONG:
        text = "accepted: some of these values are right for some arguments"
        try:
            CALLS[name](wrong)  # any other error fails the test
        except reba.RebaError as error:
            text = str(error)
        says(text)  # one line
        assert text
