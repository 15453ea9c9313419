"""Numbers that no one means, in numeric options, scenes, tables and headers: one error, with what is allowed."""

from __future__ import annotations

import copy
import json
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import dreba
import dreba.cli
import lgp
import lgp.cli
import reba
import reba.cli
from dreba.model_card import usefulness_table
from dreba.options import classes_of, unfitted
from dreba.surrogates.library import KINDS
from dreba.surrogates.validation import check_parameters
from lgp.execution.faults import parse_fault
from lgp.execution.server import _number
from lgp.scene.scene_file import SHIPPED, read_scene
from reba.checks import shown
from reba.live.command import parse_seconds
from reba.readers import read
from reba.readers.quality_control import parse_neutral
from tests.support.says import says

HUGE = 10**400
STRANGE = (1e300, -1.0, float("nan"), float("inf"), -float("inf"), 0, HUGE, -HUGE, 16**5000, 2.5, "x", True, None, [])


def _options(command: click.Command, words: str) -> Iterator[tuple[str, click.Parameter]]:
    if isinstance(command, click.Group):
        for name, inner in command.commands.items():
            yield from _options(inner, f"{words} {name}")
    else:
        for parameter in command.params:
            if isinstance(parameter.type, click.types.IntParamType | click.types.FloatParamType):
                yield f"{words} {parameter.opts[0]}", parameter


OPTIONS = dict(pair for module in (reba, dreba, lgp) for pair in _options(module.cli.cli, module.__name__))


@pytest.mark.parametrize("name", OPTIONS)
def test_every_numeric_option_has_a_range(name: str) -> None:
    parameter = OPTIONS[name]
    context = click.Context(click.Command("x"))
    several = parameter.multiple or parameter.nargs > 1
    texts = ["1e300", "-1e300", "nan", "inf", "-inf", str(HUGE), str(-HUGE), "9" * 5000, "x", "", "1e400"]
    texts += ["2.5"] if isinstance(parameter.type, click.types.IntParamType) else []
    for text in texts:
        with pytest.raises(click.BadParameter) as error:
            parameter.type_cast_value(context, (text,) * parameter.nargs if several else text)
        assert "\n" not in error.value.format_message()
        if not isinstance(parameter.type, click.types.IntParamType) and text in ("nan", "inf", "1e300"):
            says(error.value.format_message(), "range")


@pytest.mark.parametrize("text", ["1e300", "nan", "-1", "9" * 400, "9" * 5000, "inf s", "1e9"])
def test_times_in_texts_have_a_range(text: str) -> None:
    with pytest.raises(reba.RebaError) as error:
        parse_seconds("window", text)
    says(error, "--window", "1000000")
    for spec in (f"first:{text}", f"at:{text}s"):
        if text != "1e9":
            with pytest.raises(reba.RebaError) as error:
                parse_neutral(spec)
            says(error, "neutral", "first:3s")


@pytest.mark.parametrize("text", [f"moved@1:{'9' * 400}", f"moved@{'9' * 5000}:1", "moved@0:1", "moved@1:1.2.3"])
def test_numbers_of_faults_have_a_range(text: str) -> None:
    with pytest.raises(lgp.LgpError) as error:
        parse_fault(text)
    says(error, "fault")


@pytest.mark.parametrize("text", ["-99999999999:3", "1:99999999999", f"{HUGE}:{HUGE + 9}", "0", "9" * 5000, "nan", "x"])
def test_classes_have_a_range(text: str) -> None:
    with pytest.raises(dreba.SampleError) as error:
        dreba.sample(3, classes_of(text))
    says(error, "class")


@pytest.mark.parametrize("text", ["9" * 5000, "[" * 100_000, "1e999", "NaN", "-Infinity", str(HUGE), "1e300"])
@pytest.mark.parametrize("kind", KINDS)
def test_parameters_of_a_kind_have_a_range(kind: str, text: str) -> None:
    for name, allowed in KINDS[kind].allowed.items():
        for value in (text, f"[{text}]"):
            model = unfitted(kind, (f"{name}={value}",), None, None)
            with pytest.raises(dreba.ModelError) as error:
                check_parameters({name: allowed}, model.get_params(deep=False))
            says(error, name)


def test_numbers_of_a_table_of_usefulness_have_a_range(tmp_path: Path) -> None:
    path = tmp_path / "table.json"
    enabler = {"rows": [{"model": "m"}], "space": "wide", "tasks": 1, "solver": "s"}
    path.write_text(json.dumps({"enabler": enabler | {"certified": {"proved": HUGE, "tasks": 1}}}))
    with pytest.raises(reba.RebaError) as error:
        usefulness_table(path)
    says(error, path, "dreba compare")


def test_a_header_with_any_number_of_digits_is_no_event() -> None:
    assert _number("17") == 17
    assert [_number(text) for text in ("9" * 4400, "9" * 20, "-1", "1.5", "", "²", None)] == [None] * 7


VALUES = tomllib.loads((SHIPPED / "screwdriver.toml").read_text(encoding="utf-8"))


def _numbers(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _numbers(inner, (*path, key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.sampled_from(sorted(_numbers(VALUES), key=str)), st.sampled_from(range(len(STRANGE))))
def test_every_number_of_a_scene_is_read_or_refused(path: tuple[Any, ...], number: int) -> None:
    values = copy.deepcopy(VALUES)
    inner: Any = values
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = STRANGE[number]
    try:
        scene = read_scene(values)
    except lgp.LgpError as error:
        text = str(error)
        assert "\n" not in text
        assert len(text) < 1000
    else:
        assert abs(float(STRANGE[number])) <= 1e6  # type: ignore[arg-type]
        assert np.isfinite(scene.phase_seconds)


@pytest.mark.parametrize("seconds", [1e300, 601, 0, -1, HUGE])
def test_a_phase_that_never_ends_is_refused(seconds: float) -> None:
    with pytest.raises(lgp.LgpError) as error:
        read_scene({**VALUES, "phase_seconds": seconds}, "s")
    says(error, "s: phase_seconds is")


@pytest.mark.parametrize("column", ["trunk_flexion", "time", "other"])
@pytest.mark.parametrize("digits", [401, 5000])
def test_a_whole_number_beyond_floats_in_a_table(tmp_path: Path, column: str, digits: int) -> None:
    path = tmp_path / "huge.csv"
    rows = [f"{at},{5 + at},{at}" for at in range(3)]
    at = ("time", "trunk_flexion", "other").index(column)
    cells = rows[1].split(",")
    cells[at] = "9" * digits
    path.write_text("time,trunk_flexion,other\n" + "\n".join([rows[0], ",".join(cells), rows[2]]) + "\n")
    with pytest.raises(reba.RebaError) as error:
        read(path)
    says(error, path, "line 2" if column == "time" else "line 3", column)


def test_values_in_messages_are_short() -> None:
    assert shown(16**5000) == "a whole number of 20001 bits"
    assert shown(-(10**70)) == "a whole number of 233 bits"
    assert shown(10**17) == str(10**17)
