"""Strict JSON, and files and folders that are written whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
import pytest

import reba
from reba.files import as_json, from_json, plain_data, write_atomic, write_folder, write_text
from tests.support.says import says

VALUES: dict[str, tuple[Any, Any]] = {
    "float": (np.float64(0.1), 0.1),
    "single precision": (np.float32(0.5), 0.5),
    "integer": (np.int64(3), 3),
    "byte": (np.uint8(255), 255),
    "boolean": (np.bool_(True), True),
    "text": (np.str_("neck"), "neck"),
    "array": (np.array([[1.0, np.nan], [-np.inf, 2.0]]), [[1.0, None], [None, 2.0]]),
    "scalar array": (np.array(2.5), 2.5),
    "NaN": (float("nan"), None),
    "infinity": (np.float64("inf"), None),
    "tuple": ((1, (2.0, None)), [1, [2.0, None]]),
    "keys": ({1: "a", 0.5: "b"}, {"1": "a", "0.5": "b"}),
    "read-only mapping": (MappingProxyType({"a": np.int8(1)}), {"a": 1}),
    "large integer": (10**30, 10**30),
}


@pytest.mark.parametrize("kind", VALUES)
def test_data_become_strict_json(kind: str) -> None:
    value, expected = VALUES[kind]
    assert json.loads(as_json({"value": value})) == {"value": expected}
    assert plain_data(value) == expected
    assert type(plain_data(value)) is type(expected)


def test_floats_keep_every_digit() -> None:
    values = np.random.default_rng(20250101).normal(size=100)
    assert np.array_equal(json.loads(as_json(values)), values)


@pytest.mark.parametrize("value", [float("nan"), np.inf, np.array([0.0, np.nan])])
def test_non_finite_numbers_can_be_refused(value: object) -> None:
    with pytest.raises(ValueError, match="JSON"):
        as_json({"value": value}, non_finite="refuse")


@pytest.mark.parametrize("number", ["NaN", "-Infinity", "1e999", "-1e999", "9" * 401, "-" + "9" * 401, "9" * 5000])
def test_numbers_that_floats_do_not_hold_are_no_data(number: str) -> None:
    with pytest.raises(ValueError, match="finite numbers"):
        from_json(f'{{"costs": [{number}]}}')
    assert from_json(f"[{'9' * 300}, 1e300]") == [int("9" * 300), 1e300]


def test_objects_that_json_does_not_have_are_an_error() -> None:
    with pytest.raises(TypeError):
        as_json({"value": object()})


def test_a_file_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "new" / "note.json"
    write_atomic(path, lambda part: write_text(part, "old"))

    def fails(part: Path) -> None:
        write_text(part, "ne")
        raise OSError(28, "No space left on device")

    with pytest.raises(reba.RebaError) as caught:
        write_atomic(path, fails)
    says(caught, path, "cannot be written", "another place")
    assert path.read_text() == "old"
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_the_temporary_name_of_a_file_is_not_told(tmp_path: Path) -> None:
    def of_a_writer(part: Path) -> None:
        try:
            raise OSError(28, "No space left on device")
        except OSError as error:
            raise reba.RebaError(f"{part}: cannot be written; run with --resume") from error

    with pytest.raises(reba.RebaError) as error:
        write_atomic(tmp_path / "robot.mcap", of_a_writer)
    says(error, tmp_path / "robot.mcap", "No space left", "choose another place")
    assert ".part" not in str(error.value)
    assert everything(tmp_path) == {}


def test_only_regular_files_are_replaced_and_links_are_followed(tmp_path: Path) -> None:
    (tmp_path / "full").symlink_to("/dev/full")
    for name in ("/dev/full", tmp_path / "full", tmp_path):
        with pytest.raises(reba.RebaError):
            write_atomic(name, lambda part: write_text(part, "new"))
    assert Path("/dev/full").is_char_device()
    target, link = tmp_path / "target", tmp_path / "link"
    link.symlink_to(target)
    write_atomic(link, lambda part: write_text(part, "new"))
    assert (link.is_symlink(), target.read_text()) == (True, "new")
    long = tmp_path / ("x" * 255)
    write_atomic(long, lambda part: write_text(part, "new"))
    assert long.read_text() == "new"


def plan_of(words: str, *names: str) -> Callable[[Path], None]:
    def write(part: Path) -> None:
        for name in names:
            (part / name).parent.mkdir(exist_ok=True)
            (part / name).write_text(words)

    return write


def everything(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def content(folder: Path) -> dict[str, str]:
    return {str(file.relative_to(folder)): file.read_text() for file in folder.rglob("*") if file.is_file()}


def test_a_folder_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "plan"
    write_folder(folder, plan_of("old", "plan.json", "path", "pictures/1", "pictures/2"), last="plan.json")
    (folder / "pictures" / "mine").write_text("mine")
    before = content(folder)

    def fails(part: Path) -> None:
        plan_of("new", "plan.json", "pictures/1")(part)
        raise OSError(28, "No space left on device")

    with pytest.raises(reba.PostureError) as caught:
        write_folder(folder, fails, last="plan.json", stale=["pictures/?"], error=reba.PostureError)
    says(caught, folder, "cannot be written", "No space left", "another folder")
    assert content(folder) == before

    def fails_inside(part: Path) -> None:
        write_atomic(part / "pictures", lambda _: fails(part))

    with pytest.raises(reba.RebaError) as caught:
        write_folder(folder, fails_inside)
    says(caught, f"{folder}/pictures: cannot be written", "No space left")
    assert content(folder) == before
    write_folder(folder, plan_of("new", "plan.json", "pictures/1"), last="plan.json", stale=["pictures/?"])
    assert content(folder) == {"plan.json": "new", "path": "old", "pictures/1": "new", "pictures/mine": "mine"}
    (folder / "path").unlink()
    (folder / "path").mkdir()
    before = content(folder)
    with pytest.raises(reba.RebaError):
        write_folder(folder, plan_of("newest", "a", "path", "plan.json"))
    assert content(folder) == before


def test_the_last_file_of_a_folder_comes_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    order = []
    replace = Path.replace

    def noted(self: Path, target: Path) -> Path:
        order.append(target.name)
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", noted)
    write_folder(tmp_path, plan_of("x", "a", "index", "z"), last="index")
    assert order == ["a", "z", "index"]


def test_a_folder_with_files_of_two_writes_does_not_pass_for_complete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_folder(tmp_path, plan_of("old", "path", "plan.json", "postures"), last="plan.json")
    replace = Path.replace

    def killed(self: Path, target: Path) -> Path:
        if target.name == "postures":
            raise SystemExit(137)
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", killed)
    with pytest.raises(SystemExit):
        write_folder(tmp_path, plan_of("new", "path", "plan.json", "postures"), last="plan.json")
    assert content(tmp_path) == {"path": "new", "postures": "old"}
    monkeypatch.undo()
    write_folder(tmp_path, plan_of("new", "path", "plan.json", "postures"), last="plan.json")
    write_folder(tmp_path, plan_of("newer", "plan.json"), last="plan.json")
    write_folder(tmp_path, plan_of("newer", "a", "b"), last="plan.json")
    assert content(tmp_path)["plan.json"] == "newer"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no limit of file sizes here")
def test_a_full_disk_keeps_the_former_file(tmp_path: Path) -> None:
    import resource

    angles = np.random.default_rng(0).uniform(0, 90, 20_000)
    frames = pd.DataFrame({"time": np.arange(20_000.0), "trunk_flexion": angles})
    scores, other = reba.score(frames), reba.score(frames, load=20.0)
    for ending in (".parquet", ".csv", ".mcap"):
        path = tmp_path / f"scores{ending}"
        reba.write_scores(scores, path)
        before = everything(tmp_path)
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
        try:
            with pytest.raises(reba.RebaError) as error:
                reba.write_scores(other, path)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        says(error, path, "cannot be written", "too large")
        assert everything(tmp_path) == before
