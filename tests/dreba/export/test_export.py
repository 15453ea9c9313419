"""Exported functions agree with the Python value and gradient."""

from __future__ import annotations

import ctypes
import importlib.util
import os
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
    poses = dreba.sample(3000, range(1, 16), factors=["load", "coupling", "activity"], rng=51)
    kinds = {
        "quadratic": dreba.QuadraticModel(),
        "linear load": dreba.QuadraticModel(payload="linear", free=True),
        "free, one arm": dreba.QuadraticModel(joints=ONE_ARM, free=True),
        "convex": dreba.ConvexModel(),
        "convex, one arm": dreba.ConvexModel(joints=ONE_ARM),
        "soft": SoftModel(ladder=(8.0, 1.0), temperature=1.0, updates=60),
        "graduated": dreba.GraduatedModel(ladder=(8.0,), temperature=8.0, updates=20),
    }
    return kinds[name].fit(poses.angles[:, columns(kinds[name])], poses.reba, factors=poses.factors)


def columns(found: dreba.Surrogate) -> list[int]:
    return [INDEX[joint] for joint in found.get_params()["joints"] or COLUMNS]


LANGUAGES = {
    "C99": (COMPILER, ["-std=c99", "-Wstrict-prototypes", "-Wmissing-prototypes"]),
    "C++17": (shutil.which("g++"), ["-std=c++17", "-x", "c++"]),
}


def compiled(source: Path, name: str = "dreba", language: str = "C99") -> Function:
    library = source.with_suffix(".so")
    compiler, flags = LANGUAGES[language]
    if compiler is None:
        pytest.skip(f"no compiler of {language} on this machine")
    flags = [*flags, "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wshadow", "-O2", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, "-o", str(library), str(source), "-lm"], check=True)
    loaded = ctypes.CDLL(str(library))
    function = getattr(loaded, name)
    array = np.ctypeslib.ndpointer(np.float64, flags="C")
    function.argtypes = [array, ctypes.c_double, array, ctypes.c_double, ctypes.c_void_p]
    function.restype = ctypes.c_double

    def evaluate(
        pose: np.ndarray, load: float = 0.0, coupling: tuple[float, float] = (0, 0), activity: float = 0.0
    ) -> tuple[float, np.ndarray]:
        gradient = np.empty(len(pose))
        given = np.ascontiguousarray(pose), load, np.array(coupling, float), activity
        value = function(*given, gradient.ctypes.data)
        assert np.array_equal(function(*given, None), value, equal_nan=True)
        return value, gradient

    def hessian(
        pose: np.ndarray, load: float = 0.0, coupling: tuple[float, float] = (0, 0), activity: float = 0.0
    ) -> np.ndarray:
        second = getattr(loaded, f"{name}_hessian")
        second.argtypes = [array, ctypes.c_double, array, ctypes.c_double, array]
        second.restype = None
        out = np.empty((len(pose), len(pose)))
        second(np.ascontiguousarray(pose), load, np.array(coupling, float), activity, out)
        return out

    evaluate.hessian = hessian
    return evaluate


def symbolic(name: str, temperature: float | None, **options: object) -> Function:
    function = casadi_function(model(name), temperature=temperature, **options)

    def evaluate(
        pose: np.ndarray, load: float = 0.0, coupling: tuple[int, int] = (0, 0), activity: float = 0.0
    ) -> tuple[float, np.ndarray]:
        value, gradient = function(pose, load, list(coupling), activity)[:2]
        return float(value), np.array(gradient).ravel()

    def hessian(
        pose: np.ndarray, load: float = 0.0, coupling: tuple[int, int] = (0, 0), activity: float = 0.0
    ) -> np.ndarray:
        return np.array(function(pose, load, list(coupling), activity)[2])

    evaluate.hessian = hessian
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


@pytest.mark.parametrize(
    ("name", "temperature", "language"),
    [*((*case, "C99") for case in CASES), *((*case, "C++17") for case in (CASES[0], CASES[3], CASES[5]))],
)
def test_c_function_agrees(name: str, temperature: float | None, language: str, tmp_path: Path) -> None:
    source = dreba.export_model(model(name), tmp_path / "cost", to="c", temperature=temperature)
    assert source.suffix == ".c"
    check(compiled(source, language=language), name, temperature)


ARGUMENTS = [
    {"load": np.nan}, {"load": -1.0}, {"load": np.inf}, {"coupling": (np.nan, 0)}, {"coupling": (0, 4)},
    {"coupling": (-0.5, 0)}, {"activity": np.nan}, {"activity": 3.5},
]  # fmt: skip


def check_refusals(evaluate: Function, d: int) -> None:
    """What Python refuses is not a number here: value and every element of the gradient."""
    for place in range(d):
        for wrong in (np.nan, np.inf, -np.inf):
            pose = np.full(d, 5.0)
            pose[place] = wrong
            value, gradient = evaluate(pose)
            assert np.isnan(value)
            assert np.isnan(gradient).all()
    for arguments in ARGUMENTS:
        value, gradient = evaluate(np.full(d, 5.0), **arguments)
        assert np.isnan(value), arguments
        assert np.isnan(gradient).all()
    value, gradient = evaluate(np.full(d, 5.0), load=1e300, coupling=(3, 3), activity=3)
    assert np.isfinite(value)
    assert np.isfinite(gradient).all()


@pytest.mark.parametrize("name", ["quadratic", "linear load", "free, one arm", "convex", "convex, one arm", "soft"])
def test_what_python_refuses_is_not_a_number_in_c(name: str, tmp_path: Path) -> None:
    source = dreba.export_model(model(name), tmp_path / "cost", to="c")
    check_refusals(compiled(source), len(model(name).joints_))


@pytest.mark.skipif(importlib.util.find_spec("casadi") is None, reason="CasADi is not installed")
@pytest.mark.parametrize("name", ["quadratic", "linear load", "convex, one arm", "soft"])
def test_what_python_refuses_is_not_a_number_in_casadi(name: str) -> None:
    check_refusals(symbolic(name, None), len(model(name).joints_))


HESSIANS = [
    ("quadratic", "exact"), ("quadratic", "gauss-newton"), ("convex", "exact"), ("convex, one arm", "gauss-newton"),
    ("soft", "gauss-newton"), ("soft", "exact"),
]  # fmt: skip


def check_hessian(evaluate: Function, name: str, kind: str) -> None:
    found = model(name)
    for pose in dreba.sample(20, rng=54).angles[:, columns(found)]:
        if kind == "exact":
            expected = found.hessian(pose, load=6.0, coupling=(1, 2))
        else:
            factor = found.gauss_newton(pose, load=6.0, coupling=(1, 2))
            expected = factor.T @ factor
        assert evaluate.hessian(pose, load=6.0, coupling=(1, 2)) == pytest.approx(expected, abs=1e-10)
    assert np.isnan(evaluate.hessian(np.full(len(found.joints_), np.nan))).all()
    assert np.isnan(evaluate.hessian(np.zeros(len(found.joints_)), load=-1.0)).all()


@pytest.mark.parametrize(("name", "kind"), HESSIANS)
def test_second_derivatives_in_c(name: str, kind: str, tmp_path: Path) -> None:
    source = dreba.export_model(model(name), tmp_path / "cost", to="c", hessian=kind)
    evaluate = compiled(source)
    check_hessian(evaluate, name, kind)
    check(evaluate, name, None)


@pytest.mark.skipif(importlib.util.find_spec("casadi") is None, reason="CasADi is not installed")
@pytest.mark.parametrize(("name", "kind"), HESSIANS)
def test_second_derivatives_in_casadi(name: str, kind: str) -> None:
    check_hessian(symbolic(name, None, hessian=kind), name, kind)


@pytest.mark.parametrize("name", ["quadratic", "convex", "soft"])
def test_exact_second_derivatives_in_c_are_differences_of_its_gradients(name: str, tmp_path: Path) -> None:
    source = dreba.export_model(model(name), tmp_path / "cost", to="c", hessian="exact")
    evaluate, step = compiled(source), 1e-4
    given = {"load": 12.0, "coupling": (3, 1), "activity": 1}
    off = []
    for pose in dreba.sample(40, rng=55).angles:
        by_column = [(evaluate(pose + e, **given)[1] - evaluate(pose - e, **given)[1]) / (2 * step)
                     for e in step * np.eye(22)]  # fmt: skip
        off.append(np.abs(evaluate.hessian(pose, **given) - by_column).max())
    assert np.median(off) < 1e-7
    assert np.mean(np.array(off) < 1e-6) > 0.9  # the others are within a step of a kink


def test_second_derivatives_that_there_are_not_are_refused(tmp_path: Path) -> None:
    with pytest.raises(dreba.ModelError) as error:
        dreba.export_model(model("convex"), tmp_path / "cost", to="jax", hessian="exact")
    says(error, "the library has it")
    assert list(tmp_path.iterdir()) == []


MAIN = """
#include "first.h"
#include "second.h"
#include "third.h"
#include "first.h"
#include <cstdio>
int main()
{
    const double coupling[2] = {0.0, 1.0};
    double pose[first_cost_JOINTS] = {0.0}, gradient[first_cost_JOINTS], hessian[22 * 22];
    pose[0] = 30.0;
    const double values[3] = {
        first_cost(pose, 6.0, coupling, 1.0, gradient), second_cost(pose, 6.0, coupling, 1.0, nullptr),
        third_cost(pose, 6.0, coupling, 1.0, nullptr)};
    third_cost_hessian(pose, 6.0, coupling, 1.0, hessian);
    std::printf("%.12f %.12f %.12f %.12f\\n", values[0], values[1], values[2], hessian[0]);
}
"""


@pytest.mark.skipif(COMPILER is None or shutil.which("g++") is None, reason="no compiler on this machine")
@pytest.mark.parametrize("together", ["objects", "included"])
def test_several_exports_are_one_program(together: str, tmp_path: Path) -> None:
    models = {"first": "quadratic", "second": "convex", "third": "soft"}
    for name, kind in models.items():
        hessian = "gauss-newton" if name == "third" else None
        dreba.export_model(model(kind), tmp_path / f"{name}.c", to="c", name=f"{name}_cost", hessian=hessian)
    (tmp_path / "main.cpp").write_text(MAIN)
    flags = ["-Wall", "-Wextra", "-Werror", "-pedantic"]
    sources = [f"{name}.c" for name in models]
    if together == "included":
        (tmp_path / "all.c").write_text("".join(f'#include "{name}.h"\n#include "{name}.c"\n' for name in models))
        sources = ["all.c"]
    for source in sources:
        subprocess.run([str(COMPILER), "-std=c99", *flags, "-c", source], check=True, cwd=tmp_path)
    objects = [source.replace(".c", ".o") for source in sources]
    subprocess.run(["g++", "-std=c++17", *flags, "main.cpp", *objects, "-o", "main", "-lm"], check=True, cwd=tmp_path)
    done = subprocess.run([str(tmp_path / "main")], check=True, capture_output=True, text=True)
    pose = np.zeros(22)
    pose[0] = 30.0
    given = {"load": 6.0, "coupling": (0, 1), "activity": 1}
    factor = model("soft").gauss_newton(pose, **given)
    expected = [*(model(kind).value(pose, **given) for kind in models.values()), (factor.T @ factor)[0, 0]]
    assert [float(word) for word in done.stdout.split()] == pytest.approx(expected, abs=1e-9)


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
        ("cc", "dreba", ("target 'cc'", "c or casadi or torch or jax")),
        ("c", "int", ("'int'", "reserved")),
        ("c", "namespace", ("'namespace'", "reserved")),
        ("c", "exp", ("'exp'", "reserved")),
        ("casadi", "jac", ("'jac'", "reserved")),
        ("c", "_cost", ("'_cost'", "reserved")),
        ("c", "sinf", ("'sinf'", "reserved")),
        ("c", "size_t", ("'size_t'", "reserved")),
        ("c", "M_PI", ("'M_PI'", "reserved")),
        ("torch", "JOINTS", ("'JOINTS'", "reserved")),
        ("casadi", "a__b", ("'a__b'", "reserved")),
        ("jax", "lambda", ("'lambda'", "reserved")),
        ("c", "x" * 52, ("at most 51",)),
        ("c", "cost_hessian", ("'cost_hessian'", "export named 'cost'")),
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
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(dreba.ModelError) as error:
        dreba.export_model(model("quadratic"), tmp_path / "file" / "cost.c", to="c")
    says(error, "cannot be written")
    for device in ("pipe", "/dev/null"):
        with pytest.raises(dreba.ModelError) as error:
            dreba.export_model(model("quadratic"), tmp_path / device, to="c")
        says(error, device, "not a regular file")
