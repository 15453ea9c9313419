"""Python sources for PyTorch and JAX: the value and its automatic derivative are those of the model."""

from __future__ import annotations

import importlib
import importlib.util
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import dreba
from dreba.export.joint_map import read_map
from reba.posture.columns import COLUMNS
from tests.dreba.export.test_export import ARGUMENTS, CASES, columns, model
from tests.support.paths import ROOT

HUMAN = ROOT / "examples" / "human_urdf.toml"
GIVEN = {"load": 6.0, "coupling": (1.0, 2.0), "activity": 1.0}


def imported(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def torch_function(path: Path, poses: np.ndarray, **given: object) -> tuple[np.ndarray, np.ndarray]:
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    angles = torch.tensor(poses, dtype=torch.float64, requires_grad=True)
    value = imported(path).dreba(angles, **given)
    (gradient,) = torch.autograd.grad(value.sum(), angles)
    return value.detach().numpy(), gradient.numpy()


def jax_function(path: Path, poses: np.ndarray, **given: object) -> tuple[np.ndarray, np.ndarray]:
    jax = pytest.importorskip("jax", reason="JAX is not installed")
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_disable_most_optimizations", True)  # the results are the same and compiled sooner
    function = imported(path).dreba
    value, pull = jax.vjp(lambda angles: function(angles, **given), poses)
    return np.asarray(value), np.asarray(pull(jax.numpy.ones_like(value))[0])


LONG = {"soft", "graduated"}
"""Models whose source is long."""
LIBRARIES = {"torch": torch_function, "jax": jax_function}


def values(library: str, path: Path, poses: np.ndarray, **given: object) -> np.ndarray:
    """Return the values alone, neither compiled nor differentiated."""
    angles = importlib.import_module(library).tensor(poses) if library == "torch" else poses
    return np.asarray(imported(path).dreba(angles, **given))


# JAX compiles every operation of every shape: the longest source takes 9 s.
@pytest.mark.parametrize(
    ("library", "name", "temperature"),
    [
        pytest.param(library, *case, marks=pytest.mark.slow if library == "jax" and case[0] in LONG else ())
        for library in LIBRARIES
        for case in CASES
    ],
)
def test_value_and_derivative_are_those_of_the_model(
    library: str, name: str, temperature: float | None, tmp_path: Path
) -> None:
    pytest.importorskip(library, reason=f"{library} is not installed")
    path = dreba.export_model(model(name), tmp_path / "cost", to=library, temperature=temperature)
    assert path.suffix == ".py"
    poses = dreba.sample(40, rng=52).angles[:, columns(model(name))]
    every = {**GIVEN, "load": np.linspace(0.0, 15.0, 40)}
    for rows, given in ((poses, {}), (poses, GIVEN), (poses[3], GIVEN), (poses, every)):
        value, gradient = LIBRARIES[library](path, rows, **given)
        expected, slope = model(name).value_and_gradient(rows, temperature=temperature, **given)
        assert value == pytest.approx(expected, abs=1e-10)
        assert gradient == pytest.approx(slope, abs=1e-10)
    if library == "jax":
        compiled = importlib.import_module("jax").jit(partial(imported(path).dreba, **every))
        assert compiled(poses) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("library", LIBRARIES)
@pytest.mark.parametrize("name", ["quadratic", "convex", "soft"])
def test_what_python_refuses_is_not_a_number(library: str, name: str, tmp_path: Path) -> None:
    pytest.importorskip(library, reason=f"{library} is not installed")
    path = dreba.export_model(model(name), tmp_path / "cost", to=library)
    poses = dreba.sample(22, rng=52).angles
    wrong = poses.copy()
    wrong[np.arange(22), np.arange(22)] = np.resize([np.nan, np.inf, -np.inf], 22)
    assert np.isnan(values(library, path, wrong)).all()
    for given in ARGUMENTS:
        assert np.isnan(values(library, path, poses, **given)).all(), given


@pytest.mark.parametrize("library", LIBRARIES)
@pytest.mark.parametrize("name", ["quadratic", "convex", "soft"])
def test_another_number_of_joints_is_refused(library: str, name: str, tmp_path: Path) -> None:
    pytest.importorskip(library, reason=f"{library} is not installed")
    path = dreba.export_model(model(name), tmp_path / "cost", to=library)
    for shape in ((21,), (4, 23), ()):
        with pytest.raises(ValueError, match=r"expected \(\.\.\., 22\)"):  # indices past the end are clamped in JAX
            values(library, path, np.zeros(shape))


@pytest.mark.parametrize("library", ["torch", pytest.param("jax", marks=pytest.mark.slow)])
def test_the_joints_of_a_map_are_taken(library: str, tmp_path: Path) -> None:
    pytest.importorskip(library, reason=f"{library} is not installed")
    own = read_map(HUMAN, COLUMNS)
    path = dreba.export_model(model("soft"), tmp_path / "cost", to=library, joint_map=HUMAN)
    q = np.random.default_rng(1).uniform(-0.4, 0.9, (10, len(own.joints)))
    value, gradient = LIBRARIES[library](path, q, **GIVEN)
    expected, slope = model("soft").value_and_gradient(own.offset + q @ own.matrix.T, **GIVEN)
    assert value == pytest.approx(expected, abs=1e-8)
    assert gradient == pytest.approx(slope @ own.matrix, abs=1e-6)


def test_the_sources_import_their_library_only(tmp_path: Path) -> None:
    for library, line in (("torch", "import torch as _lib"), ("jax", "import jax.numpy as _lib")):
        text = dreba.export_model(model("soft"), tmp_path / library, to=library, name="cost").read_text()
        assert [part for part in text.splitlines() if part.startswith(("import", "from"))] == [line]
        assert "def cost(joints, load=0.0, coupling=(0.0, 0.0), activity=0.0):" in text
        compile(text, "cost.py", "exec")
