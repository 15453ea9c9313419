"""Check that the running environment has the lowest version that pyproject.toml declares of every direct dependency.

A bound below every release that can be installed is tested by nobody; it is named here, with the version to declare.
"""

from __future__ import annotations

import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

from packaging.requirements import Requirement
from packaging.version import Version

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def main() -> int:
    declared = [
        *PROJECT["dependencies"],
        *(one for extra in PROJECT["optional-dependencies"].values() for one in extra),
    ]
    wrong = []
    for requirement in map(Requirement, declared):
        if requirement.name == PROJECT["name"] or (requirement.marker and not requirement.marker.evaluate()):
            continue
        lowest = [Version(one.version) for one in requirement.specifier if one.operator == ">="]
        if lowest != [Version(version(requirement.name))]:
            wrong.append(f"{requirement}: {version(requirement.name)} is installed; declare that version")
    print(*wrong, sep="\n", end="\n" if wrong else "")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
