"""dREBA: differentiable surrogates of the REBA posture score (Busch, Toussaint & Lopes 2018, section II).

Poses drawn evenly over the REBA classes, models fitted to them in seconds, and their error per class.

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

TYPE_CHECKING = False  # that of typing takes long to import, and Ctrl-C is not handled yet
if TYPE_CHECKING:
    from typing import Any

    from dreba.domain import Bins, Domain, domain_of
    from dreba.errors import DomainError, FactorWarning, ModelError, RadiansWarning, SampleError
    from dreba.evaluation.evaluate import compare, evaluate, fit_to
    from dreba.export import export_model
    from dreba.report import write_report
    from dreba.sampling.poses import Poses, read_poses
    from dreba.sampling.sample import sample
    from dreba.surrogates.base import Surrogate
    from dreba.surrogates.convex import ConvexModel
    from dreba.surrogates.graduated import GraduatedModel
    from dreba.surrogates.library import KINDS, load, models
    from dreba.surrogates.metrics import PUBLISHED, Evaluation
    from dreba.surrogates.quadratic import QuadraticModel
    from dreba.surrogates.registry import ModelInfo
    from dreba.surrogates.relu_network import NetModel
    from dreba.surrogates.soft import SoftModel
    from dreba.surrogates.task_factors import delta_payload

__all__ = [
    "KINDS",
    "PUBLISHED",
    "Bins",
    "ConvexModel",
    "Domain",
    "DomainError",
    "Evaluation",
    "FactorWarning",
    "GraduatedModel",
    "ModelError",
    "ModelInfo",
    "NetModel",
    "Poses",
    "QuadraticModel",
    "RadiansWarning",
    "SampleError",
    "SoftModel",
    "Surrogate",
    "compare",
    "delta_payload",
    "domain_of",
    "evaluate",
    "export_model",
    "fit_to",
    "load",
    "models",
    "read_poses",
    "sample",
    "write_report",
]
_LAZY = {
    "dreba.domain": ("Bins", "Domain", "domain_of"),
    "dreba.errors": ("DomainError", "FactorWarning", "ModelError", "RadiansWarning", "SampleError"),
    "dreba.evaluation.evaluate": ("compare", "evaluate", "fit_to"),
    "dreba.export": ("export_model",),
    "dreba.report": ("write_report",),
    "dreba.surrogates.library": (
        "KINDS",
        "ModelInfo",
        "ConvexModel",
        "GraduatedModel",
        "NetModel",
        "QuadraticModel",
        "SoftModel",
        "Surrogate",
        "load",
        "models",
    ),
    "dreba.surrogates.metrics": ("PUBLISHED", "Evaluation"),
    "dreba.surrogates.task_factors": ("delta_payload",),
    "dreba.sampling.poses": ("Poses", "read_poses"),
    "dreba.sampling.sample": ("sample",),
}
"""Imported on first use: the base classes of models load scikit-learn and SciPy, which takes over a second, and the
commands handle interrupts before anything large is imported."""


def __getattr__(name: str) -> Any:
    for module, names in _LAZY.items():
        if name in names:
            try:
                return getattr(importlib.import_module(module), name)
            except ModuleNotFoundError as error:
                from reba.extras import missing

                raise missing(error.name or "", f"dreba.{name}") from error
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
