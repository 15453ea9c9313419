"""Errors of `dreba`: one line each, and subclasses of `reba.RebaError`, which is a ValueError."""

from __future__ import annotations

from reba.errors import RadiansWarning, RebaError

__all__ = ["DomainError", "FactorWarning", "ModelError", "RadiansWarning", "SampleError"]


class ModelError(RebaError):
    """A model cannot be fitted, evaluated, saved, loaded or exported with these arguments."""


class ModelTypeError(ModelError, TypeError):
    """A model is fitted to values that are no numbers at all; scikit-learn's tools expect a TypeError."""


class DomainError(RebaError):
    """A domain is unknown, or its limits, rules or bins are wrong."""


class SampleError(RebaError):
    """Poses cannot be drawn, saved or loaded with these arguments."""


class FactorWarning(UserWarning):
    """A factor was given to a model that does not know it, so it changes nothing."""
