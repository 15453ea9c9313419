"""Tests on paired runs: repeated-measures ANOVA, post-hoc comparisons, changes of a choice.

F by statsmodels' `AnovaRM`; sphericity is corrected after Greenhouse & Geisser (1959), On methods in the analysis of
profile data, Psychometrika 24; p values of several comparisons after Holm (1979). Runs that miss a condition are left
out: of the ANOVA if any condition is missing, of a comparison if one of its two is.

Identical conditions are no evidence: their p is 1. Where a test cannot be made (fewer than two pairs, no spread at all
around a difference) its numbers are NaN, and the distribution-free ones still stand.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgp.errors import LgpError
from reba.arrays import Array

if TYPE_CHECKING:
    import pandas as pd

SAME = 1e-9
"""Differences that are equal up to this count as equal, and as none below it."""
STARS = ((0.001, "***"), (0.01, "**"), (0.05, "*"))
"""Marks of significance after the American Psychological Association."""


@dataclass(frozen=True)
class Mean:
    """A mean over `n` runs, its standard deviation (n - 1) and standard error; NaN where there are too few."""

    n: int
    mean: float
    sd: float
    se: float


@dataclass(frozen=True)
class Anova:
    """A one-way repeated-measures ANOVA.

    Attributes:
        n: runs with every condition; `excluded`: runs without.
        f, df, df_error: the F ratio and its degrees of freedom before correction.
        p: assuming sphericity.
        epsilon: of Greenhouse and Geisser, from 1 / (conditions - 1) to 1.
        p_corrected: with both degrees of freedom times epsilon; the one to report.
        partial_eta_squared: share of the variance, without that between runs, which conditions explain.
    """

    n: int
    excluded: int
    f: float
    df: float
    df_error: float
    p: float
    epsilon: float
    p_corrected: float
    partial_eta_squared: float


@dataclass(frozen=True)
class Comparison:
    """Two conditions on the same runs.

    Attributes:
        first, second: what is compared; differences are first minus second.
        n: runs with both; `excluded`: runs that lack one; `ties`: runs without a difference.
        difference, low, high: mean difference and its 95 % interval.
        t, p: paired t test, two-sided; `p_holm`: over the comparisons made together.
        d: effect size, mean difference over the standard deviation of the differences (Cohen's d_z).
        wilcoxon_p, wilcoxon_p_holm: exact signed ranks, for scores that are ranks rather than lengths.
    """

    first: str
    second: str
    n: int
    excluded: int
    ties: int
    difference: float
    low: float
    high: float
    t: float
    p: float
    d: float
    wilcoxon_p: float
    p_holm: float = float("nan")
    wilcoxon_p_holm: float = float("nan")

    @property
    def stars(self) -> str:
        """Marks of the corrected p of the t test."""
        return stars(self.p_holm)


@dataclass(frozen=True)
class ChoiceTest:
    """How a choice changed between two conditions on the same runs.

    Attributes:
        n: runs with both; `excluded`: runs that lack one; `changed`: runs that chose otherwise.
        counts: (k, k) runs by choice before (rows) and after (columns).
        statistic, df, p: Stuart-Maxwell test that the shares of all choices stayed the same.
        by_choice: choice -> runs that left it, runs that came to it, exact McNemar p, the same after Holm.
    """

    n: int
    excluded: int
    changed: int
    counts: list[list[int]]
    statistic: float
    df: int
    p: float
    by_choice: dict[str, dict[str, float]]


def stars(p: float) -> str:
    """Return the marks of a p value: *** below .001, ** below .01, * below .05, else nothing."""
    return next((mark for limit, mark in STARS if p < limit), "")


def mean_of(values: Any) -> Mean:
    """Return mean and spread of the finite ones of `values` (n,)."""
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known)]
    n = len(known)
    sd = float(known.std(ddof=1)) if n > 1 else float("nan")
    return Mean(n, float(known.mean()) if n else float("nan"), sd, sd / np.sqrt(n) if n > 1 else float("nan"))


def epsilon(values: Array) -> float:
    """Return the Greenhouse-Geisser epsilon of `values` (n, k); NaN without any spread between differences.

    Example:
        >>> rng = np.random.default_rng(0)
        >>> 0.5 <= epsilon(rng.normal(size=(20, 3))) <= 1.0
        True
    """
    k = values.shape[1]
    centre = np.eye(k) - 1.0 / k
    covariance = centre @ np.cov(values, rowvar=False) @ centre
    squares = float((k - 1) * np.sum(covariance**2))
    return float(np.trace(covariance)) ** 2 / squares if squares > 0 else float("nan")


def anova(table: pd.DataFrame) -> Anova:
    """Return the repeated-measures ANOVA of a table with one row per run and one column per condition.

    Example:
        >>> import pandas as pd
        >>> round(anova(pd.DataFrame({"a": [1.0, 2, 3], "b": [2.0, 4, 3], "c": [5.0, 5, 6]})).f, 2)
        19.75
    """
    from scipy.stats import f as f_distribution

    values = table.to_numpy(dtype=float)
    complete = values[np.isfinite(values).all(axis=1)]
    (n, k), excluded = complete.shape, int(len(values) - len(complete))
    df, df_error = float(k - 1), float((k - 1) * (n - 1))
    nothing = float("nan")
    if n < 2 or k < 2:
        return Anova(n, excluded, nothing, df, max(df_error, 0.0), *[nothing] * 4)
    within = complete - complete.mean(axis=1, keepdims=True)
    if np.allclose(within, 0.0, atol=1e-12):
        return Anova(n, excluded, 0.0, df, df_error, 1.0, nothing, 1.0, 0.0)
    if np.allclose(within, within.mean(axis=0), atol=1e-12):
        return Anova(n, excluded, nothing, df, df_error, *[nothing] * 4)
    f = _f_ratio(complete)
    eps = min(epsilon(complete), 1.0)
    return Anova(
        n=n,
        excluded=excluded,
        f=f,
        df=df,
        df_error=df_error,
        p=float(f_distribution.sf(f, df, df_error)),
        epsilon=eps,
        p_corrected=float(f_distribution.sf(f, df * eps, df_error * eps)),
        partial_eta_squared=f * df / (f * df + df_error),
    )


def _f_ratio(values: Array) -> float:
    import pandas as pd

    n, k = values.shape
    long = pd.DataFrame(
        {"run": np.repeat(np.arange(n), k), "condition": np.tile(np.arange(k), n), "value": values.ravel()}
    )
    fitted = _statsmodels().AnovaRM(long, "value", "run", within=["condition"]).fit()
    return float(fitted.anova_table["F Value"].iloc[0])


def compare(table: pd.DataFrame, pairs: Sequence[tuple[str, str]]) -> list[Comparison]:
    """Return paired comparisons of columns of a table with one row per run, p values corrected over all of them."""
    found = [_pair(table, first, second) for first, second in pairs]
    corrected = holm([one.p for one in found])
    ranked = holm([one.wilcoxon_p for one in found])
    return [
        replace(one, p_holm=p, wilcoxon_p_holm=by_rank)
        for one, p, by_rank in zip(found, corrected, ranked, strict=True)
    ]


def _pair(table: pd.DataFrame, first: str, second: str) -> Comparison:
    from scipy import stats

    differences = (table[first] - table[second]).to_numpy(dtype=float)
    known = differences[np.isfinite(differences)]
    n, ties = len(known), int(np.sum(np.abs(known) < SAME))
    mean = mean_of(known)
    t = p = d = low = high = wilcoxon = float("nan")
    if n and ties == n:
        t, p, d, low, high, wilcoxon = 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    elif n > 1:
        wilcoxon = signed_rank_p(known)
        if np.ptp(known) > 1e-12 * np.abs(known).max():
            result = stats.ttest_1samp(known, 0.0)
            interval = result.confidence_interval(0.95)
            t, p, low, high = (float(v) for v in (result.statistic, result.pvalue, interval.low, interval.high))
            d = mean.mean / mean.sd
    return Comparison(first, second, n, len(differences) - n, ties, mean.mean, low, high, t, p, d, wilcoxon)


def signed_rank_p(differences: Array) -> float:
    """Return the two-sided p of Wilcoxon's signed ranks, exact with ties too; differences of none are left out.

    Every sign is equally likely under the hypothesis; the distribution of the rank sum is built rank by rank, which for
    a hundred runs is faster than trying signs and needs no approximation.

    Example:
        >>> signed_rank_p(np.array([1.0, 2.0, 3.0, 4.0]))
        0.125
    """
    from scipy.stats import rankdata

    known = differences[np.abs(differences) >= SAME]
    if not len(known):
        return 1.0
    # Ties have half ranks: doubled, all are whole.
    ranks = np.rint(2 * rankdata(np.round(np.abs(known) / SAME))).astype(int)
    chance = np.zeros(ranks.sum() + 1)
    chance[0] = 1.0
    for rank in ranks:
        chance[rank:] = 0.5 * chance[rank:] + 0.5 * chance[:-rank]
        chance[:rank] *= 0.5
    positive = int(ranks[known > 0].sum())
    return min(1.0, 2.0 * float(chance[: min(positive, ranks.sum() - positive) + 1].sum()))


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p values corrected after Holm; NaN stays NaN and does not count as a test.

    Example:
        >>> holm([0.01, 0.04, float("nan")])
        [0.02, 0.04, nan]
    """
    from statsmodels.stats.multitest import multipletests

    p = np.asarray(p_values, dtype=float)
    known = np.isfinite(p)
    if known.sum() > 1:
        p[known] = multipletests(p[known], method="holm")[1]
    return [float(value) for value in p]


def change(before: pd.Series, after: pd.Series, choices: Sequence[str]) -> ChoiceTest:
    """Return how a choice changed; both series have one entry per run, missing where there is none.

    Raises:
        LgpError: an entry is not one of `choices`.
    """
    import pandas as pd
    from scipy.stats import binomtest
    from statsmodels.stats.contingency_tables import SquareTable

    both = pd.DataFrame({"before": before, "after": after})
    known = both.dropna()
    unknown = sorted(set(known.to_numpy().ravel()) - set(choices))
    if unknown:
        raise LgpError(f"choice {unknown[0]!r} is none of {', '.join(choices)}")
    order = pd.CategoricalDtype(list(choices))
    counts = pd.crosstab(known["before"].astype(order), known["after"].astype(order), dropna=False).to_numpy()
    stay = np.diag(counts)
    left, came = counts.sum(axis=1) - stay, counts.sum(axis=0) - stay
    exact = [float(binomtest(int(a), int(a + b)).pvalue) if a + b else 1.0 for a, b in zip(left, came, strict=True)]
    by_choice = {
        name: {"left": int(a), "came": int(b), "p": p, "p_holm": p_holm}
        for name, a, b, p, p_holm in zip(choices, left, came, exact, holm(exact), strict=True)
    }
    statistic, df, p = 0.0, 0, 1.0 if len(known) else float("nan")
    used = np.flatnonzero(left + came)
    if len(used) > 1:
        # Choices that nobody left or came to carry no information and would make the test's matrix singular.
        with warnings.catch_warnings():
            # Four or more choices can fall into groups without exchange: there is no test then, NaN says so.
            warnings.simplefilter("ignore")
            result: Any = SquareTable(counts[np.ix_(used, used)], shift_zeros=False).homogeneity()
        statistic, df, p = float(result.statistic), int(result.df), float(result.pvalue)
    changed = int(counts.sum() - stay.sum())
    return ChoiceTest(len(known), len(both) - len(known), changed, counts.tolist(), statistic, df, p, by_choice)


def require() -> None:
    """Check that what the tests need is installed, before hours of runs are made.

    Raises:
        LgpError: it is not.
    """
    _statsmodels()


def _statsmodels() -> Any:
    try:
        from statsmodels.stats import anova as module
    except ImportError as error:
        raise LgpError("statistics need statsmodels, which is not installed; pip install dreba[experiments]") from error
    return module
