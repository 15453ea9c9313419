"""Poses again with random load, coupling and activity, so that a model learns what these add to a posture."""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from dreba.domain import Domain
from dreba.sampling.classes import true_scores
from dreba.sampling.distribution import load_bins
from dreba.sampling.poses import Poses
from dreba.surrogates.task_factors import HIGHEST_POINTS, MODELLED
from reba.arrays import Array
from reba.posture.columns import SIDES
from reba.posture.factors import ACTIVITIES, COUPLINGS, FACTORS, Factors, codes

EVERY: Final = 5
"""One pose of so many is repeated with factors, the share of the shipped soft tables: the error without factors, which
stands beside Table I, hardly changes."""
PRESENT: Final = 0.5
"""Share of the repeated poses in which a factor is drawn, so that it is also seen alone."""


def with_factors(poses: Poses, rng: np.random.Generator, weights: Array | None = None) -> tuple[Poses, Array | None]:
    """Return poses followed by a part of them with random factors, and the weights of all.

    Factors are drawn independently of the posture, and the true scores are those with them. Poses of one REBA class
    would not do: high factors stand there beside good postures, and both would seem to matter less. Of load, coupling
    and activity only those are drawn that are the same in all poses; if none is, the poses are returned as they are.

    Where poses have weights (n,), of mean 1, all are repeated, each with the same weight and the same share of all:
    otherwise the few poses of a rare class, which weigh much, would decide what a factor adds.

    Example:
        >>> import dreba
        >>> loaded, _ = with_factors(dreba.sample(1000, rng=1), np.random.default_rng(0))
        >>> len(loaded), bool(loaded.factors.load.max() > 10.0)
        (1200, True)
    """
    given = Factors() if poses.factors is None else poses.factors
    fields = {name: _fields(name) for name in MODELLED}
    missing = [name for name in MODELLED if not any(_varies(getattr(given, field)) for field in fields[name])]
    again = np.arange(0, len(poses), EVERY if weights is None else 1)
    if not missing:
        return poses, weights
    domain = Domain.from_dict(poses.provenance["domain"])
    loaded = poses.rows(again)
    changes: dict[str, Any] = {}
    for name in missing:
        present = rng.random(len(again)) < PRESENT
        for field, values in _drawn(name, domain, len(again), rng).items():
            own = np.broadcast_to(np.asarray(getattr(given, field)), len(poses))[again]
            changes[field] = np.where(present, values, _coded(field, own))
    factors = dataclasses.replace(loaded.factors or Factors(), **changes)
    scores = true_scores(domain, loaded.angles, factors)
    together = Poses(
        np.concatenate([poses.angles, loaded.angles]),
        np.concatenate([poses.reba, scores]),
        Factors(**{name: _joined(name, given, factors, len(poses), len(again)) for name in FACTORS}),
        {**poses.provenance, "with_factors": {"poses": len(again), "drawn": missing}},
    )
    return together, None if weights is None else np.append(weights, np.full(len(again), 1.0 / EVERY))


def _fields(name: str) -> tuple[str, ...]:
    """Return the fields of `reba.Factors` of one factor of a surrogate."""
    return {"load": ("load",), "coupling": tuple(f"coupling_{side}" for side in SIDES), "activity": ACTIVITIES}[name]


def _varies(values: Any) -> bool:
    array = np.asarray(values)
    return bool(array.ndim and (array != array.flat[0]).any())


def _drawn(name: str, domain: Domain, n: int, rng: np.random.Generator) -> dict[str, Any]:
    """Return random values (n,) of the fields of a factor; each class of points has the same probability."""
    if name == "load":
        low, high = load_bins(domain)[rng.integers(0, 3, n)].T
        return {"load": high - (high - low) * rng.random(n)}
    if name == "coupling":
        return {field: rng.integers(0, HIGHEST_POINTS + 1, n) for field in _fields(name)}
    points, order = rng.integers(0, len(ACTIVITIES) + 1, n), rng.random((n, len(ACTIVITIES))).argsort(axis=1)
    return {field: order[:, index] < points for index, field in enumerate(ACTIVITIES)}


def _coded(field: str, values: Any) -> Any:
    """Return values of a field as numbers or flags, words of the coupling as points."""
    return codes(field, values, COUPLINGS, len(values)) if field.startswith("coupling") else values


def _joined(field: str, given: Factors, loaded: Factors, n: int, m: int) -> Any:
    """Return the values (n + m,) of a field of both, a scalar where both are the same scalar."""
    first, second = getattr(given, field), getattr(loaded, field)
    if not np.ndim(first) and not np.ndim(second):
        return first
    parts = [_coded(field, np.broadcast_to(np.asarray(values), size)) for values, size in ((first, n), (second, m))]
    return np.concatenate(parts)
