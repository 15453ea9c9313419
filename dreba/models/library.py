"""All kinds of surrogate together: importing this module fills the registry."""

from __future__ import annotations

from dreba.convex import ConvexModel
from dreba.graduated import GraduatedModel
from dreba.model import KINDS, About, Surrogate
from dreba.net import NetModel
from dreba.quadratic import QuadraticModel
from dreba.soft import SoftModel

__all__ = [
    "KINDS",
    "About",
    "ConvexModel",
    "GraduatedModel",
    "NetModel",
    "QuadraticModel",
    "SoftModel",
    "Surrogate",
]
