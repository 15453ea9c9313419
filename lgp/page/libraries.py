"""reveal.js and three.js: files of Python packages that are copied beside a page with their licences."""

from __future__ import annotations

import tomllib
from fnmatch import fnmatch
from functools import cache
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

from lgp.errors import LgpError

TABLE = Path(__file__).parent / "data" / "libraries.toml"


@cache
def table() -> dict[str, Any]:
    """Return what is needed and where it is (read once)."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


def check() -> None:
    """Raise the one line that says what to install, if anything that a page needs is missing.

    Raises:
        LgpError: a package is not installed.
    """
    for module, package in table()["modules"].items():
        try:
            import_module(module)
        except ImportError as error:
            raise _missing(package) from error
    library_files()


def library_files() -> dict[str, Path]:
    """Return name in the page -> file of a library.

    Raises:
        LgpError: the package that carries it is not installed, or its files are elsewhere.
    """
    found = {}
    for library in table()["libraries"]:
        try:
            distribution = metadata.distribution(library["package"])
        except metadata.PackageNotFoundError as error:
            raise _missing(library["package"]) from error
        carried = sorted(str(file) for file in distribution.files or ())
        for name, pattern in library["files"].items():
            inside = [file for file in carried if fnmatch(file, pattern)]
            if not inside:
                raise LgpError(
                    f"{library['package']} {distribution.version} has no {pattern}; install {library['works']}"
                )
            found[name] = Path(str(distribution.locate_file(inside[-1])))
    return found


def _missing(package: str) -> LgpError:
    return LgpError(f"the page needs the package {package}; install it with: pip install 'dreba[page]'")
