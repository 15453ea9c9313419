"""Errors of `dreba`: the same one-line family as `reba`, so `except ValueError` and `except RebaError` both work."""

from __future__ import annotations

from reba.errors import RadiansWarning, RebaError

__all__ = ["DomainError", "ModelError", "RadiansWarning", "SampleError"]


class ModelError(RebaError):
    """A model cannot be fitted, evaluated, saved or loaded as asked."""


class DomainError(RebaError):
    """A domain of poses is unknown, or its limits or bins are wrong."""


class SampleError(RebaError):
    """Poses cannot be drawn, saved or loaded as asked."""
