"""All kinds of surrogates (importing this module fills the registry), and models read from files."""

from __future__ import annotations

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
from reba.checks import PATH, accepts
from reba.files import from_json
from reba.open_file import read_settings

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
"""Folder of the shipped model files."""


@accepts(ModelError, path=PATH)
def load(path: str | Path) -> Surrogate:
    """Return the model of a file, or a shipped model by its name (`models()`).

    Args:
        path: model file, or name of a shipped model, such as "quadratic".

    Raises:
        ModelError: there is no such file or name, it is not JSON, of a newer version, or damaged.

    Example:
        >>> load("quadratic").kind
        'quadratic'
    """
    shipped = models()
    if str(path) == GraduatedModel.kind:
        # The name of a file of earlier versions: the same parameters in the form that has stages.
        return GraduatedModel.of(load("convex"), load("soft"))
    try:
        text = read_settings(SHIPPED / f"{path}.json" if str(path) in shipped else path)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ModelError(
            f"{path}: cannot be read as a model ({reason}); give a file, or one of {', '.join(shipped)}"
        ) from error
    try:
        return from_dict(from_json(text))
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from error
    except (RecursionError, ValueError) as error:
        raise ModelError(f"{path}: not JSON ({error}); the file is damaged") from error


def models() -> tuple[str, ...]:
    """Return the names of the shipped models."""
    return tuple(sorted(file.stem for file in SHIPPED.glob("*.json")))
