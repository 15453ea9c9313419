"""Outputs are refused before any work where they cannot be written or would replace something that is needed."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from reba.errors import RebaError
from reba.outputs import FileOutput, FolderOutput, Output, check_outputs, existing
from tests.support.says import says


def unusable(folder: Path) -> dict[str, tuple[str, str]]:
    """Return names that can be neither file nor folder, each with what the message says."""
    file = folder / "file.txt"
    file.write_text("kept")
    return {
        "": ("empty name", "expected"),
        f"{file}/below": (f"{file}/below", "cannot be written"),
        f"{file}/far/below": (f"{file}/far/below", "cannot be written"),
        "/proc/nothing/out": ("/proc/nothing/out", "cannot be written"),
        str(folder / ("x" * 256)): ("cannot be written", "too long"),
        str(folder / "new" / ("x" * 256)): ("cannot be written", "too long"),
        f"{folder}/nul\0": ("cannot be written", "null"),
    }


def refused(tmp_path: Path, *outputs: Output, inputs: tuple[str | Path, ...] = ()) -> str:
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(RebaError) as error:
        check_outputs(*outputs, inputs=inputs)
    assert sorted(tmp_path.rglob("*")) == before
    return str(error.value)


@pytest.mark.parametrize("kind", [FileOutput, FolderOutput])
def test_what_cannot_be_written_is_refused(tmp_path: Path, kind: Callable[[str], Output]) -> None:
    for name, facts in unusable(tmp_path).items():
        says(refused(tmp_path, kind(name)), *facts)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_only_regular_files_are_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    link = tmp_path / "link"
    link.symlink_to("/dev/null")
    for name in (tmp_path / "pipe", link, "/dev/null"):
        says(refused(tmp_path, FileOutput(name)), name, "not a regular file", "choose another name")
        says(refused(tmp_path, FolderOutput(name)), name, "not a folder")
    for folder in (tmp_path, f"{tmp_path}/", "/"):
        says(refused(tmp_path, FileOutput(folder)), folder, "this is a folder", "file", "give a name in it")
    says(refused(tmp_path, FileOutput(f"{tmp_path}/x.csv/")), "x.csv/", "name of a folder")


def test_a_wrong_ending_is_refused(tmp_path: Path) -> None:
    says(refused(tmp_path, FileOutput(tmp_path / "a.txt", (".csv", ".mcap"))), "'.txt'", "one of .csv, .mcap")
    says(refused(tmp_path, FileOutput(tmp_path / "a", (".csv",))), "ending in .csv")


def test_files_written_beside_and_inside_are_checked_too(tmp_path: Path) -> None:
    (tmp_path / "a.csv.meta.json").mkdir()
    says(refused(tmp_path, FileOutput(tmp_path / "a.csv", beside=(".meta.json",))), "a.csv.meta.json", "folder")
    (tmp_path / "plan.json").mkdir()
    says(refused(tmp_path, FolderOutput(tmp_path, ("plan.json",))), "plan.json", "folder")


def names_of(file: Path) -> list[str]:
    """Return other names of a file: through links of both kinds and through folders."""
    symbolic, hard = file.with_name("symbolic"), file.with_name("hard")
    symbolic.symlink_to(file)
    os.link(file, hard)
    return [str(file), str(symbolic), str(hard), f"{file.parent}/../{file.parent.name}/{file.name}"]


def test_an_output_is_no_input_by_any_name(tmp_path: Path) -> None:
    read = tmp_path / "in.csv"
    read.write_text("kept")
    for name in names_of(read):
        says(refused(tmp_path, FileOutput(name), inputs=(read,)), name, "input", "lost", "another name")
        says(refused(tmp_path, FileOutput(read), inputs=(name,)), read, "input")
    says(refused(tmp_path, FileOutput(tmp_path / "in", beside=(".csv",)), inputs=(read,)), "input", "lost")
    says(refused(tmp_path, FolderOutput(tmp_path, ("*.csv",)), inputs=(read,)), read, "input", "lost")
    check_outputs(FileOutput(tmp_path / "new"), FolderOutput(tmp_path, ("other",)), inputs=[read, None, "not there"])


def test_two_outputs_are_two_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    written = tmp_path / "old"
    written.write_text("kept")
    for name in names_of(written):
        says(refused(tmp_path, FileOutput(written), FileOutput(name)), name, "another output")
    says(refused(tmp_path, FileOutput("a"), FileOutput("./x/../a")), "another output")
    says(refused(tmp_path, FileOutput("a.csv", beside=(".json",)), FileOutput("a.csv.json")), "another output")
    says(refused(tmp_path, FileOutput("a"), FileOutput("a/b")), "another output")
    says(refused(tmp_path, FolderOutput("a/b"), FileOutput("a")), "another output")
    says(refused(tmp_path, FolderOutput("a"), FileOutput("a")), "another output")
    says(refused(tmp_path, FolderOutput("a", ("plan.json",)), FileOutput("a/plan.json")), "another output")
    check_outputs(FolderOutput("a", ("plan.json",)), FileOutput("a/tree.svg"), None)


def test_nothing_is_written_into_a_recording(tmp_path: Path) -> None:
    folder, link = tmp_path / "run", tmp_path / "link"
    folder.mkdir()
    for number in range(2):
        (folder / f"run_{number}.mcap").write_bytes(b"")
    link.symlink_to(folder)
    for output in (FileOutput(folder / "x.html"), FileOutput(link / "y" / "x.html"), FolderOutput(folder / "out")):
        says(refused(tmp_path, output, inputs=(folder,)), "lies in the recording", folder, "another place")
    check_outputs(FileOutput(tmp_path / "x.html"), FolderOutput(tmp_path / "out"), inputs=[folder])


def test_names_in_values_of_options_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a", "b", "c=d"):
        (tmp_path / name).write_text("")
    assert [*existing(["a", None, ("cost=b", "x"), "c=d", "", "\0"])] == ["a", "b", "c=d"]
