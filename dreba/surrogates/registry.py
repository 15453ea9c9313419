"""Registry of surrogate kinds, name -> class, and the origin of a fitted model."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

_Kind = TypeVar("_Kind")

KINDS: Final[dict[str, type[Any]]] = {}
"""Kinds of surrogates by name, filled by the decorator `register` of each kind."""


def register(kind: type[_Kind]) -> type[_Kind]:
    """Add a class to `KINDS` under its `kind` (class decorator)."""
    KINDS[kind.kind] = kind  # type: ignore[attr-defined]
    return kind


@dataclass(frozen=True)
class ModelInfo:
    """Origin and error of a fitted model, part of its file.

    Attributes:
        domain: domain of its poses as plain data (`Domain.to_dict()`), empty if unknown.
        rmse: root mean square error per REBA class ("1" .. "15"); `provenance["rmse_on"]` names the poses.
        provenance: seed, number of poses, rules, package version, command.
    """

    domain: dict[str, Any] = field(default_factory=dict)
    rmse: dict[str, float] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
