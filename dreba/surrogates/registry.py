"""The registry of surrogate kinds: name -> class, filled by the decorator `register` where a kind is defined."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

_Kind = TypeVar("_Kind")

KINDS: Final[dict[str, type[Any]]] = {}
"""Every kind of surrogate by its name."""


def register(kind: type[_Kind]) -> type[_Kind]:
    """Enter a kind into `KINDS` under its `kind` name (a class decorator)."""
    KINDS[kind.kind] = kind  # type: ignore[attr-defined]
    return kind


@dataclass(frozen=True)
class ModelInfo:
    """Where a fitted model comes from and how good it is; saved with it.

    Attributes:
        domain: the domain of its poses as plain data (`Domain.to_dict()`), empty if unknown.
        rmse: root mean square error per REBA class ("1" .. "15"), on held-out poses, or where `provenance` says so on
            those of the fit.
        provenance: seed, number of poses, rules, package version, command.
    """

    domain: dict[str, Any] = field(default_factory=dict)
    rmse: dict[str, float] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
