"""Random poses with equal numbers in every REBA class, drawn without rejection.

The distribution, in the order of drawing:

1. The class is uniform over the requested classes; their counts differ by one at most.
2. The pose follows the distribution of the domain *conditioned on that class*. Before conditioning the angles are
   independent: each falls into one of its bins (the angle classes of the rules, cut at the limits of the domain) and is
   uniform inside. The probability of the bins is `weights`:
   "bins" (default): the same for each bin of an angle, as in the sampler of the paper's authors. Every threshold then
   has poses on both sides, however narrow the class is.
   "volume": in proportion to the width. Poses of a class are then uniform draws over the limits, kept if they have it.
   "cells": the same for every combination of part scores that leads to the class, uniform within it.

Parts depend on separate angles, so the conditional distribution is drawn exactly: first the pair of Score A and Score B
(both arms, load, coupling and activity included), then part scores that lead to them, then class boxes, then angles.
Class 1 is 1e-5 to 1e-4 of uniform draws, so rejection would need 10^5 draws per pose.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np

from dreba.domain import Domain, domain_of
from dreba.errors import SampleError
from dreba.sampling.classes import WEIGHTS, Weights, true_scores
from dreba.sampling.distribution import SamplingPlan
from dreba.sampling.poses import Poses
from reba.checks import YES_NO, items_of, shown
from reba.posture.columns import ANGLES, INDEX, SIDES
from reba.posture.factors import Factors
from reba.posture.named_angles import warn_if_radians
from reba.provenance import provenance

Rng = np.random.Generator | int | tuple[int, ...] | None
FACTOR_NAMES: Final = ("load", "coupling", "activity")
"""Factors that can be drawn at random."""
ADJUSTMENTS: Final = (
    "trunk_side_bend", "trunk_twist", "neck_side_bend", "neck_twist", "upper_arm_abduction", "shoulder_elevation",
    "wrist_deviation", "wrist_twist",
)  # fmt: skip
"""Angles that give an adjustment only, one point beyond their threshold."""
MOST_CLASSES: Final = 15
"""REBA scores from 1; of longer ranges the first that is none is named."""
MAX_POSES: Final = 20_000_000
"""Maximum number of poses of a call; they take 8 GB."""
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
    """Draw random poses with equal numbers in every REBA class, each with its true score.

    Args:
        n: number of poses.
        classes: REBA scores of the poses; up to 11 without factors, up to 15 with them.
        domain: name, TOML file or `Domain` of the joint limits.
        rng: generator, or a seed (a whole number or several); None for a fresh seed, which is recorded.
        weights: probability of poses inside a class: "bins" (each bin of an angle alike), "volume" (uniform in the
            angles) or "cells" (each combination of part scores alike).
        stratified: keep the counts of Scores A and B in each class, and of the part scores within these, within one
            of their expectation instead of drawing them independently.
        factors: names of factors to draw ("load", "coupling", "activity"), or `reba.Factors` of scalars for all poses.
        adjustments: whether angles that give an adjustment only are drawn; otherwise they are 0.
        arms: "both", or "left" or "right"; the other arm is at rest.

    Raises:
        SampleError: an argument is wrong, or a class cannot be reached in the domain.

    Warns:
        RadiansWarning: the limits of the domain are so small that they look like radians.

    Example:
        >>> poses = sample(1000, classes=range(1, 11), rng=7)
        >>> poses.counts[1], poses.counts[10]
        (100, 100)
    """
    scores = _classes(classes)
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or not len(scores) <= n <= MAX_POSES:
        raise SampleError(
            f"n is {shown(n)}; expected a whole number, at least one pose for each of {len(scores)} classes, "
            f"at most {MAX_POSES:,} (draw more in parts with different seeds)"
        )
    if not isinstance(weights, str) or weights not in WEIGHTS:
        raise SampleError(f"weights are {shown(weights)}; expected one of {', '.join(WEIGHTS)}")
    for name, value in (("stratified", stratified), ("adjustments", adjustments)):
        if not YES_NO.fits(value):
            raise SampleError(f"{name} is {shown(value)}; expected {YES_NO.expected}")
    fixed, drawn = _factors(factors)
    space = _held(domain_of(domain), adjustments, arms)
    generator, seed = _generator(rng)
    plan = SamplingPlan(space, fixed, drawn, weights)
    counts = np.full(len(scores), n // len(scores)) + (np.arange(len(scores)) < n % len(scores))
    angles, drawn_factors = plan.draw(scores, counts, generator, stratified)
    warn_if_radians(angles[:, [INDEX[column] for column in space.columns]])  # angles that are held may be large
    used = drawn_factors if drawn else (fixed if factors is not None else None)
    origin = {
        "domain": space.to_dict(), "n": int(n), "classes": list(scores), "weights": weights, "stratified": stratified,
        "factors": list(drawn), **_shared(factors), "adjustments": adjustments, "arms": arms, **seed,
        **provenance(),
    }  # fmt: skip
    return Poses(angles, true_scores(space, angles, used), used, origin)


def _held(domain: Domain, adjustments: bool, arms: str) -> Domain:
    """Return the domain with adjustments at 0, or one arm at rest, if these are not drawn."""
    if not isinstance(arms, str) or arms not in ("both", *SIDES):
        raise SampleError(f"arms is {shown(arms)}; expected both, left or right")
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
        scores = tuple(itertools.islice(classes, MOST_CLASSES + 1))
        repeated = len(set(scores)) != len(scores)
    except TypeError as error:
        raise SampleError(f"classes are {shown(classes)}; expected REBA scores such as range(1, 11)") from error
    if not scores or repeated:
        raise SampleError(f"classes are {shown(scores)}; expected each REBA score once, at least one")
    for score in scores:
        if isinstance(score, bool) or not isinstance(score, int | np.integer) or not 1 <= score <= MOST_CLASSES:
            raise SampleError(f"class {shown(score)} is not a REBA score; expected whole numbers from 1 to 15")
    return tuple(int(score) for score in scores)


def _factors(factors: Sequence[str] | Factors | None) -> tuple[Factors, tuple[str, ...]]:
    """Return the factors that all poses share and the names of drawn ones."""
    if factors is None:
        return Factors(), ()
    if isinstance(factors, Factors):
        if any(np.ndim(value) for value in dataclasses.asdict(factors).values()):
            raise SampleError("factors hold an array; expected one value each, or the names of factors to draw")
        return factors, ()
    names = items_of(factors)
    if names is None:
        raise SampleError(f"factors are {shown(factors)}; expected a list of names out of {', '.join(FACTOR_NAMES)}")
    for name in names:
        if not isinstance(name, str) or name not in FACTOR_NAMES:
            raise SampleError(f"factor {shown(name)} cannot be drawn; expected names out of {', '.join(FACTOR_NAMES)}")
    return Factors(), tuple(name for name in FACTOR_NAMES if name in names)


def _shared(factors: Any) -> dict[str, Any]:
    """Return the provenance entry of factors that all poses share, empty without them."""
    return {"shared_factors": dataclasses.asdict(factors)} if isinstance(factors, Factors) else {}


def _generator(rng: Rng) -> tuple[np.random.Generator, dict[str, Any]]:
    """Return a generator and the provenance entries, seed or state, that reproduce it."""
    if isinstance(rng, np.random.Generator):
        state = rng.bit_generator.state
        return rng, {"seed": None, "generator": {key: _plain_state(value) for key, value in state.items()}}
    seeds = list(rng) if isinstance(rng, tuple) else [rng]
    if rng is None:
        seeds = [int(np.random.SeedSequence().generate_state(1)[0])]
    if not seeds or any(isinstance(s, bool) or not isinstance(s, int | np.integer) or s < 0 for s in seeds):
        raise SampleError(f"rng is {shown(rng)}; expected a numpy Generator or a seed, whole numbers from 0")
    whole = [int(seed) for seed in seeds if seed is not None]
    return np.random.default_rng(whole), {"seed": whole if len(whole) > 1 else whole[0]}


def _plain_state(value: Any) -> Any:
    """Return the state of a generator as plain data."""
    if isinstance(value, dict):
        return {key: _plain_state(item) for key, item in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value
