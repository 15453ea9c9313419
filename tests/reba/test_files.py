"""Strict JSON, and files that are written whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

import reba
from reba.files import as_json, plain_data, write_atomic, write_text
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
