"""What is built holds every file of the packages: data that is forgotten is missed only where nobody has a checkout."""

from __future__ import annotations

import tomllib

import pytest

from tests.support.paths import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
DATA: dict[str, list[str]] = PROJECT["tool"]["setuptools"]["package-data"]
LEFT_OUT = {".py", ".pyc"}


@pytest.mark.parametrize("package", ["reba", "dreba", "lgp"])
def test_every_data_file_is_in_the_wheel(package: str) -> None:
    folder = ROOT / package
    covered = {path for pattern in DATA[package] for path in folder.glob(pattern)}
    there = {path for path in folder.rglob("*") if path.is_file() and path.suffix not in LEFT_OUT}
    assert sorted(str(path.relative_to(ROOT)) for path in there - covered) == []


@pytest.mark.parametrize("package", ["reba", "dreba", "lgp"])
def test_no_pattern_is_without_a_file(package: str) -> None:
    assert [pattern for pattern in DATA[package] if not list((ROOT / package).glob(pattern))] == []


@pytest.mark.parametrize("package", ["reba", "dreba", "lgp"])
def test_every_folder_with_code_is_a_package(package: str) -> None:
    """A folder without `__init__.py` is not found when the wheel is built."""
    folders = {path.parent for path in (ROOT / package).rglob("*.py")}
    assert [str(folder.relative_to(ROOT)) for folder in folders if not (folder / "__init__.py").is_file()] == []


@pytest.mark.parametrize("package", ["reba", "dreba", "lgp"])
def test_every_package_says_that_it_is_typed(package: str) -> None:
    assert (ROOT / package / "py.typed").is_file()
