"""Labels of recordings: metadata records, manifests, file names, and refused ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from lgp.errors import LgpError
from lgp.study.labels import Label, Pattern, label_of, read_manifest, recorded_label
from lgp.study.recordings import find_sources
from reba.errors import RebaError
from tests.support.says import says
from tests.support.studies import log


@pytest.mark.parametrize(
    "label", [Label("p01", "ergonomic"), Label("P 1 ü", "a<b>", "2", simulated=True), Label("x", "y", "first")]
)
def test_a_record_is_read_back(tmp_path: Path, label: Label) -> None:
    assert recorded_label(log(tmp_path / "a.mcap", label.record())) == label


def test_other_recordings_have_no_record(tmp_path: Path) -> None:
    assert recorded_label(log(tmp_path / "a.mcap")) is None
    assert recorded_label(log(tmp_path / "a.csv")) is None


def test_a_record_without_a_condition_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LgpError) as error:
        recorded_label(log(tmp_path / "a.mcap", {"participant": "p01"}))
    says(error, "condition", "missing", "participant", "add it")
    with pytest.raises(LgpError) as error:
        label_of({"participant": "  ", "condition": "x"}, "here")
    says(error, "here", "participant", "empty")


def test_only_mcap_carries_records(tmp_path: Path) -> None:
    with pytest.raises(RebaError) as error:
        log(tmp_path / "a.csv", {"participant": "p"})
    says(error, ".mcap")


def test_splits_of_a_recording_must_agree(tmp_path: Path) -> None:
    for number, who in enumerate(("p1", "p1", "p2")):
        log(tmp_path / f"bag_{number}.mcap", Label(who, "a").record())
    with pytest.raises(LgpError) as error:
        recorded_label(tmp_path)
    says(error, "p1 / a", "p2 / a", "folder")
    (tmp_path / "bag_2.mcap").unlink()
    assert recorded_label(tmp_path) == Label("p1", "a")


def test_a_cut_recording_keeps_its_label(tmp_path: Path) -> None:
    path = log(tmp_path / "a.mcap", Label("p1", "a").record())
    data = path.read_bytes()
    path.write_bytes(data[: len(data) - 60])
    assert recorded_label(path) == Label("p1", "a")


@pytest.mark.parametrize(
    ("pattern", "path", "label"),
    [
        ("{participant}_{condition}", "logs/p01_non_ergonomic.mcap", Label("p01", "non_ergonomic")),
        ("{participant}_{condition}_{trial}", "p01_a_3.mcap.zstd", Label("p01", "a", "3")),
        ("{participant}/{condition}", "study/p01/a.csv", Label("p01", "a")),
        ("study-{condition}-{participant}", "study-x-7", Label("7", "x")),
        ("{participant}_{condition}", "p01.mcap", None),
    ],
)
def test_patterns(pattern: str, path: str, label: Label | None) -> None:
    assert Pattern(pattern).label(path) == label


@pytest.mark.parametrize(
    ("pattern", "facts"),
    [
        ("{participant}", ("{participant} and {condition}", "once each")),
        ("{participant}{participant}{condition}", ("once each",)),
        ("{participant}_{conditon}", ("{conditon}", "did you mean 'condition'")),
    ],
)
def test_bad_patterns(pattern: str, facts: tuple[str, ...]) -> None:
    with pytest.raises(LgpError) as error:
        Pattern(pattern)
    says(error, *facts)


def manifest(folder: Path, text: str) -> Path:
    path = folder / "who.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_manifest_names_orders_and_plans(tmp_path: Path) -> None:
    log(tmp_path / "b.csv"), log(tmp_path / "a.csv")
    path = manifest(tmp_path, "File,participant,condition,trial\nb.csv,p1,late,\n\na.csv,p1,early,2\n,p2,late,\n")
    lines = read_manifest(path)
    assert [line.label for line in lines] == [Label("p1", "late"), Label("p1", "early", "2"), Label("p2", "late")]
    found = find_sources([], path)
    assert found.conditions == ("late", "early")
    assert found.absent == (Label("p2", "late"),)
    only = find_sources([str(tmp_path / "a.csv")], path)
    assert [label for _, label in only.named] == [Label("p1", "early", "2")]
    assert set(only.absent) == {Label("p1", "late"), Label("p2", "late")}


@pytest.mark.parametrize(
    ("text", "facts"),
    [
        ("", ("empty", "columns")),
        ("file,participant,condition\n", ("no recording", "add a row")),
        ("file,participant\na.csv,p1\n", ("'condition'", "missing", "expected")),
        ("file,participant,condtion\na.csv,p1,x\n", ("did you mean 'condtion'",)),
        ("file,participant,condition\na.csv,p1\n", ("line 2", "2 fields", "expected 3")),
        ("file,participant,condition\na.csv,,x\n", ("line 2", "participant", "empty")),
        ("file,participant,condition\na.csv,p1,x\na.csv,p2,x\n", ("p1 / x", "p2 / x", "once")),
        ("file,participant,condition,file\na.csv,p1,x,a\n", ("2 columns", "'file'", "keep one")),
        ('file,participant,condition\n"a.csv,p1,x\n', ("read", "CSV")),
    ],
)
def test_bad_manifests(tmp_path: Path, text: str, facts: tuple[str, ...]) -> None:
    with pytest.raises(LgpError) as error:
        read_manifest(manifest(tmp_path, text))
    says(error, *facts)


def test_a_manifest_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(LgpError) as error:
        read_manifest(tmp_path / "none.csv")
    says(error, "none.csv", "CSV file")


def test_semicolons_separate_fields_too(tmp_path: Path) -> None:
    (line,) = read_manifest(manifest(tmp_path, "\ufefffile;participant;condition\na.csv;p1;x\n"))
    assert line.label == Label("p1", "x")
