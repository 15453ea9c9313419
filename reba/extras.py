"""Optional packages: which extra of the distribution brings them, and the one line where one is missing.

`pip install dreba` alone brings what `reba` needs; planning, surrogates and the rest come as extras.
"""

from __future__ import annotations

from typing import Final

from reba.errors import RebaError

EXTRAS: Final = {
    "clarabel": "fit",
    "qpsolvers": "fit",
    "scipy": "fit",
    "sklearn": "fit",
    "threadpoolctl": "fit",
    "coal": "plan",
    "lark": "plan",
    "pddl": "plan",
    "pinocchio": "plan",
    "piqp": "plan",
    "qdldl": "plan",
    "example-robot-data": "robots",
    "statsmodels": "experiments",
    "PIL": "page",
    "pyvista": "page",
    "trimesh": "page",
    "mcap_ros2": "run",
    "starlette": "run",
    "uvicorn": "run",
    "foxglove": "live",
    "distributed": "cluster",
    "openpyxl": "xlsx",
}
"""Name of an import -> extra that installs it."""
DISTRIBUTIONS: Final = {
    "PIL": "pillow",
    "foxglove": "foxglove-sdk",
    "mcap_ros2": "mcap-ros2-support",
    "pinocchio": "pin",
    "sklearn": "scikit-learn",
}
"""Name of an import -> name of its package, where they differ."""


class MissingPackageError(RebaError, ImportError):
    """An optional package is not installed; its text names the command that installs it."""


def missing(package: str, purpose: str = "this", extra: str | None = None) -> MissingPackageError:
    """Return the error that says what to install.

    Args:
        package: name of the import, with or without submodules.
        purpose: what needs it, the subject of the sentence.
        extra: that installs it; by default of `EXTRAS`.

    >>> print(missing("sklearn.base", "dreba.load"))
    dreba.load needs the package scikit-learn, which is not installed; run: pip install "dreba[fit]"
    """
    name = package.split(".")[0]
    extra = extra or EXTRAS.get(name)
    name = DISTRIBUTIONS.get(name, name)
    command = f'pip install "dreba[{extra}]"' if extra else f"pip install {name}"
    return MissingPackageError(f"{purpose} needs the package {name}, which is not installed; run: {command}")
