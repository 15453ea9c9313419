"""Variants: every change is a key of the scene, every one has its reason, and a weight counts per second or slice."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import dreba
import lgp
import lgp.cli
from lgp.experiments.report import render
from lgp.experiments.runs import PATH_COLUMNS, empty
from lgp.experiments.summary import summarise
from lgp.experiments.variants import setting, variants
from lgp.experiments.variations import values_of_weight
from lgp.experiments.weight_figure import weight_figure
from lgp.path.costs import Weights
from tests.support.invoke import invoke
from tests.support.paths import ROOT
from tests.support.says import says
from tests.support.screwdriver_runs import made


@pytest.mark.parametrize("name", variants())
def test_a_variant_is_the_scene_with_reasons_for_each_change(name: str) -> None:
    chosen = variants()[name]
    scene = chosen.scene("screwdriver")
    assert dreba.load(scene.cost.model).joints_
    given = {key for one in chosen.assumptions for key in one.keys}
    assert set(chosen.changes) - {"initial"} <= given
    assert all(one.reason for one in chosen.assumptions)


def test_the_page_names_the_free_choices_that_the_variant_leaves() -> None:
    scene = lgp.load_scene("screwdriver")
    runs, _ = made("rest")
    summary = summarise(runs, empty(PATH_COLUMNS))
    page = render(summary, runs, empty(PATH_COLUMNS), scene, {"figure_5": ""}, variant=variants()["ours"])
    open_keys = [one.keys for one in variants()["ours"].left_open(scene)]
    assert ("robots.baxter.position",) in open_keys
    assert ("phase_seconds",) not in open_keys
    own = next(one.reason for one in scene.choices if one.keys == ("phase_seconds",))
    assert own not in page  # of the 2 s of the scene, which the variant replaces
    assert own in render(summary, runs, empty(PATH_COLUMNS), scene, {"figure_5": ""})


def test_options_go_before_the_variant() -> None:
    _, scene = setting("ours", "screwdriver", "soft", 3.0, 1.5)
    assert (scene.cost.model, scene.cost.weight, scene.cost.per, scene.phase_seconds) == ("soft", 3.0, "second", 1.5)


def test_a_weight_per_slice_counts_all_slices() -> None:
    scene = lgp.load_scene("screwdriver", {"cost.weight": 1.0, "cost.per": "slice", "phase_seconds": 5.0})
    assert Weights.of(scene, 20).ergonomics == pytest.approx(4.0)
    assert Weights.of(scene).ergonomics == pytest.approx(scene.slices / 5.0)
    assert Weights.of(lgp.load_scene("screwdriver")) == Weights()


@pytest.mark.parametrize(
    ("changes", "facts"),
    [
        ({"cost.weight": -1.0}, ("cost", "weight", "-1")),
        ({"cost.per": "minute"}, ("per", "minute", "second")),
        ({"cost.wait": 1.0}, ("cost", "wait")),
    ],
)
def test_a_wrong_cost_is_named(changes: dict[str, object], facts: tuple[str, ...]) -> None:
    with pytest.raises(lgp.LgpError) as error:
        lgp.load_scene("screwdriver", changes)
    says(error, *facts)


def test_the_page_shows_the_variant_and_the_sweep_of_the_weight() -> None:
    runs, _ = made("rest")
    scene = lgp.load_scene("screwdriver")
    rows = [
        {"choice": choice, "setting": setting, "condition": "ergonomic", "left": left, "center": 100.0 - left,
         "right": 0.0, "n": 20, "of": 20, "remark": ""}
        for choice, setting, left in [
            ("as it is", "", 70.0), ("weight of the ergonomic cost", "x 10", 40.0),
            ("weight of the ergonomic cost", "x 0.1", 90.0), ("phase [s]", "5.0", 60.0),
        ]
    ]  # fmt: skip
    summary = summarise(runs, empty(PATH_COLUMNS)) | {"sensitivity": rows}
    page = render(summary, runs, empty(PATH_COLUMNS), scene, {"figure_5": ""}, variant=variants()["ours"])
    assert variants()["ours"].assumptions[0].reason.split(".")[0] in " ".join(page.split())
    figure = weight_figure(rows, values_of_weight(scene))
    assert figure in page
    curves = re.findall(r'<polyline points="([^"]+)"', figure)
    assert len(curves) == 3
    left = np.array([pair.split(",") for pair in curves[0].split()], float)
    assert (np.diff(left[:, 0]) > 0).all()
    assert (np.diff(left[:, 1]) > 0).all()  # downwards on the page: the share falls with the weight
    assert weight_figure(rows[:1], values_of_weight(scene)) == ""


@pytest.mark.parametrize(
    ("experiment", "scene", "variant", "facts"),
    [
        (lgp.experiment_screwdriver, "toolbox", "paper", ("toolbox", "no table.left", "table.right", "screwdriver")),
        (lgp.experiment_toolbox, "screwdriver", "ours", ("screwdriver", "no toolbox/handle", "toolbox/side.left")),
        (lgp.experiment_toolbox, None, "paper-left", ("toolbox", "no screwdriver", "paper-left", "another variant")),
    ],
)
def test_a_scene_has_what_the_experiment_is_about(
    tmp_path: Path, experiment: Callable[..., object], scene: str | None, variant: str, facts: tuple[str, ...]
) -> None:
    pytest.importorskip("statsmodels")
    with pytest.raises(lgp.LgpError) as error:
        experiment(tmp_path / "out", scene=scene, variant=variant)
    says(error, *facts)
    assert not (tmp_path / "out").exists()


def test_the_toolbox_says_that_it_draws_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lgp.cli, "_toolbox", lambda *_: None)
    result = invoke(lgp.cli.cli, ["experiment", "toolbox", "--runs", "3", "--initial", "random", "-o", str(tmp_path)])
    assert result.exit_code == 0
    assert [line.split(" is ")[0] for line in result.stderr.splitlines()] == ["note: --runs", "note: --initial"]


@pytest.mark.parametrize(("scene", "people"), [("two_people", "anna, bert"), ("restock", "none")])
def test_an_experiment_is_about_one_person(scene: str, people: str) -> None:
    with pytest.raises(lgp.LgpError) as error:
        setting("paper", ROOT / "examples" / "scenes" / f"{scene}.toml", None, None, None)
    says(error, scene, f"persons are {people}", "expected one, the [human]", "give a scene")
