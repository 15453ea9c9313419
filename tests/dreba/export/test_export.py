"""Exported functions agree with the Python value and gradient."""

from __future__ import annotations

import ctypes
import importlib.util
import shutil
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import dreba
from dreba.export.casadi import casadi_function
from dreba.surrogates.soft import SoftModel
from reba.posture.columns import COLUMNS, INDEX
from tests.support.says import says

EXTRAS = [{}, {"load": 6.0, "coupling": (1, 3), "activity": 2}, {"load": 12.0, "coupling": (2, 0)}]
COMPILER = shutil.which("gcc") or shutil.which("cc")
ONE_ARM = ("trunk_flexion", "neck_flexion", "upper_arm_flexion_right", "lower_arm_flexion_right", "wrist_flexion_right")
Function = Callable[..., tuple[float, np.ndarray]]


@cache
def model(name: str) -> dreba.Surrogate:
    poses = dreba.sample(3000, rng=51)
    kinds = {
        "quadratic": dreba.QuadraticModel(),
        "linear load": dreba.QuadraticModel(payload="linear", free=True),
        "free, one arm": dreba.QuadraticModel(joints=ONE_ARM, free=True),
        "convex": dreba.ConvexModel(),
        "convex, one arm": dreba.ConvexModel(joints=ONE_ARM),
        "soft": SoftModel(ladder=(8.0, 1.0), temperature=1.0, updates=60),
        "graduated": dreba.GraduatedModel(ladder=(8.0,), temperature=8.0, updates=20),
    }
    return kinds[name].fit(poses.angles[:, columns(kinds[name])], poses.reba)


def columns(found: dreba.Surrogate) -> list[int]:
    return [INDEX[joint] for joint in found.get_params()["joints"] or COLUMNS]


def compiled(source: Path) -> Function:
    library = source.with_suffix(".so")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-shared", "-fPIC"]
    subprocess.run([str(COMPILER), *flags, "-o", str(library), str(source), "-lm"], check=True)
    function = ctypes.CDLL(str(library)).dreba
    array = np.ctypeslib.ndpointer(np.float64, flags="C")
    function.argtypes = [array, ctypes.c_double, array, ctypes.c_double, array]
    function.restype = ctypes.c_double

    def evaluate(
        pose: np.ndarray, load: float = 0.0, coupling: tuple[int, int] = (0, 0), activity: float = 0.0
    ) -> tuple[float, np.ndarray]:
        gradient = np.empty(len(pose))
        return function(np.ascontiguousarray(pose), load, np.array(coupling, float), activity, gradient), gradient

    return evaluate


def symbolic(name: str, temperature: float | None) -> Function:
    function = casadi_function(model(name), temperature=temperature)

    def evaluate(
        pose: np.ndarray, load: float = 0.0, coupling: tuple[int, int] = (0, 0), activity: float = 0.0
    ) -> tuple[float, np.ndarray]:
        value, gradient = function(pose, load, list(coupling), activity)
        return float(value), np.array(gradient).ravel()

    return evaluate


def check(evaluate: Function, name: str, temperature: float | None) -> None:
    poses = np.vstack([dreba.sample(30, rng=52).angles, np.zeros((1, 22)), np.full((1, 22), 170.0)])
    for pose in poses[:, columns(model(name))]:
        for extras in EXTRAS:
            value, gradient = evaluate(pose, **extras)
            expected, slope = model(name).value_and_gradient(pose, temperature=temperature, **extras)
            assert value == pytest.approx(expected, abs=1e-10)
            assert gradient == pytest.approx(slope, abs=1e-10)


CASES = [
    ("quadratic", None), ("linear load", None), ("free, one arm", None), ("convex", None), ("convex, one arm", None),
    ("soft", 8.0), ("soft", None), ("graduated", None),
]  # fmt: skip


@pytest.mark.skipif(COMPILER is None, reason="no C compiler on this machine")
@pytest.mark.parametrize(("name", "temperature"), CASES)
def test_c_function_agrees(name: str, temperature: float | None, tmp_path: Path) -> None:
    source = dreba.export_model(model(name), tmp_path / "cost", to="c", temperature=temperature)
    assert source.suffix == ".c"
    check(compiled(source), name, temperature)


@pytest.mark.skipif(importlib.util.find_spec("casadi") is None, reason="CasADi is not installed")
@pytest.mark.parametrize(("name", "temperature"), CASES)
def test_casadi_function_agrees(name: str, temperature: float | None) -> None:
    check(symbolic(name, temperature), name, temperature)


@pytest.mark.skipif(importlib.util.find_spec("casadi") is None, reason="CasADi is not installed")
def test_casadi_file_reads_back(tmp_path: Path) -> None:
    import casadi

    written = dreba.export_model(model("soft"), tmp_path / "cost.casadi", to="casadi", name="posture_cost")
    function = casadi.Function.deserialize(written.read_text())
    assert function.name() == "posture_cost"
    assert written.read_text().splitlines()[-2] == f"angles [deg]: {', '.join(COLUMNS)}"
    pose = np.full(22, 12.0)
    assert float(function(pose, 0.0, [0, 0], 0.0)[0]) == pytest.approx(model("soft").value(pose), abs=1e-10)


@pytest.mark.parametrize(
    ("target", "name", "facts"),
    [
        ("cc", "dreba", ("target 'cc'", "c or casadi")),
        ("c", "1st", ("'1st'", "letters")),
        ("c", "", ("''", "letters")),
    ],
)
def test_wrong_requests_are_refused(target: str, name: str, facts: tuple[str, ...], tmp_path: Path) -> None:
    with pytest.raises(dreba.ModelError) as error:
        dreba.export_model(model("quadratic"), tmp_path / "cost", to=target, name=name)
    says(error, *facts)


def test_every_stage_of_a_graduated_model_can_be_written(tmp_path: Path) -> None:
    written = {
        dreba.export_model(model("graduated"), tmp_path / "first", to="c", first=True).read_text(),
        *(
            dreba.export_model(model("graduated"), tmp_path / "soft", to="c", temperature=t).read_text()
            for t in (8.0, None)
        ),
    }
    assert sum("rounded hinges" in text for text in written) == 1
    assert len(written) == 2
    with pytest.raises(dreba.ModelError) as error:
        dreba.export_model(model("soft"), tmp_path / "first", to="c", first=True)
    says(error, "'soft'", "no first stage")


def test_kinds_without_an_export_and_bad_paths_are_refused(tmp_path: Path) -> None:
    poses = dreba.sample(500, rng=53)
    net = dreba.NetModel(epochs=2).fit(poses.angles, poses.reba)
    part = SoftModel(learn=False, joints=ONE_ARM).fit(poses.angles[:, :5], poses.reba)
    for target in ("c", "casadi"):
        with pytest.raises(dreba.ModelError) as error:
            dreba.export_model(net, tmp_path / "cost", to=target)
        says(error, "cannot be exported", "quadratic")
        with pytest.raises(dreba.ModelError) as error:
            dreba.export_model(part, tmp_path / "cost", to=target)
        says(error, "5 columns", "all 22")
    with pytest.raises(dreba.ModelError) as error:
        dreba.export_model(model("quadratic"), tmp_path / "cost", to="c", temperature=2.0)
    says(error, "no temperature", "leave it out")
    (tmp_path / "file").touch()
    with pytest.raises(dreba.ModelError) as error:
        dreba.export_model(model("quadratic"), tmp_path / "file" / "cost.c", to="c")
    says(error, "cannot be written")
