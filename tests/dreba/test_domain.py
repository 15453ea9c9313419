"""Domains: bins follow the rules, files are checked, the authors' bins are kept to the letter."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import dreba
import reba
from dreba.domain import DOMAINS
from dreba.sampling.classes import true_scores
from reba.posture.columns import COLUMNS, INDEX
from tests.support.says import says


@pytest.mark.parametrize("name", DOMAINS)
def test_shipped_domains_are_symmetric_and_sourced(name: str) -> None:
    domain = dreba.domain_of(name)
    assert len(domain.source) > 40
    for column in domain.columns:
        if column.endswith("left"):
            assert domain.bins_of(column) == domain.bins_of(column.replace("left", "right"))
    assert domain.to_dict()["limits"].keys() == domain.limits.keys()


def test_bins_of_rules_are_their_classes() -> None:
    human = dreba.domain_of("human")
    assert human.bins_of("trunk_flexion") == ((-30.0, -20.0, -5.0, 5.0, 20.0, 60.0, 110.0), (3, 2, 1, 2, 3, 4))
    assert human.bins_of("knee_flexion_left") == ((0.0, 30.0, 60.0, 130.0), (0, 1, 2))
    assert human.hold(knee_flexion_left=9.0, knee_flexion=3.0).limits["knee_flexion_left"] == (9.0, 9.0)
    assert human.hold(trunk_flexion=30.0).bins_of("trunk_flexion") == ((30.0, 30.0), (3,))


def test_paper_domain_is_the_authors_table() -> None:
    paper = dreba.domain_of("paper")
    assert len(paper.columns) == 20
    assert paper.bins_of("trunk_flexion") == ((-20, -10, 10, 20, 60, 90), (2, 1, 2, 3, 4))
    assert paper.bins_of("neck_flexion") == ((-45, 10, 20, 45), (2, 1, 2))
    assert paper.bins_of("knee_flexion_right") == ((0, 60, 80), (0, 1))
    assert paper.bins_of("upper_arm_abduction_left") == ((0, 15, 90), (0, 1))
    assert paper.bins_of("lower_arm_flexion_left") == ((0, 60, 100, 145), (2, 1, 2))
    assert paper.bins_of("wrist_twist_left") == ((-30, -10, 10, 30), (1, 0, 1))


def test_paper_bins_and_nearest_rules_differ_only_in_the_documented_bands() -> None:
    paper = dreba.domain_of("paper")
    angles = dreba.sample(4000, domain=paper, rng=2).angles
    # Parts of two arms are mixed in the authors' reading: compare where left and right are the same.
    for column in COLUMNS:
        if column.endswith("right"):
            angles[:, INDEX[column]] = angles[:, INDEX[column.replace("right", "left")]]
    neck, knee = angles[:, INDEX["neck_flexion"]], angles[:, INDEX["knee_flexion_left"]]
    alike = ((neck < 0) | (neck > 10)) & (knee < 30)
    assert alike.sum() > 200
    bins, exact = true_scores(paper, angles, None), reba.score_array(angles, None, paper.rules).reba
    assert np.array_equal(bins[alike], exact[alike])
    assert (bins != exact).any()


def test_own_bins_count_factors_like_the_tables() -> None:
    poses = dreba.sample(600, range(1, 16), domain="paper", rng=2, factors=["load", "coupling", "activity"])
    assert set(poses.counts.values()) == {40}


def test_file_names_both_sides(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text('name = "bench"\nrules = "paper"\n[limits]\ntrunk_flexion = [0, 80]\nknee_flexion = [0, 20]\n')
    domain = dreba.domain_of(path)
    assert domain.columns == ("trunk_flexion", "knee_flexion_left", "knee_flexion_right")
    assert domain.rules.trunk_upright == 0.0
    poses = dreba.sample(20, [1, 2], domain=domain, rng=1)
    assert set(np.unique(poses.angles[:, INDEX["lower_arm_flexion_left"]])) == {80.0}


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("[limits]\ntrunk_flexoin = [0, 1]", "did you mean 'trunk_flexion'"),
        ("[limits]\ntrunk_flexion = [40, 0]", "rising"),
        ("[limits]\ntrunk_flexion = 3", "2 numbers"),
        ("limit = 3", "did you mean 'limits'"),
        ("load = [5, 1]", "kilograms"),
        ("sides = 'worst part'", "'worst part' with bins"),
        ("[bins]\nneck_twist = { edges = [0, 1], points = [1, 2] }", "k points"),
        ("[bins]\nneck_twist = { edges = [0, 1], points = [1.5] }", "whole numbers from 0 to 4"),
        ("[bins]\nneck_twist = { edges = [0, 1], points = [1], point = 1 }", "did you mean 'points'"),
        ("rules = 'none'", "unknown"),
        ("[rules]\ntrunk_uprigt = 3", "did you mean 'trunk_upright'"),
        ("limits = 3", "a table of keys"),
        ("= 3", "not TOML"),
    ],
)
def test_wrong_files_are_refused(tmp_path: Path, text: str, fact: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(text)
    with pytest.raises(dreba.DomainError) as error:
        dreba.domain_of(path)
    says(error, "wrong", fact)


def test_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(dreba.DomainError) as error:
        dreba.domain_of(tmp_path / "no.toml")
    says(error, "no.toml", "cannot be read", "TOML file or a name")


def test_plain_data_reads_back_equal(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        'name = "own"\ntitle = "Bench"\nsource = "measured"\nload = [2, 8]\n'
        "[bins]\ntrunk_flexion = { edges = [0, 30, 90], points = [1, 3] }\n"
        "[limits]\nknee_flexion = [0, 20]\n"
    )
    for domain in (dreba.domain_of(path), *map(dreba.domain_of, DOMAINS)):
        assert dreba.Domain.from_dict(json.loads(json.dumps(domain.to_dict()))) == domain


def test_files_that_name_a_shipped_domain_without_its_bins_are_read() -> None:
    old = {key: value for key, value in dreba.domain_of("paper").to_dict().items() if key not in ("bins", "load")}
    assert dreba.Domain.from_dict(old) == dreba.domain_of("paper")
    bins = {"neck_twist": {"edges": ["a", "b"], "points": [1]}}
    for damaged in ({"name": "paper"}, {**old, "bins": bins}, {**old, "load": 3}, {**old, "limits": []}):
        with pytest.raises(dreba.DomainError) as error:
            dreba.Domain.from_dict(damaged)
        says(error, "'paper'", "damaged", "--domain")


def test_only_some_columns_move() -> None:
    with pytest.raises(dreba.DomainError) as error:
        dreba.domain_of("human").only(["trunk_flexoin"])
    says(error, "'trunk_flexoin'", "did you mean 'trunk_flexion'")
    assert dreba.domain_of("human").only(["knee_flexion"]).columns == ("knee_flexion_left", "knee_flexion_right")
    held = dreba.domain_of("human").hold(knee_flexion=3.0)
    assert held.limits["knee_flexion_left"] == held.limits["knee_flexion_right"] == (3.0, 3.0)
    legs = dreba.domain_of("human").only(["knee_flexion_left", "trunk_flexion"])
    assert legs.columns == ("trunk_flexion", "knee_flexion_left")
    assert legs.limits["lower_arm_flexion_left"] == (80.0, 80.0)
