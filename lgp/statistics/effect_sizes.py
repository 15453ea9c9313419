"""Effect sizes with confidence intervals, standard errors within participants, and tests of assumptions.

By statsmodels and scipy: the Shapiro-Wilk test (1965) of the normality of differences, Bartlett's form of Mauchly's
test of the sphericity of three and more conditions, Friedman's test, and quantiles of the noncentral t distribution.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from lgp.statistics.paired_tests import TIE_TOLERANCE, greenhouse_geisser_epsilon
from reba.arrays import Array

CONFIDENCE = 0.95
"""Confidence level of the intervals."""


@dataclass(frozen=True)
class EffectSize:
    """Standardised mean difference of paired data; NaN where it is not defined.

    Attributes:
        dz, dz_low, dz_high: Cohen's d_z, mean over standard deviation of the differences, and its 95 % interval.
        g, g_low, g_high: Hedges' g (1981): d_z corrected for the bias of small samples.
    """

    dz: float
    dz_low: float
    dz_high: float
    g: float
    g_low: float
    g_high: float


@dataclass(frozen=True)
class AssumptionTest:
    """Test of an assumption: its name, sample size, statistic and p value; NaN for too few data or no dispersion."""

    name: str
    n: int
    statistic: float
    p: float


def effect_size(differences: Array) -> EffectSize:
    """Effect size of (n,) paired differences.

    The interval is exact for normal differences: sqrt(n) d_z follows a noncentral t distribution with n - 1 degrees of
    freedom (Cumming & Finch 2001, Educational and Psychological Measurement 61). Hedges' correction is his eq. 6e.

    >>> effect = effect_size(np.array([1.0, 2.0, 3.0, 4.0]))
    >>> round(effect.dz, 3), round(effect.g, 3)
    (1.936, 1.401)
    """
    from scipy import special

    n = len(differences)
    nan = float("nan")
    if n < 2 or np.ptp(differences) <= TIE_TOLERANCE:
        constant = 0.0 if n and np.abs(differences).max() <= TIE_TOLERANCE else nan
        return EffectSize(constant, nan, nan, constant, nan, nan)
    df = n - 1
    d = float(differences.mean() / differences.std(ddof=1))
    tails = [(1.0 + CONFIDENCE) / 2.0, (1.0 - CONFIDENCE) / 2.0]
    low, high = special.nctdtrinc(df, tails, d * np.sqrt(n)) / np.sqrt(n)
    # With one degree of freedom the factor is 0: two pairs do not determine the size of an effect.
    factor = float(np.exp(special.gammaln(df / 2) - special.gammaln((df - 1) / 2)) / np.sqrt(df / 2)) if df > 1 else 0.0
    return EffectSize(d, float(low), float(high), factor * d, factor * float(low), factor * float(high))


def within_errors(table: Array) -> Array:
    """Standard errors within participants (k,) of a complete table (n, k), after Cousineau and Morey.

    Centring each participant removes the differences between participants (Cousineau 2005); the factor k / (k - 1)
    corrects the variance for the centring (Morey 2008, Tutorials in Quantitative Methods for Psychology 4:61).

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
    """Shapiro-Wilk test that (n,) differences are normal; NaN for fewer than three or equal differences."""
    from scipy import stats

    n = len(differences)
    if n < 3 or np.ptp(differences) <= TIE_TOLERANCE:
        return AssumptionTest("Shapiro-Wilk", n, float("nan"), float("nan"))
    result = stats.shapiro(differences)
    return AssumptionTest("Shapiro-Wilk", n, float(result.statistic), float(result.pvalue))


def sphericity(table: Array) -> AssumptionTest | None:
    """Mauchly's test of a complete table (n, k): all differences have the same variance; None for two conditions.

    The contrasts are the rows of the Helmert matrix; the result is the same for any orthonormal contrasts.
    """
    n, k = table.shape
    if k < 3:
        return None
    name = "Mauchly, chi-square"
    if n < k + 1 or not greenhouse_geisser_epsilon(table) > 1.0 / (k - 1) + TIE_TOLERANCE:
        return AssumptionTest(name, n, float("nan"), float("nan"))
    from scipy.linalg import helmert
    from statsmodels.stats.multivariate import test_cov_spherical

    contrasts = table @ helmert(k).T
    result = test_cov_spherical(np.cov(contrasts, rowvar=False), n)
    return AssumptionTest(name, n, float(result.statistic), float(result.pvalue))


def friedman(table: Array) -> AssumptionTest | None:
    """Friedman's rank test of a complete table (n, k), without assuming normality; None for two conditions."""
    n, k = table.shape
    if k < 3:
        return None
    from scipy import stats

    if n < 2 or np.ptp(table, axis=1).max() <= TIE_TOLERANCE:
        return AssumptionTest("Friedman", n, float("nan"), float("nan"))
    with warnings.catch_warnings():
        # If all ranks are tied, scipy divides by zero and returns NaN.
        warnings.simplefilter("ignore", RuntimeWarning)
        result = stats.friedmanchisquare(*table.T)
    return AssumptionTest("Friedman", n, float(result.statistic), float(result.pvalue))
