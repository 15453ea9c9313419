"""Shares of a choice: exact test of two samples, interval of a paired difference, and equivalence within a margin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

Z = 1.959963984540054
"""Quantile of the normal distribution of a two-sided 95 % interval."""


@dataclass(frozen=True)
class ExactTest:
    """Fisher-Freeman-Halton test of equal shares in two samples: sizes, p value, and Cramer's V as size of effect."""

    n: tuple[int, int]
    p: float
    cramer_v: float


@dataclass(frozen=True)
class ShareDifference:
    """Change of the share of one choice between two conditions or samples, with its 95 % interval [-1, 1].

    `n` is the number of runs in both conditions, of two samples that of the first.
    """

    n: int
    difference: float
    low: float
    high: float


def exact_homogeneity(first: Sequence[int], second: Sequence[int]) -> ExactTest:
    """Test whether counts (k,) of two samples come from equal shares.

    The p value is the probability, with both margins fixed, of all tables that are no more likely than the observed one
    (Freeman & Halton 1951, Biometrika 38), by enumeration: exact also where expected counts are small.

    >>> round(exact_homogeneity([3, 0], [0, 3]).p, 6)
    0.1
    """
    columns = np.add(first, second)
    sizes, total = (int(sum(first)), int(sum(second))), int(columns.sum())
    if not all(sizes):
        return ExactTest(sizes, math.nan, math.nan)
    # Of the smaller sample: the number of tables grows with its size only.
    n, given = min(zip(sizes, (first, second), strict=True), key=lambda sample: sample[0])
    logs = np.array([math.lgamma(number + 1.0) for number in range(total + 1)])

    def log_probability(counts: np.ndarray) -> np.ndarray:
        """Of tables (m, k) by their first rows, without the constant of the margins."""
        weights: np.ndarray = -(logs[counts] + logs[columns - counts]).sum(axis=1)
        return weights

    heads = np.array(list(product(*(range(min(column, n) + 1) for column in columns[:-1]))), dtype=np.intp)
    heads = heads.reshape(len(heads), len(columns) - 1)
    last = n - heads.sum(axis=1)
    possible = (last >= 0) & (last <= columns[-1])
    tables = np.column_stack([heads, last])[possible]
    weights = log_probability(tables)
    observed = log_probability(np.array([given], dtype=np.intp))[0]
    shares = np.exp(weights - weights.max())
    # Tables of equal probability differ by rounding.
    p = float(shares[weights <= observed + 1e-9].sum() / shares.sum())
    expected = np.outer(sizes, columns[columns > 0]) / total
    counted = np.array([first, second])[:, columns > 0]
    chi_square = float(((counted - expected) ** 2 / expected).sum())
    smallest = min(counted.shape) - 1
    return ExactTest(sizes, min(p, 1.0), math.sqrt(chi_square / (total * smallest)) if smallest else 0.0)


def paired_difference(left: int, came: int, n: int) -> ShareDifference:
    """Return the change of a share where of n runs `left` gave up the choice and `came` took it.

    The interval adds half a run to each cell (Agresti & Min 2005, Statistics in Medicine 24): close to its level also
    for few runs, and never of length zero.

    >>> change = paired_difference(left=9, came=2, n=20)
    >>> round(change.difference, 2), round(change.low, 2), round(change.high, 2)
    (-0.35, -0.6, -0.04)
    """
    if not n:
        return ShareDifference(0, math.nan, math.nan, math.nan)
    gone, arrived, all_runs = left + 0.5, came + 0.5, n + 2.0
    middle = (arrived - gone) / all_runs
    half = Z * math.sqrt(arrived + gone - (arrived - gone) ** 2 / all_runs) / all_runs
    return ShareDifference(n, (came - left) / n, max(-1.0, middle - half), min(1.0, middle + half))


def independent_difference(first: int, n_first: int, second: int, n_second: int) -> ShareDifference:
    """Return by how much the share of a choice in a first sample exceeds that in a second one.

    The interval is Newcombe's, made of Wilson's intervals of both shares (1998, Statistics in Medicine 17, method 10):
    close to its level also for few runs and for shares near 0 and 1.

    >>> change = independent_difference(56, 70, 48, 80)
    >>> round(change.difference, 2), round(change.low, 4), round(change.high, 4)
    (0.2, 0.0524, 0.3339)
    """
    if not n_first or not n_second:
        return ShareDifference(n_first, math.nan, math.nan, math.nan)
    shares, lows, highs = zip(*(_wilson(first, n_first), _wilson(second, n_second)), strict=True)
    difference = shares[0] - shares[1]
    return ShareDifference(
        n_first,
        difference,
        difference - math.hypot(shares[0] - lows[0], highs[1] - shares[1]),
        difference + math.hypot(highs[0] - shares[0], shares[1] - lows[1]),
    )


def _wilson(count: int, n: int) -> tuple[float, float, float]:
    """Return a share and the ends of Wilson's 95 % interval."""
    share, spread = count / n, Z**2 / n
    middle = (share + spread / 2.0) / (1.0 + spread)
    half = math.sqrt(share * (1.0 - share) * spread + spread**2 / 4.0) / (1.0 + spread)
    return share, middle - half, middle + half


def equivalent(low: float | None, high: float | None, margin: float) -> bool:
    """Whether a 95 % interval lies inside (-margin, margin): only this shows that there is no effect of note.

    A large p value does not: it may come of too few runs (Schuirmann 1987, J. Pharmacokinetics and Biopharmaceutics
    15).
    """
    return low is not None and high is not None and -margin < low and high < margin
