"""Names of exported functions: what compilers know is refused, and no two exports have an identifier in common."""

from __future__ import annotations

import itertools
import re
import shutil
import subprocess
from pathlib import Path

import pytest

import dreba
from dreba.export.c import c_header, c_source
from dreba.export.function_names import DERIVED, LONGEST, check_name
from dreba.export.joint_map import JointMap, read_map
from tests.dreba.export.test_export import HESSIANS, model
from tests.support.paths import ROOT


@pytest.mark.parametrize(("command", "language"), [("gcc", "gnu17"), ("gcc", "c99"), ("g++", "gnu++17")])
def test_every_name_that_the_headers_take_is_refused(command: str, language: str, tmp_path: Path) -> None:
    compiler = shutil.which(command)
    if compiler is None:
        pytest.skip(f"no {command} on this machine")
    source = tmp_path / ("names.cpp" if command == "g++" else "names.c")
    source.write_text("#include <float.h>\n#include <math.h>\n#include <stddef.h>\n")
    flags = [compiler, f"-std={language}", str(source)]
    seen = [
        subprocess.run([*flags, "-E", *more], check=True, capture_output=True, text=True).stdout
        for more in ([], ["-dM"])
    ]
    names = [name for name in sorted(set(re.findall(r"\b[A-Za-z]\w*", "".join(seen)))) if not refused(name)]
    lines = [f"double {name}(const double *angles, double load);" for name in names]
    before = source.read_text() + ('extern "C" {\n' if command == "g++" else "\n")
    source.write_text(before + "\n".join(lines) + ("\n}\n" if command == "g++" else "\n"))
    result = subprocess.run([*flags, "-fsyntax-only"], check=False, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr[:2000]


def refused(name: str) -> bool:
    try:
        check_name(name)
    except dreba.ModelError:
        return True
    return False


@pytest.mark.parametrize(
    "name", ["dreba", "cost", "reba_soft", "Cost2", "my_model_left", "soft2", "f1", "left", "logistic"]
)
def test_other_names_are_taken(name: str) -> None:
    check_name(name)


def sources(name: str, own: JointMap) -> str:
    """Return the C sources and headers of a name, of every kind, Hessian and map, one behind the other."""
    return "".join(
        text
        for kind, hessian in HESSIANS
        if kind != "convex, one arm"
        for joint_map in (None, own)
        for text in (
            c_source(model(kind), name=name, hessian=hessian, joint_map=joint_map),
            c_header(model(kind), file="cost.c", name=name, hessian=hessian, joint_map=joint_map),
        )
    )


def test_no_two_exports_have_an_identifier_in_common() -> None:
    own = read_map(ROOT / "examples" / "human_urdf.toml", model("quadratic").joints_)
    endings = {word.removeprefix("name_") for word in re.findall(r"\bname_\w+", sources("name", own))}
    assert endings == DERIVED
    bases = ["cost", "Cost", "cost2", "left_cost", "map", "smooth", "table"]
    once = [f"{base}_{ending}" for base in bases for ending in sorted(DERIVED)]
    twice = [f"{name}_{ending}" for name in once for ending in sorted(DERIVED)]
    parts = [f"{base}_{part}" for base in bases for ending in DERIVED for part in ending.split("_")]
    names = sorted({name for name in (*bases, *once, *twice, *parts) if not refused(name)})
    assert len(names) > len(bases)
    assert not set(names) & {*once, *twice}
    owner: dict[str, str] = {}
    for name in names:
        for word in (name, *(f"{name}_{ending}" for ending in endings)):
            assert owner.setdefault(word, name) == name


def test_no_local_variable_hides_what_belongs_to_a_name() -> None:
    own = read_map(ROOT / "examples" / "human_urdf.toml", model("quadratic").joints_)
    code = re.sub(r"/\*.*?\*/", "", sources("name", own), flags=re.DOTALL)
    words = {word for word in re.findall(r"\b[A-Za-z]\w*", code) if not word.startswith("name")}
    assert "angles" in words
    # A function of the name knee would call a local variable knee_bend.
    assert not [word for word in words for ending in DERIVED if word.endswith(f"_{ending}")]


def test_names_that_differ_in_capitals_fit_into_one_file(tmp_path: Path) -> None:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no compiler on this machine")
    names = ["cost", "Cost", "knee", "x" * LONGEST]
    for name, (kind, hessian) in itertools.product(names, [("convex", "exact"), ("soft", "exact")]):
        dreba.export_model(model(kind), tmp_path / f"{name}.c", to="c", name=name, hessian=hessian)
        lines = "".join(f'#include "{path.name}"\n' for path in sorted(tmp_path.glob("*.[ch]")) if path.stem in names)
        (tmp_path / "all.c.txt").write_text(lines)
        command = [compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-fsyntax-only", "-x", "c"]
        subprocess.run([*command, "all.c.txt"], check=True, cwd=tmp_path)
