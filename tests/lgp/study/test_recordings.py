"""Labelled recordings of a study: unlabelled ones, repeated labels, excluded folders."""

from __future__ import annotations

from pathlib import Path

import pytest

from lgp.errors import LgpError
from lgp.study.labels import Label
from lgp.study.recordings import find_sources
from lgp.study.scoring import score_sources
from reba.batch.run import ScoringOptions
from tests.support.says import says
from tests.support.studies import log


def test_unnamed_recordings_are_failures_and_stop_no_other(tmp_path: Path) -> None:
    log(tmp_path / "a.mcap", Label("p1", "x").record())
    log(tmp_path / "b.mcap")
    found = find_sources([str(tmp_path)])
    assert [label for _, label in found.named] == [Label("p1", "x")]
    (failure,) = found.unnamed
    assert "no metadata record 'study'" in failure.error
    (tmp_path / "a.mcap").unlink()
    with pytest.raises(LgpError) as error:
        find_sources([str(tmp_path)])
    says(error, "none of the 1 recordings", "b.mcap", "--manifest")


def test_the_same_label_twice_is_refused(tmp_path: Path) -> None:
    for name in ("a", "b"):
        log(tmp_path / f"{name}.mcap", Label("p1", "x").record())
    with pytest.raises(LgpError) as error:
        find_sources([str(tmp_path)])
    says(error, "p1 / x", "a.mcap", "b.mcap", "trial")


def test_names_that_differ_in_case_are_refused(tmp_path: Path) -> None:
    log(tmp_path / "a.mcap", Label("p1", "Ergonomic").record())
    log(tmp_path / "b.mcap", Label("p2", "ergonomic").record())
    with pytest.raises(LgpError) as error:
        find_sources([str(tmp_path)])
    says(error, "'Ergonomic'", "'ergonomic'", "one spelling")


def test_nothing_or_too_much_is_refused() -> None:
    with pytest.raises(LgpError) as error:
        find_sources([])
    says(error, "no recording", "--manifest")
    with pytest.raises(LgpError) as error:
        find_sources(["x"], "m.csv", "{participant}_{condition}")
    says(error, "--manifest", "--pattern", "one of them")


def test_results_are_no_inputs(tmp_path: Path) -> None:
    log(tmp_path / "p1_x.csv")
    log(tmp_path / "results" / "p2_x.csv")
    found = find_sources([str(tmp_path)], pattern="{participant}_{condition}", exclude=tmp_path / "results")
    assert [label.participant for _, label in found.named] == ["p1"]


def test_a_recording_replaced_after_its_label_was_read_is_a_failure(tmp_path: Path) -> None:
    for name, person in (("a", "p1"), ("b", "p2")):
        log(tmp_path / f"{name}.mcap", Label(person, "x").record())
    found = find_sources([str(tmp_path)])
    (tmp_path / "b.mcap").replace(tmp_path / "a.mcap")
    scored, _ = score_sources(found, ScoringOptions())
    assert len(scored.failed) == 2
    says(scored.failed[0].error, "a.mcap", "changed while it was read")
