"""All kinds of surrogate together: importing this module fills the registry."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

from dreba.errors import ModelError
from dreba.surrogates.base import Surrogate
from dreba.surrogates.convex import ConvexModel
from dreba.surrogates.graduated import GraduatedModel
from dreba.surrogates.quadratic import QuadraticModel
from dreba.surrogates.registry import KINDS, ModelInfo
from dreba.surrogates.relu_network import NetModel
from dreba.surrogates.serialization import from_dict
from dreba.surrogates.soft import SoftModel

__all__ = [
    "KINDS",
    "ConvexModel",
    "GraduatedModel",
    "ModelInfo",
    "NetModel",
    "QuadraticModel",
    "SoftModel",
    "Surrogate",
    "load",
    "models",
]

SHIPPED: Final = Path(__file__).parent / "shipped"
"""Where the model files of the package are."""


def load(path: str | Path) -> Surrogate:
    """Read a model file, or a model of the package by its name ("quadratic").

    Raises:
        ModelError: no such file or name, not JSON, a newer version, or damaged.
    """
    shipped = models()
    try:
        if str(path) in shipped:
            text = SHIPPED.joinpath(f"{path}.json").read_text(encoding="utf-8")
        else:
            text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ModelError(
            f"{path}: cannot be read as a model ({reason}); give a file, or one of {', '.join(shipped)}"
        ) from error
    try:
        return from_dict(json.loads(text, parse_constant=_no_constant))
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from error
    except (RecursionError, ValueError) as error:
        raise ModelError(f"{path}: not JSON ({error}); the file is damaged") from error


def models() -> tuple[str, ...]:
    """Return the names of the models that come with the package."""
    return tuple(sorted(file.stem for file in SHIPPED.glob("*.json")))


def _no_constant(name: str) -> float:
    raise ModelError(f"holds {name}; the file is damaged")
