"""Tests of paired runs: repeated-measures ANOVA, post-hoc comparisons, changes of a choice.

F by statsmodels' `AnovaRM`, with the correction for sphericity of Greenhouse & Geisser (1959), On methods in the
analysis of profile data, Psychometrika 24; p values of several comparisons are corrected after Holm (1979). Runs
without a condition are left out: of the ANOVA if any condition is missing, of a comparison if one of its two is
missing.

Identical conditions have p = 1. Where a t test is not defined (fewer than two pairs, or differences of zero variance)
its numbers are NaN; the rank tests still apply.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgp.errors import LgpError
from reba.arrays import Array
from reba.extras import missing

if TYPE_CHECKING:
    import pandas as pd

TIE_TOLERANCE = 1e-9
"""Differences within this are tied, and below it zero: larger than rounding errors, smaller than any effect."""
STARS = ((0.001, "***"), (0.01, "**"), (0.05, "*"))
"""Significance marks of the American Psychological Association."""


@dataclass(frozen=True)
class Mean:
    """Mean over `n` runs, standard deviation (n - 1) and standard error; NaN for too few runs."""

    n: int
    mean: float
    sd: float
    se: float


@dataclass(frozen=True)
class Anova:
    """One-way repeated-measures ANOVA.

    Attributes:
        n, excluded: runs with every condition, and runs that lack one.
        f, df, df_error: F ratio and its uncorrected degrees of freedom.
        p: assuming sphericity.
        epsilon: of Greenhouse and Geisser, from 1 / (conditions - 1) to 1.
        p_corrected: with both degrees of freedom times epsilon; the value to report.
        partial_eta_squared: share of the variance within runs that the conditions explain.
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
    """Comparison of two conditions on the same runs.

    Attributes:
        first, second: the conditions; differences are first minus second.
        n, excluded, ties: runs with both, runs that lack one, runs without a difference.
        difference, low, high: mean difference and its 95 % interval.
        t, p, p_holm: two-sided paired t test; `p_holm` is corrected over the comparisons made together.
        d: effect size Cohen's d_z, mean over standard deviation of the differences.
        wilcoxon_p, wilcoxon_p_holm: exact signed-rank test, for ordinal scores; corrected in the same way.
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
        """Significance marks of the corrected p value of the t test."""
        return stars(self.p_holm)


@dataclass(frozen=True)
class MeanDifference:
    """Difference of the means of two samples of other runs, first minus second: its 95 % interval and p after Welch."""

    difference: float
    low: float
    high: float
    p: float


@dataclass(frozen=True)
class ChoiceTest:
    """Change of a categorical choice between two conditions on the same runs.

    Attributes:
        n, excluded, changed: runs with both, runs that lack one, runs with different choices.
        counts: (k, k) runs by choice before (rows) and after (columns).
        statistic, df, p: Stuart-Maxwell test of equal marginal shares.
        by_choice: choice -> runs that left it, runs that came to it, p of the exact McNemar test, the same after Holm.
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
    """Significance marks of a p value: *** below 0.001, ** below 0.01, * below 0.05, else an empty text."""
    return next((mark for limit, mark in STARS if p < limit), "")


def mean_of(values: Any) -> Mean:
    """Mean, standard deviation and standard error of the finite values of (n,)."""
    finite = np.asarray(values, dtype=float)
    finite = finite[np.isfinite(finite)]
    n = len(finite)
    sd = float(finite.std(ddof=1)) if n > 1 else float("nan")
    return Mean(n, float(finite.mean()) if n else float("nan"), sd, sd / np.sqrt(n) if n > 1 else float("nan"))


def greenhouse_geisser_epsilon(values: Array) -> float:
    """Greenhouse-Geisser epsilon of `values` (n, k); NaN if all differences have zero variance.

    >>> rng = np.random.default_rng(0)
    >>> 0.5 <= greenhouse_geisser_epsilon(rng.normal(size=(20, 3))) <= 1.0
    True
    """
    k = values.shape[1]
    centre = np.eye(k) - 1.0 / k
    covariance = centre @ np.cov(values, rowvar=False) @ centre
    squares = float((k - 1) * np.sum(covariance**2))
    return float(np.trace(covariance)) ** 2 / squares if squares > 0 else float("nan")


def anova(table: pd.DataFrame) -> Anova:
    """Repeated-measures ANOVA of a table with one row per run and one column per condition.

    >>> import pandas as pd
    >>> round(anova(pd.DataFrame({"a": [1.0, 2, 3], "b": [2.0, 4, 3], "c": [5.0, 5, 6]})).f, 2)
    19.75
    """
    from scipy.stats import f as f_distribution

    values = table.to_numpy(dtype=float)
    complete = values[np.isfinite(values).all(axis=1)]
    (n, k), excluded = complete.shape, int(len(values) - len(complete))
    df, df_error = float(k - 1), float((k - 1) * (n - 1))
    nan = float("nan")
    if n < 2 or k < 2:
        return Anova(n, excluded, nan, df, max(df_error, 0.0), *[nan] * 4)
    within = complete - complete.mean(axis=1, keepdims=True)
    if np.allclose(within, 0.0, atol=1e-12):
        return Anova(n, excluded, 0.0, df, df_error, 1.0, nan, 1.0, 0.0)
    if np.allclose(within, within.mean(axis=0), atol=1e-12):
        return Anova(n, excluded, nan, df, df_error, *[nan] * 4)
    f = _f_ratio(complete)
    epsilon = min(greenhouse_geisser_epsilon(complete), 1.0)
    return Anova(
        n=n,
        excluded=excluded,
        f=f,
        df=df,
        df_error=df_error,
        p=float(f_distribution.sf(f, df, df_error)),
        epsilon=epsilon,
        p_corrected=float(f_distribution.sf(f, df * epsilon, df_error * epsilon)),
        partial_eta_squared=f * df / (f * df + df_error),
    )


def _f_ratio(values: Array) -> float:
    import pandas as pd

    n, k = values.shape
    long = pd.DataFrame(
        {"run": np.repeat(np.arange(n), k), "condition": np.tile(np.arange(k), n), "value": values.ravel()}
    )
    model = _statsmodels().AnovaRM(long, "value", "run", within=["condition"]).fit()
    return float(model.anova_table["F Value"].iloc[0])


def welch_difference(first: Mean, second: Mean) -> MeanDifference:
    """Compare the means of two samples after Welch (1947, Biometrika 34), of which only mean and deviation are known.

    >>> result = welch_difference(Mean(4, 3.0, 1.0, 0.5), Mean(9, 1.0, 1.5, 0.5))
    >>> round(result.difference, 2), round(result.low, 2), round(result.high, 2), round(result.p, 3)
    (2.0, 0.39, 3.61, 0.02)
    """
    from scipy import stats

    difference = first.mean - second.mean
    variances = np.array([first.se**2, second.se**2])
    if not variances.sum() > 0.0:
        return MeanDifference(difference, float("nan"), float("nan"), float("nan"))
    df = variances.sum() ** 2 / (variances**2 / (np.array([first.n, second.n]) - 1)).sum()
    spread, half = float(np.sqrt(variances.sum())), float(stats.t.ppf(0.975, df))
    p = 2.0 * float(stats.t.sf(abs(difference) / spread, df))
    return MeanDifference(difference, difference - half * spread, difference + half * spread, p)


def compare(table: pd.DataFrame, pairs: Sequence[tuple[str, str]]) -> list[Comparison]:
    """Paired comparisons of columns of a table with one row per run; p values corrected over all pairs after Holm."""
    comparisons = [_compare_pair(table, first, second) for first, second in pairs]
    by_t = holm([one.p for one in comparisons])
    by_rank = holm([one.wilcoxon_p for one in comparisons])
    return [
        replace(one, p_holm=p, wilcoxon_p_holm=rank_p)
        for one, p, rank_p in zip(comparisons, by_t, by_rank, strict=True)
    ]


def _compare_pair(table: pd.DataFrame, first: str, second: str) -> Comparison:
    from scipy import stats

    differences = (table[first] - table[second]).to_numpy(dtype=float)
    finite = differences[np.isfinite(differences)]
    n, ties = len(finite), int(np.sum(np.abs(finite) < TIE_TOLERANCE))
    mean = mean_of(finite)
    t = p = d = low = high = wilcoxon = float("nan")
    if n and ties == n:
        t, p, d, low, high, wilcoxon = 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    elif n > 1:
        wilcoxon = signed_rank_p(finite)
        if np.ptp(finite) > 1e-12 * np.abs(finite).max():
            result = stats.ttest_1samp(finite, 0.0)
            interval = result.confidence_interval(0.95)
            t, p, low, high = (float(v) for v in (result.statistic, result.pvalue, interval.low, interval.high))
            d = mean.mean / mean.sd
    return Comparison(first, second, n, len(differences) - n, ties, mean.mean, low, high, t, p, d, wilcoxon)


def signed_rank_p(differences: Array) -> float:
    """Two-sided p value of Wilcoxon's signed-rank test, exact also with tied ranks; zero differences are left out.

    Under the null hypothesis both signs are equally likely, so the distribution of the rank sum is the convolution of
    the ranks, added one by one: exact and fast for a hundred runs.

    >>> signed_rank_p(np.array([1.0, 2.0, 3.0, 4.0]))
    0.125
    """
    from scipy.stats import rankdata

    nonzero = differences[np.abs(differences) >= TIE_TOLERANCE]
    if not len(nonzero):
        return 1.0
    # Tied differences have half ranks; doubled, all ranks are integers.
    ranks = np.rint(2 * rankdata(np.round(np.abs(nonzero) / TIE_TOLERANCE))).astype(int)
    probability = np.zeros(ranks.sum() + 1)
    probability[0] = 1.0
    for rank in ranks:
        probability[rank:] = 0.5 * probability[rank:] + 0.5 * probability[:-rank]
        probability[:rank] *= 0.5
    positive = int(ranks[nonzero > 0].sum())
    return min(1.0, 2.0 * float(probability[: min(positive, ranks.sum() - positive) + 1].sum()))


def holm(p_values: Sequence[float]) -> list[float]:
    """P values corrected for multiple comparisons after Holm (1979); NaN stays NaN and is not counted as a test.

    >>> holm([0.01, 0.04, float("nan")])
    [0.02, 0.04, nan]
    """
    # As multipletests of statsmodels, which collects garbage each time: most of the time that a summary took.
    p = np.array(p_values, dtype=float)
    tested = np.flatnonzero(np.isfinite(p))
    order = tested[np.argsort(p[tested])]
    p[order] = np.minimum(np.maximum.accumulate(p[order] * np.arange(len(order), 0, -1)), 1.0)
    return [float(value) for value in p]


def compare_choices(before: pd.Series, after: pd.Series, choices: Sequence[str]) -> ChoiceTest:
    """Tests of marginal homogeneity of a categorical choice: Stuart-Maxwell over all, exact McNemar for each choice.

    `before` and `after` have one entry per run, missing for runs without the condition.

    Raises:
        LgpError: an entry is not one of `choices`.
    """
    import pandas as pd
    from scipy.stats import binomtest
    from statsmodels.stats.contingency_tables import SquareTable

    both = pd.DataFrame({"before": before, "after": after})
    paired = both.dropna()
    unknown = sorted(set(paired.to_numpy().ravel()) - set(choices))
    if unknown:
        raise LgpError(f"choice {unknown[0]!r}: expected one of {', '.join(choices)}")
    codes = [pd.Categorical(paired[name], categories=list(choices)).codes for name in ("before", "after")]
    counts = np.zeros((len(choices), len(choices)), np.intp)
    np.add.at(counts, tuple(codes), 1)
    stay = np.diag(counts)
    left, came = counts.sum(axis=1) - stay, counts.sum(axis=0) - stay
    exact = [float(binomtest(int(a), int(a + b)).pvalue) if a + b else 1.0 for a, b in zip(left, came, strict=True)]
    by_choice = {
        name: {"left": int(a), "came": int(b), "p": p, "p_holm": p_holm}
        for name, a, b, p, p_holm in zip(choices, left, came, exact, holm(exact), strict=True)
    }
    statistic, df, p = 0.0, 0, 1.0 if len(paired) else float("nan")
    used = np.flatnonzero(left + came)
    if len(used) > 1:
        # Choices without any change carry no information and make the covariance matrix singular.
        with warnings.catch_warnings():
            # Four or more choices may form groups without exchange: the test is then not defined and returns NaN.
            warnings.simplefilter("ignore")
            result: Any = SquareTable(counts[np.ix_(used, used)], shift_zeros=False).homogeneity()
        statistic, df, p = float(result.statistic), int(result.df), float(result.pvalue)
    changed = int(counts.sum() - stay.sum())
    return ChoiceTest(len(paired), len(both) - len(paired), changed, counts.tolist(), statistic, df, p, by_choice)


def require_statsmodels() -> None:
    """Raise LgpError if statsmodels is missing, before a long computation that needs it for its statistics."""
    _statsmodels()


def _statsmodels() -> Any:
    try:
        from statsmodels.stats import anova as module
    except ImportError as error:
        raise missing("statsmodels", "a statistical test") from error
    return module
