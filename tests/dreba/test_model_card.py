"""Cards of models: what they say is true, and the page of the shipped models is what the command writes."""

from __future__ import annotations

import json
import re
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dreba
import reba
from dreba.cli import main
from dreba.model_card import as_text, falling_columns, minimum_in, model_card, page, usefulness_table
from reba.posture.columns import COLUMNS, INDEX
from tests.support.paths import ROOT
from tests.support.says import says

NUMBER = r"-?\d+\.\d+|-?\d+"


@cache
def shipped(name: str) -> dict[str, Any]:
    return model_card(dreba.load(name), name)


@pytest.mark.parametrize("name", dreba.models())
def test_the_minimum_of_every_shipped_model_is_a_posture_of_the_lowest_score(name: str) -> None:
    card = shipped(name)
    assert card["minimum"]["reba"] == 1
    assert card["minimum"]["value"] <= card["minimum"]["value_at_rest"]
    assert card["unbounded"] == []
    if card["rmse"]["domain"] == "human":
        assert set(card["minimum"]["parts"].values()) == {1}
        assert card["minimum"]["reba_of_domain"] == 1


def test_busch2018_prefers_elbows_at_50_degrees_and_knows_the_load_only() -> None:
    card = shipped("busch2018")
    assert card["minimum"]["angles"]["lower_arm_flexion_left"] == pytest.approx(50.0, abs=0.1)
    assert card["minimum"]["parts"]["lower_arm_left"] == 2
    assert card["factors"] == ["load"]
    assert card["rise"]["15 kg"]["model"] == pytest.approx(3.0)
    text = as_text(card)
    for fact in (
        "buschbapti/handovers",
        "0d3ba79",
        "lower_arm_flexion 50",
        "Factors known: load.",
        "| Table I | 0.72 |",
    ):
        assert fact in text


@pytest.mark.parametrize("name", ["convex", "quadratic", "quadratic_free", "quadratic_paper"])
def test_the_rise_with_factors_is_near_that_of_exact_reba(name: str) -> None:
    for rise in shipped(name)["rise"].values():
        assert rise["model"] == pytest.approx(rise["exact"], abs=0.5)


def test_columns_without_a_lower_bound_are_named_with_their_direction() -> None:
    poses = dreba.sample(3000, rng=1)
    model = dreba.QuadraticModel(minimum="free").fit(poses, poses.reba)
    domain = dreba.domain_of("human")
    falling = falling_columns(model, minimum_in(model, domain), domain)
    assert "upper_arm_abduction_left below 0" in falling
    assert all(
        f"{column} below" in " ".join(falling) for column in COLUMNS if not model.twice_curvature_[INDEX[column]]
    )
    card = model_card(model, "free")
    assert card["minimum"]["parts"]["trunk"] > 1
    assert "upper_arm_abduction_left below 0" in as_text(card)


def test_sides_with_different_angles_are_named() -> None:
    card = {**shipped("quadratic")}
    angles = {"trunk_flexion": -4.0, "wrist_flexion_left": 3.4, "wrist_flexion_right": 2.6, "knee_flexion_right": 5.0}
    card["minimum"] = {
        **card["minimum"],
        "angles": {**angles, "upper_arm_flexion_left": -5.0, "upper_arm_flexion_right": -6.0},
    }
    text = as_text(card)
    assert "at trunk_flexion -4, knee_flexion_right 5, upper_arm_flexion_left -5, upper_arm_flexion_right -6, " in text
    assert " -6, wrist_flexion 3 degrees, else at rest" in text


def test_the_minimum_of_the_soft_tables_is_lower_than_any_drawn_pose() -> None:
    model = dreba.load("soft")
    lowest = model.value(minimum_in(model, dreba.domain_of("human")))
    assert lowest <= model.value(dreba.sample(2000, rng=1).angles).min() + 1e-9


def test_models_of_some_columns_have_cards_and_others_are_refused(tmp_path: Path) -> None:
    poses = dreba.sample(1000, rng=1)
    some = ("trunk_flexion", "neck_flexion")
    card = model_card(dreba.QuadraticModel(joints=some).fit(poses, poses.reba), "some")
    assert card["joints"] == 2
    assert "not measured, the reach tasks need all 22 columns" in as_text(card)
    card["rmse"] = {"classes": {"1": 0.5, "2": 0.6}, "overall": 0.55, "on": "", "domain": "own"}
    assert "| Table I | 0.72 | 0.91 | 0.82 |" in as_text(card)  # over the same classes
    assert card["command"] == ""
    foreign = dreba.QuadraticModel(free=True, joints=("a", "b")).fit(poses.angles[:, :2], poses.reba)
    with pytest.raises(dreba.ModelError) as error:
        model_card(foreign, "foreign")
    says(error, "'a'", "reba.COLUMNS")
    (tmp_path / "other.json").write_text("[]")
    with pytest.raises(dreba.ModelError) as error:
        usefulness_table(tmp_path / "other.json")
    says(error, "dreba compare --json")


ROW = {
    "start": "random", "reba": 1.5, "standard_error": 0.1, "difference": -0.25, "difference_standard_error": None,
    "certified": 1.25, "infeasible": 0.0125, "evaluations": 30.4,
}  # fmt: skip
TABLE = {
    "space": "bench", "tasks": 7, "solver": "SLSQP", "certified": {"tasks": 6, "proved": 1.25},
    "rows": [
        {**ROW, "name": "distance to rest", "model": ""},
        {**ROW, "name": "convex", "model": "convex"},
        {**ROW, "name": "convex, free start", "model": "convex"},
        {**ROW, "name": "convex_2", "model": "convex_2"},
    ],
}  # fmt: skip


def test_rows_of_usefulness_are_those_of_the_model_with_what_was_added(tmp_path: Path) -> None:
    (tmp_path / "compared.json").write_text(json.dumps({"enabler": TABLE}))
    table = usefulness_table(tmp_path / "compared.json")
    text = as_text(model_card(dreba.load("convex"), "convex", table))
    assert "| convex | random | 1.50 (0.10) | -0.25 | +0.25 | 1.2 % | 30 |" in text
    assert re.findall(r"^\| (convex[^|]*) \| random", text, re.M) == ["convex", "convex, free start"]
    assert "`dreba compare --tasks bench:7`" in text
    assert "certified for 6 tasks" in text
    other = as_text(model_card(dreba.load("quadratic"), "quadratic", table))
    assert "not in the table that was given; `dreba compare quadratic` measures it" in other


@pytest.mark.parametrize("key", ["space", "certified", "rows"])
def test_a_table_without_what_a_card_needs_is_refused(key: str, tmp_path: Path) -> None:
    tables = [{name: value for name, value in TABLE.items() if name != key}, {**TABLE, "rows": []}]
    tables.append({**TABLE, "rows": [{"name": "convex", "model": "convex"}]})
    for table in tables:
        (tmp_path / "compared.json").write_text(json.dumps({"enabler": table}))
        with pytest.raises(dreba.ModelError) as error:
            usefulness_table(tmp_path / "compared.json")
        says(error, "compared.json", "dreba compare --json")
    with pytest.raises(dreba.ModelError) as error:
        usefulness_table(tmp_path / "none.json")
    says(error, "none.json", "cannot be read", "dreba compare --json")


def test_every_card_of_the_page_has_rows_of_usefulness_or_the_reason_why_not() -> None:
    written = (ROOT / "docs" / "model_cards.md").read_text(encoding="utf-8")
    cards = dict(re.findall(r"(?ms)^## `(\w+)`\n(.*?)(?=^## |\Z)", written))
    assert tuple(cards) == dreba.models()
    lengthy = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    measured = re.search(r"(?ms)^wide, seed 0: .*?(\n\n|```)", lengthy)
    assert measured is not None
    for name, card in cards.items():
        if len(dreba.load(name).joints_) < len(COLUMNS):
            assert "not measured, the reach tasks need all 22 columns" in card
            continue
        rows = re.findall(rf"^\| ({name}(?:, [a-z ]+)*) \| (random|neutral) \| ([\d.]+ \([\d.]+\)) \|", card, re.M)
        plain = {(f"{name}{added}", start) for added in ("", ", free start") for start in ("random", "neutral")}
        assert plain <= {(row, start) for row, start, _ in rows}, name
        for row, start, figures in rows:  # one run, shown on two pages
            line = re.search(rf"(?m)^{start} +{re.escape(row)}  +(\S+ \(\S+\))", measured[0])
            assert line is None or line[1] == figures


def test_the_page_of_the_shipped_models_is_what_the_command_writes() -> None:
    written = (ROOT / "docs" / "model_cards.md").read_text(encoding="utf-8")
    now = page([shipped(name) for name in dreba.models()])
    if "Usefulness as a cost (" in written:  # measured by `dreba compare`, which takes minutes
        written, now = (
            re.sub(r"(?s)Usefulness as a cost.*?(?=\n## |\nWritten by)", "", text) for text in (written, now)
        )
    assert re.sub(NUMBER, "#", written) == re.sub(NUMBER, "#", now)
    numbers = [np.array([float(number) for number in re.findall(NUMBER, text)]) for text in (written, now)]
    assert numbers[0] == pytest.approx(numbers[1], abs=0.1)


def test_the_command_prints_and_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(*words: object) -> str:
        monkeypatch.setattr(sys, "argv", ["dreba", "card", *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            main()
        assert not stop.value.code
        return capsys.readouterr().out

    assert run("quadratic").startswith("# Models, one by one\n")
    assert run("quadratic", "-o", tmp_path / "card.md") == f"written: {tmp_path / 'card.md'}\n"
    assert (tmp_path / "card.md").read_text().endswith(f"Written by dreba {reba.__version__}.\n")
    (found,) = json.loads(run("quadratic", "--json"))["cards"]
    assert found["minimum"]["reba"] == 1
