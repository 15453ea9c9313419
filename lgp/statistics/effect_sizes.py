"""Effect sizes with intervals, error bars within people, and whether the data fit what the tests assume.

What statsmodels and scipy have is taken from there: Shapiro & Wilk (1965) for the normality of differences, Bartlett's
form of Mauchly's test for the sphericity of three and more conditions, Friedman's test, quantiles of the noncentral t.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from lgp.statistics.paired_tests import SAME, epsilon
from reba.arrays import Array

LEVEL = 0.95
"""Confidence of intervals."""


@dataclass(frozen=True)
class EffectSize:
    """A standardised effect of paired data; NaN where it cannot be given.

    Attributes:
        dz, dz_low, dz_high: mean difference over the standard deviation of differences, and its interval.
        g, g_low, g_high: the same after Hedges (1981), without the bias of few pairs.
    """

    dz: float
    dz_low: float
    dz_high: float
    g: float
    g_low: float
    g_high: float


@dataclass(frozen=True)
class AssumptionTest:
    """A test of an assumption: its name, statistic and p; NaN where there are too few data or no spread."""

    name: str
    n: int
    statistic: float
    p: float


def effect(differences: Array) -> EffectSize:
    """Return the effect size of (n,) paired differences.

    The interval is exact for normal differences: sqrt(n) d_z follows a noncentral t with n - 1 degrees of freedom
    (Cumming & Finch 2001, Educational and Psychological Measurement 61). Hedges' factor is that of his eq. 6e.

    >>> found = effect(np.array([1.0, 2.0, 3.0, 4.0]))
    >>> round(found.dz, 3), round(found.g, 3)
    (1.936, 1.401)
    """
    from scipy import special

    n = len(differences)
    nothing = float("nan")
    if n < 2 or np.ptp(differences) <= SAME:
        flat = 0.0 if n and np.abs(differences).max() <= SAME else nothing
        return EffectSize(flat, nothing, nothing, flat, nothing, nothing)
    df = n - 1
    d = float(differences.mean() / differences.std(ddof=1))
    tails = [(1.0 + LEVEL) / 2.0, (1.0 - LEVEL) / 2.0]
    low, high = special.nctdtrinc(df, tails, d * np.sqrt(n)) / np.sqrt(n)
    # Of one degree of freedom the factor is 0: two pairs say nothing about the size of an effect.
    factor = float(np.exp(special.gammaln(df / 2) - special.gammaln((df - 1) / 2)) / np.sqrt(df / 2)) if df > 1 else 0.0
    return EffectSize(d, float(low), float(high), factor * d, factor * float(low), factor * float(high))


def within_errors(table: Array) -> Array:
    """Return (k,) standard errors within people of a table (n, k) without gaps.

    Differences between people are taken out by centring each person (Cousineau 2005), what that takes out of the
    spread is given back (Morey 2008, Tutorials in Quantitative Methods for Psychology 4:61).

    >>> within_errors(np.array([[1.0, 2.0], [5.0, 6.0], [9.0, 10.0]])).tolist()
    [0.0, 0.0]
    """
    from scipy import stats

    n, k = table.shape
    if n < 2 or k < 2:
        return np.full(k, np.nan)
    centred = table - table.mean(axis=1, keepdims=True)
    error: Array = stats.sem(centred, axis=0) * np.sqrt(k / (k - 1))
    return error


def normality(differences: Array) -> AssumptionTest:
    """Return the Shapiro-Wilk test of (n,) differences; it needs three that are not all the same."""
    from scipy import stats

    n = len(differences)
    if n < 3 or np.ptp(differences) <= SAME:
        return AssumptionTest("Shapiro-Wilk", n, float("nan"), float("nan"))
    found = stats.shapiro(differences)
    return AssumptionTest("Shapiro-Wilk", n, float(found.statistic), float(found.pvalue))


def sphericity(table: Array) -> AssumptionTest | None:
    """Return Mauchly's test on (n, k) without gaps: whether all differences vary alike; None for two conditions.

    The contrasts are the rows of the Helmert matrix; any orthonormal ones give the same.
    """
    n, k = table.shape
    if k < 3:
        return None
    name = "Mauchly, chi-square"
    if n < k + 1 or not epsilon(table) > 1.0 / (k - 1) + SAME:
        return AssumptionTest(name, n, float("nan"), float("nan"))
    from scipy.linalg import helmert
    from statsmodels.stats.multivariate import test_cov_spherical

    contrasts = table @ helmert(k).T
    found = test_cov_spherical(np.cov(contrasts, rowvar=False), n)
    return AssumptionTest(name, n, float(found.statistic), float(found.pvalue))


def friedman(table: Array) -> AssumptionTest | None:
    """Return Friedman's test on (n, k) without gaps, which needs no normal differences; None for two conditions."""
    n, k = table.shape
    if k < 3:
        return None
    from scipy import stats

    if n < 2 or np.ptp(table, axis=1).max() <= SAME:
        return AssumptionTest("Friedman", n, float("nan"), float("nan"))
    with warnings.catch_warnings():
        # Ties everywhere leave nothing to divide by; NaN says so.
        warnings.simplefilter("ignore", RuntimeWarning)
        found = stats.friedmanchisquare(*table.T)
    return AssumptionTest("Friedman", n, float(found.statistic), float(found.pvalue))
