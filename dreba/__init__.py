"""dREBA: differentiable surrogates of the REBA posture score (Busch, Toussaint & Lopes 2018, section II).

Poses evenly filled over the REBA classes, models that are fitted to them in seconds, and their error per class.

>>> import dreba
>>> poses = dreba.sample(10_000, classes=range(1, 11), rng=1)
>>> model = dreba.QuadraticModel().fit(poses.angles, poses.reba)
>>> dreba.evaluate(model, dreba.sample(5_000, rng=2)).rmse < 1.8
True
>>> model.gradient(poses.angles[0]).shape
(22,)
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from dreba.domain import Bins, Domain, domain_of
from dreba.errors import DomainError, ModelError, RadiansWarning, SampleError
from dreba.evaluate import PUBLISHED, Evaluation, evaluate, fit_to
from dreba.files import load, models
from dreba.payload import delta_payload
from dreba.poses import Poses
from dreba.recordings import read_poses
from dreba.sample import sample

if TYPE_CHECKING:
    from dreba.kinds import (
        KINDS,
        About,
        ConvexModel,
        GraduatedModel,
        NetModel,
        QuadraticModel,
        SoftModel,
        Surrogate,
    )

__all__ = [
    "KINDS",
    "PUBLISHED",
    "About",
    "Bins",
    "ConvexModel",
    "Domain",
    "DomainError",
    "Evaluation",
    "GraduatedModel",
    "ModelError",
    "NetModel",
    "Poses",
    "QuadraticModel",
    "RadiansWarning",
    "SampleError",
    "SoftModel",
    "Surrogate",
    "delta_payload",
    "domain_of",
    "evaluate",
    "fit_to",
    "load",
    "models",
    "read_poses",
    "sample",
]


def __getattr__(name: str) -> Any:
    """Return a model class on first use: their base classes load scikit-learn and with it SciPy, for over a second."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module("dreba.kinds"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
