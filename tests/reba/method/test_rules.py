"""Rules: presets, files, wrong values."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import reba
from reba.method.rules import RATER, rules_of
from tests.support.paths import ROOT
from tests.support.says import says

NUMBERS = (
    "trunk_upright", "neck_upright", "trunk_twist", "trunk_side_bend", "neck_twist", "neck_side_bend", "abduction",
    "shoulder_elevation", "wrist_deviation", "wrist_twist", "static_seconds", "static_range", "repeated_per_minute",
    "repeated_min", "repeated_max", "gait_per_minute", "rapid_range", "rapid_seconds",
)  # fmt: skip
OPEN_CHOICES = NUMBERS[: NUMBERS.index("static_seconds")]

any_rules = st.builds(
    reba.Rules,
    name=st.text(st.characters(categories=("L", "N", "P", "S")), min_size=1, max_size=12),
    **{name: st.floats(0.0, 19.0) for name in NUMBERS},
    edges=st.sampled_from(["lower", "upper"]),
    twist_and_bend=st.sampled_from(["one", "two"]),
    upper_arm_reference=st.sampled_from(["trunk", "gravity"]),
    two_sides=st.sampled_from(["worse", "left", "right"]),
    seated_knees=st.booleans(),
    coupling_without_load=st.booleans(),
    walking_legs=st.sampled_from([1, 2]),
)


def test_presets() -> None:
    measured, paper = reba.PRESETS["measured"], reba.PRESETS["paper"]
    expected = dict.fromkeys(("trunk_upright", "neck_upright"), 5.0)
    expected |= dict.fromkeys(("trunk_twist", "trunk_side_bend", "neck_twist", "neck_side_bend"), 10.0)
    expected |= {"abduction": 30.0, "shoulder_elevation": 10.0, "wrist_deviation": 10.0, "wrist_twist": 30.0}
    assert {name: getattr(measured, name) for name in OPEN_CHOICES} == expected
    assert {name: getattr(paper, name) for name in OPEN_CHOICES} == dict.fromkeys(OPEN_CHOICES, 0.0)
    assert reba.Rules() == measured
    assert (measured.name, paper.name) == ("measured", "paper")
    for preset in (measured, paper):
        assert (preset.edges, preset.twist_and_bend, preset.two_sides) == ("lower", "one", "worse")
        assert preset.upper_arm_reference == "trunk"
        assert (preset.walking_legs, preset.seated_knees, preset.coupling_without_load) == (1, False, True)


def test_rater_has_a_source_for_every_tolerance() -> None:
    rater = reba.PRESETS["rater"]
    assert rater.name == "rater"
    assert set(RATER) == set(OPEN_CHOICES)
    assert {name: getattr(rater, name) for name in OPEN_CHOICES} == {name: deg for name, (deg, _) in RATER.items()}
    assert (
        rater.replace(name="measured", **{name: getattr(reba.Rules(), name) for name in OPEN_CHOICES}) == reba.Rules()
    )
    references = " ".join((ROOT / "docs" / "references.md").read_text(encoding="utf-8").split())
    for field, (degrees, source) in RATER.items():
        assert degrees >= getattr(reba.Rules(), field), "observers tell less apart than sensors"
        cited = [name for name in ("Covalla", "van Wyk", "Whitcroft", "55:885-897", "McKinnon") if name in source]
        assert cited or source.startswith("a choice"), field
        assert all(name in references for name in cited)


def test_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        reba.Rules().abduction = 1.0


@given(rules=any_rules)
def test_toml_round_trip(rules: reba.Rules, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("rules") / "own.toml"
    rules.save(path)
    assert reba.Rules.load(path) == rules
    assert rules_of(path) == rules
    assert rules_of(str(path)) == rules
    assert list(path.parent.iterdir()) == [path]


def test_numpy_numbers_survive_the_round_trip(tmp_path: Path) -> None:
    rules = reba.Rules(abduction=np.float64(42.5))
    rules.save(tmp_path / "own.toml")
    assert reba.Rules.load(tmp_path / "own.toml") == rules


def test_fields_left_out_keep_the_preset(tmp_path: Path) -> None:
    path = tmp_path / "plant.toml"
    path.write_text('preset = "paper"\nabduction = 45\n')
    assert reba.Rules.load(path) == reba.PRESETS["paper"].replace(name="plant", abduction=45.0)
    path.write_text("abduction = 45\n")
    assert reba.Rules.load(path) == reba.Rules(name="plant", abduction=45.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("abducton = 3\n", "unknown field 'abducton'; did you mean 'abduction'"),
        ("zzz = 3\n", "unknown field 'zzz'; known: "),
        ('preset = "strict"\n', "preset 'strict' is unknown; use one of measured, paper"),
        ("abduction = \n", "not TOML"),
        ('abduction = "much"\n', "abduction is 'much'; expected a number from 0"),
        ("[abduction]\nvalue = 3\n", "abduction is; expected a number"),
        ("abduction = nan\n", "expected a number"),
        ("abduction = -1\n", "expected a number from 0"),
    ],
)
def test_wrong_files_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "own.toml"
    path.write_text(text)
    with pytest.raises(reba.RulesError) as caught:
        reba.Rules.load(path)
    says(caught, *message.split("; "))


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(reba.RulesError) as caught:
        reba.Rules.load(tmp_path / "absent.toml")
    says(caught, "cannot be read as rules")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(reba.RulesError) as caught:
        reba.Rules.load(tmp_path / "bytes.toml")
    says(caught, "cannot be read as rules")


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *((name, value) for name in NUMBERS for value in (-1e-9, float("nan"), float("inf"), "5", None, True)),
        ("trunk_upright", 20.0),
        ("neck_upright", 91.0),
        ("edges", "middle"),
        ("twist_and_bend", "both"),
        ("upper_arm_reference", "pelvis"),
        ("two_sides", "mean"),
        ("two_sides", ["left"]),
        ("seated_knees", 1),
        ("coupling_without_load", "no"),
        ("walking_legs", 3),
        ("walking_legs", True),
        ("name", ""),
        ("name", "two\nlines"),
        ("name", 3),
    ],
)
def test_wrong_values_are_refused(field: str, value: object) -> None:
    for make in (lambda change: reba.Rules(**change), lambda change: reba.Rules().replace(**change)):
        with pytest.raises(reba.RulesError) as caught:
            make({field: value})
        says(caught, f"{field.split('_')[0]}", "is", "expected")


def test_replace_refuses_unknown_fields() -> None:
    with pytest.raises(reba.RulesError) as caught:
        reba.Rules().replace(abductoin=3.0)
    says(caught, "did you mean 'abduction'")


@pytest.mark.parametrize("which", ["strict", "", 5, None, "rules.json"])
def test_unknown_rules(which: object) -> None:
    with pytest.raises(reba.RulesError) as caught:
        rules_of(which)
    says(caught, "are unknown", "use measured, paper, rater, or a file")


def test_every_threshold_is_echoed() -> None:
    text = reba.Rules().to_toml()
    for field in dataclasses.fields(reba.Rules):
        assert f"{field.name} = " in text


@pytest.mark.parametrize(
    "text", ['preset = ["paper"]', "preset = 3", 'abduction = "x"', "edges = 1979-05-27", "name = ''"]
)
def test_a_wrong_value_names_its_file(tmp_path: Path, text: str) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(text)
    with pytest.raises(reba.RulesError) as caught:
        reba.Rules.load(path)
    says(caught, "lab.toml:")
    assert str(caught.value).count("lab.toml") == 1


def test_rules_that_cannot_be_saved_are_one_error(tmp_path: Path) -> None:
    with pytest.raises(reba.RebaError) as caught:
        reba.Rules().save(tmp_path)
    says(caught, tmp_path, "a folder", "expected one file")
