"""dREBA: differentiable surrogates of the REBA posture score (Busch, Toussaint & Lopes 2018, section II).

Poses evenly filled over the REBA classes, models that are fitted to them in seconds, and their error per class.
"""

from __future__ import annotations

from dreba.domain import Bins, Domain, domain_of
from dreba.errors import DomainError, ModelError, RadiansWarning, SampleError
from dreba.files import load, models
from dreba.model import KINDS, About, Surrogate
from dreba.poses import Poses, read_poses
from dreba.sample import sample

__all__ = [
    "KINDS",
    "About",
    "Bins",
    "Domain",
    "DomainError",
    "ModelError",
    "Poses",
    "RadiansWarning",
    "SampleError",
    "Surrogate",
    "domain_of",
    "load",
    "models",
    "read_poses",
    "sample",
]
