"""Random poses, evenly filled over REBA classes, without rejection.

The distribution, in the order of drawing:

1. The class is uniform over the classes asked for (their counts differ by one at most).
2. Given the class, the pose follows the domain's own distribution *conditioned on that class*. Before conditioning
   every angle is independent: it falls into one of its bins (the classes of the rules, cut at the domain's limits) and
   is uniform inside. How likely the bins are is `weights`:
   "bins" (default): each bin of an angle is equally likely, as in the sampler of the paper's authors. Every threshold
   then has poses on both sides, however narrow a band is.
   "volume": in proportion to width. Within a class the poses are then uniform draws over the limits that have it.
   "cells": every combination of part scores that leads to the class is equally likely, uniform within it.

Because parts depend on separate angles, the conditional distribution is drawn exactly: first the pair of Score A and
Score B (both arms, load, coupling and activity included), then part scores that lead to them, then boxes, then angles.
Class 1 is 1e-5 to 1e-4 of uniform draws, so rejection would need 10^5 draws per pose.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np

from dreba.domain import Domain, domain_of
from dreba.errors import SampleError
from dreba.sampling.classes import WEIGHTS, Weights, true_scores
from dreba.sampling.distribution import SamplingPlan
from dreba.sampling.poses import Poses
from reba._version import __version__
from reba.posture.columns import ANGLES, SIDES
from reba.posture.factors import Factors

Rng = np.random.Generator | int | tuple[int, ...] | None
FACTOR_NAMES: Final = ("load", "coupling", "activity")
"""Factors that can be drawn."""
ADJUSTMENTS: Final = (
    "trunk_side_bend", "trunk_twist", "neck_side_bend", "neck_twist", "upper_arm_abduction", "shoulder_elevation",
    "wrist_deviation", "wrist_twist",
)  # fmt: skip
"""Angles that only give an adjustment."""
MOST: Final = 20_000_000
"""Poses drawn at once at most; they take 8 GB."""
_ARM: Final = (
    "upper_arm_flexion", "upper_arm_abduction", "shoulder_elevation", "lower_arm_flexion", "wrist_flexion",
    "wrist_deviation", "wrist_twist",
)  # fmt: skip


def sample(
    n: int,
    classes: Iterable[int] = range(1, 11),
    *,
    domain: str | Domain = "human",
    rng: Rng = None,
    weights: Weights = "bins",
    stratified: bool = False,
    factors: Sequence[str] | Factors | None = None,
    adjustments: bool = True,
    arms: str = "both",
) -> Poses:
    """Draw poses evenly over REBA classes. The module's text says from which distribution.

    Args:
        n: number of poses.
        classes: REBA scores to fill; up to 11 without factors, up to 15 with them.
        domain: name, TOML file or record.
        rng: generator, or a seed (a whole number or several); None for a fresh seed, which is recorded.
        weights: "bins", "volume" or "cells".
        stratified: within each class keep the counts of Scores A and B, and within these of the part scores, within
            one of their expectation, instead of drawing them independently.
        factors: names of factors to draw ("load", "coupling", "activity"), or a record of scalars that all poses share.
        adjustments: whether angles that only adjust a part score are drawn; otherwise they are held at 0.
        arms: "both", or "left" or "right": the other arm is held at rest.

    Raises:
        SampleError: an argument is wrong, or a class cannot be reached in the domain.

    Example:
        >>> poses = sample(1000, classes=range(1, 11), rng=7)
        >>> poses.counts[1], poses.counts[10]
        (100, 100)
    """
    wanted = _classes(classes)
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or not len(wanted) <= n <= MOST:
        raise SampleError(
            f"n is {n!r}; expected a whole number, at least one pose for each of {len(wanted)} classes, "
            f"at most {MOST:,} (draw more in parts, each with a seed of its own)"
        )
    if weights not in WEIGHTS:
        raise SampleError(f"weights are {weights!r}; expected one of {', '.join(WEIGHTS)}")
    fixed, drawn = _factors(factors)
    space = _held(domain_of(domain), adjustments, arms)
    generator, seed = _generator(rng)
    plan = SamplingPlan(space, fixed, drawn, weights)
    shares = np.full(len(wanted), n // len(wanted)) + (np.arange(len(wanted)) < n % len(wanted))
    angles, found = plan.draw(wanted, shares, generator, stratified)
    used = found if drawn else (fixed if factors is not None else None)
    provenance = {
        "domain": space.to_dict(), "n": int(n), "classes": list(wanted), "weights": weights, "stratified": stratified,
        "factors": list(drawn), **_shared(factors), "adjustments": adjustments, "arms": arms, **seed,
        "version": __version__,
    }  # fmt: skip
    return Poses(angles, true_scores(space, angles, used), used, provenance)


def _held(domain: Domain, adjustments: bool, arms: str) -> Domain:
    """Return the domain with the angles held that are not drawn."""
    if arms not in ("both", *SIDES):
        raise SampleError(f"arms is {arms!r}; expected both, left or right")
    held = {}
    for angle in ANGLES:
        for column in angle.columns:
            if not adjustments and angle.name in ADJUSTMENTS:
                held[column] = 0.0
            if arms in SIDES and angle.name in _ARM and not column.endswith(arms):
                held[column] = angle.best
    return domain.hold(**held)


def _classes(classes: Iterable[int]) -> tuple[int, ...]:
    try:
        wanted = tuple(classes)
    except TypeError as error:
        raise SampleError(f"classes are {classes!r}; expected REBA scores such as range(1, 11)") from error
    if not wanted or len(set(wanted)) != len(wanted):
        raise SampleError(f"classes are {wanted}; expected each REBA score once, at least one")
    for score in wanted:
        if isinstance(score, bool) or not isinstance(score, int | np.integer) or not 1 <= score <= 15:
            raise SampleError(f"class {score!r} is no REBA score; expected whole numbers from 1 to 15")
    return tuple(int(score) for score in wanted)


def _factors(given: Sequence[str] | Factors | None) -> tuple[Factors, tuple[str, ...]]:
    """Return factors that all poses share, and the names of those that are drawn."""
    if given is None:
        return Factors(), ()
    if isinstance(given, Factors):
        if any(np.ndim(value) for value in dataclasses.asdict(given).values()):
            raise SampleError("factors hold an array; expected one value each, or the names of factors to draw")
        return given, ()
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise SampleError(f"factors are {given!r}; expected a list of names out of {', '.join(FACTOR_NAMES)}")
    for name in given:
        if name not in FACTOR_NAMES:
            raise SampleError(f"factor {name!r} cannot be drawn; expected names out of {', '.join(FACTOR_NAMES)}")
    return Factors(), tuple(name for name in FACTOR_NAMES if name in given)


def _shared(given: Any) -> dict[str, Any]:
    """Return the factors that all poses share, as provenance; nothing if there are none."""
    return {"shared_factors": dataclasses.asdict(given)} if isinstance(given, Factors) else {}


def _generator(rng: Rng) -> tuple[np.random.Generator, dict[str, Any]]:
    """Return a generator and what it takes to start it again."""
    if isinstance(rng, np.random.Generator):
        state = rng.bit_generator.state
        return rng, {"seed": None, "generator": {key: _listed(value) for key, value in state.items()}}
    seeds = list(rng) if isinstance(rng, tuple) else [rng]
    if rng is None:
        seeds = [int(np.random.SeedSequence().generate_state(1)[0])]
    if not seeds or any(isinstance(s, bool) or not isinstance(s, int | np.integer) or s < 0 for s in seeds):
        raise SampleError(f"rng is {rng!r}; expected a numpy Generator or a seed, whole numbers from 0")
    whole = [int(seed) for seed in seeds if seed is not None]
    return np.random.default_rng(whole), {"seed": whole if len(whole) > 1 else whole[0]}


def _listed(value: Any) -> Any:
    """Return a generator's state as plain data."""
    if isinstance(value, dict):
        return {key: _listed(item) for key, item in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value
