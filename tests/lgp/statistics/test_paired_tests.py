"""Tests of paired runs against hand computations, published data and known limits."""

import warnings
from itertools import product

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.power import TTestPower

from lgp.errors import LgpError
from lgp.statistics.paired_tests import (
    anova,
    compare,
    compare_choices,
    greenhouse_geisser_epsilon,
    holm,
    mean_of,
    require_statsmodels,
    signed_rank_p,
    stars,
)
from reba.extras import MissingPackageError
from tests.support.says import says

PAIRS = (("a", "b"), ("a", "c"), ("b", "c"))
CHOICES = ("left", "center", "right")


def table(values, columns="abc"):
    """Return a table with one row per run and one column per condition."""
    return pd.DataFrame(np.asarray(values, dtype=float), columns=list(columns))


def by_hand(values):
    """Return F of a repeated-measures ANOVA from sums of squares."""
    n, k = values.shape
    grand = values.mean()
    between = n * np.sum((values.mean(axis=0) - grand) ** 2)
    runs = k * np.sum((values.mean(axis=1) - grand) ** 2)
    error = np.sum((values - grand) ** 2) - between - runs
    return between / (k - 1) / (error / ((k - 1) * (n - 1))), between / (between + error)


def test_anova_of_a_small_table_is_that_of_a_hand_computation():
    # Sums of squares: total 78, conditions 158/3, runs 18, so error 22/3 with 4 degrees of freedom.
    found = anova(table([[1, 3, 5], [1, 2, 6], [3, 4, 11]]))
    f = (158 / 3 / 2) / (22 / 3 / 4)
    assert (found.n, found.excluded, found.df, found.df_error) == (3, 0, 2, 4)
    assert found.f == pytest.approx(f)
    assert found.partial_eta_squared == pytest.approx(158 / 180)
    assert found.p == pytest.approx(stats.f.sf(f, 2, 4))
    assert found.p_corrected == pytest.approx(stats.f.sf(f, 2 * found.epsilon, 4 * found.epsilon))
    assert found.p_corrected > found.p


def test_two_conditions_give_the_square_of_the_paired_t():
    values = np.random.default_rng(3).normal(size=(12, 2))
    found = anova(table(values, "ab"))
    t = stats.ttest_rel(values[:, 0], values[:, 1])
    assert found.f == pytest.approx(t.statistic**2)
    assert found.epsilon == pytest.approx(1.0)
    assert found.p_corrected == pytest.approx(t.pvalue)


def test_epsilon_of_orthogonal_contrasts_is_that_of_their_variances():
    # Uncorrelated contrasts with variances v and w: epsilon = (v + w)^2 / (2 (v^2 + w^2)), here 16 / 20.
    first, second = np.array([1.0, -1, 0]) / np.sqrt(2), np.array([1.0, 1, -2]) / np.sqrt(6)
    scores = np.array([[1.0, 1], [1, -1], [-1, 1], [-1, -1]]) * np.sqrt([3.0, 1.0])
    assert greenhouse_geisser_epsilon(scores @ np.stack([first, second])) == pytest.approx(16 / 20)


@given(st.integers(0, 10_000), st.integers(2, 5), st.integers(3, 12))
@settings(max_examples=40, deadline=None)
def test_epsilon_lies_between_its_bounds_and_f_ignores_levels_of_runs(seed, k, n):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(n, k))
    assert 1 / (k - 1) - 1e-9 <= greenhouse_geisser_epsilon(values) <= 1 + 1e-9
    names = "abcde"[:k]
    shifted = values + 10 * rng.normal(size=(n, 1))
    assert anova(table(shifted, names)).f == pytest.approx(anova(table(values, names)).f, rel=1e-6)
    assert anova(table(values, names)).f == pytest.approx(by_hand(values)[0])


def test_runs_without_every_condition_are_left_out_and_counted():
    rng = np.random.default_rng(0)
    values = rng.normal(size=(10, 3))
    holes = values.copy()
    holes[0, 0] = holes[4, 2] = np.nan
    found = anova(table(holes))
    assert (found.n, found.excluded) == (8, 2)
    assert found.f == pytest.approx(anova(table(np.delete(values, [0, 4], axis=0))).f)
    pairs = {(one.first, one.second): one for one in compare(table(holes), PAIRS)}
    assert [(one.n, one.excluded) for one in pairs.values()] == [(9, 1), (8, 2), (9, 1)]
    expected = stats.ttest_rel(np.delete(values[:, 0], 0), np.delete(values[:, 1], 0))
    assert pairs["a", "b"].p == pytest.approx(expected.pvalue)


def test_identical_conditions_are_no_evidence():
    values = np.repeat(np.arange(6.0)[:, None], 3, axis=1)
    found = anova(table(values))
    assert (found.f, found.p, found.p_corrected, found.partial_eta_squared) == (0.0, 1.0, 1.0, 0.0)
    for one in compare(table(values), PAIRS):
        assert (one.p, one.p_holm, one.wilcoxon_p_holm, one.d, one.ties) == (1.0, 1.0, 1.0, 0.0, 6)
        assert one.stars == ""


def test_two_identical_conditions_of_three():
    rng = np.random.default_rng(0)
    same = rng.normal(size=20)
    found = {one.first + one.second: one for one in compare(table(np.c_[same, same, rng.normal(3, 1, 20)]), PAIRS)}
    assert found["ab"].p_holm == 1.0
    assert found["ac"].stars == found["bc"].stars == "***"


def test_a_difference_without_spread_has_no_t_but_ranks():
    values = np.arange(8.0)[:, None] + [0, 1, 3]
    found = anova(table(values))
    assert np.isnan([found.f, found.p, found.p_corrected]).all()
    one = compare(table(values), PAIRS)[0]
    assert one.difference == -1.0
    assert np.isnan([one.t, one.p, one.p_holm, one.d]).all()
    assert one.wilcoxon_p == pytest.approx(2 / 2**8)


@pytest.mark.parametrize("n", [0, 1])
def test_too_few_runs_give_nan_without_a_warning(n):
    values = table(np.ones((n, 3)))
    assert np.isnan(anova(values).p)
    one = compare(values, PAIRS)[0]
    assert one.n == n
    assert np.isnan(mean_of(values["a"]).se)
    assert np.isnan(compare_choices(pd.Series(dtype=str), pd.Series(dtype=str), CHOICES).p)


def test_comparisons_report_effect_and_interval():
    differences = np.array([1.0, 2, 3, 4, 5])
    one = compare(table(np.c_[differences, np.zeros(5)], "ab"), [("a", "b")])[0]
    sd = np.sqrt(2.5)
    assert one.difference == 3.0
    assert one.d == pytest.approx(3 / sd)
    assert one.t == pytest.approx(3 / (sd / np.sqrt(5)))
    assert (one.low + one.high) / 2 == pytest.approx(3.0)
    assert one.high - 3.0 == pytest.approx(stats.t.ppf(0.975, 4) * sd / np.sqrt(5))
    assert one.wilcoxon_p == pytest.approx(2 / 2**5)


@pytest.mark.parametrize("seed", range(4))
def test_signed_ranks_are_those_of_scipy(seed):
    values = np.random.default_rng(seed).normal(0.2, 1.0, 40)
    assert signed_rank_p(values) == pytest.approx(stats.wilcoxon(values, method="exact").pvalue)


@pytest.mark.parametrize("values", [[1, 1, -1, 2, 2, 3], [0, 0, 1, 1, 1], [-1, 1, -2, 2], [2, 2, 2, -1, 4, 4, 0]])
def test_signed_ranks_with_ties_are_those_of_all_signs(values):
    values = np.array(values, dtype=float)
    known = values[values != 0]
    ranks = stats.rankdata(np.abs(known))
    sums = np.array([ranks @ signs for signs in product((0, 1), repeat=len(known))])
    away = np.abs(sums - ranks.sum() / 2)
    expected = np.mean(away >= abs(ranks[known > 0].sum() - ranks.sum() / 2) - 1e-9)
    assert signed_rank_p(values) == pytest.approx(expected)


def test_holm_steps_down_and_leaves_out_what_was_not_tested():
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    drawn = np.random.default_rng(0).uniform(0.0, 0.2, 30)
    assert holm(drawn) == pytest.approx(multipletests(drawn, method="holm")[1])
    kept = holm([0.02, float("nan"), 0.5])
    assert kept[0] == pytest.approx(0.04)
    assert np.isnan(kept[1])
    assert np.isnan(holm([float("nan")])).all()
    assert holm([]) == []


@pytest.mark.parametrize(("p", "mark"), [(0.0009, "***"), (0.001, "**"), (0.01, "*"), (0.05, ""), (float("nan"), "")])
def test_stars_follow_the_convention(p, mark):
    assert stars(p) == mark


def stuart_maxwell(counts):
    """Return the statistic over three choices, as in Fleiss, Statistical Methods for Rates and Proportions, 8.5."""
    d = counts.sum(axis=1) - counts.sum(axis=0)
    n12, n13, n23 = ((counts[i, j] + counts[j, i]) / 2 for i, j in ((0, 1), (0, 2), (1, 2)))
    return (n23 * d[0] ** 2 + n13 * d[1] ** 2 + n12 * d[2] ** 2) / (2 * (n12 * n23 + n12 * n13 + n13 * n23))


def choices(counts):
    """Return the choices before and after of runs with given counts."""
    pairs = [(a, b) for i, a in enumerate(CHOICES) for j, b in enumerate(CHOICES) for _ in range(counts[i][j])]
    return pd.Series([a for a, _ in pairs]), pd.Series([b for _, b in pairs])


def test_change_of_choice_is_tested_overall_and_per_choice():
    counts = np.array([[35, 5, 0], [15, 20, 5], [10, 5, 5]])
    found = compare_choices(*choices(counts), CHOICES)
    assert found.counts == counts.tolist()
    assert (found.n, found.changed, found.df) == (100, 40, 2)
    assert found.statistic == pytest.approx(stuart_maxwell(counts))
    assert found.p == pytest.approx(stats.chi2.sf(found.statistic, 2))
    left = found.by_choice["left"]
    assert (left["left"], left["came"]) == (5, 25)
    assert left["p"] == pytest.approx(stats.binomtest(5, 30).pvalue)
    assert left["p_holm"] == pytest.approx(3 * left["p"])


def test_a_choice_nobody_makes_leaves_mcnemar():
    found = compare_choices(*choices([[10, 12, 0], [2, 5, 0], [0, 0, 0]]), CHOICES)
    assert found.df == 1
    assert found.statistic == pytest.approx(10**2 / 14)
    assert found.by_choice["right"]["p"] == 1.0


def test_the_same_choices_and_missing_ones():
    before, after = choices([[4, 0, 0], [0, 3, 0], [0, 0, 2]])
    after.iloc[0] = None
    found = compare_choices(before, after, CHOICES)
    assert (found.n, found.excluded, found.changed, found.p) == (8, 1, 0, 1.0)


def test_groups_without_exchange_have_no_overall_test():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = compare_choices(pd.Series(list("aabbccdd")), pd.Series(list("bbaaddcc")), tuple("abcd"))
    assert np.isnan(found.p)


def test_an_unknown_choice_is_named():
    with pytest.raises(LgpError) as error:
        compare_choices(pd.Series(["floor"]), pd.Series(["left"]), CHOICES)
    says(error, "'floor'", "expected", *CHOICES)


def test_a_missing_library_is_said_in_one_line(monkeypatch):
    require_statsmodels()
    monkeypatch.setitem(__import__("sys").modules, "statsmodels.stats", None)
    with pytest.raises(MissingPackageError) as error:
        require_statsmodels()
    says(error, "statsmodels", 'pip install "dreba[experiments]"')


@pytest.mark.parametrize("gap", [0.0, 0.35])
def test_error_rates_over_many_studies(gap):
    """5 % without an effect, the power that theory gives with one, by both tests."""
    studies, deviation = 300, 0.3 * np.sqrt(2)
    rng = np.random.default_rng(11)
    p = []
    for differences in rng.normal(-gap, deviation, (studies, 10)):
        base = rng.normal(4.0, 1.0, 10)
        one = compare(pd.DataFrame({"a": base + differences, "b": base}), [("a", "b")])[0]
        p.append((one.p, one.wilcoxon_p))
    expected = TTestPower().power(gap / deviation, 10, 0.05) if gap else 0.05
    found = (np.array(p) < 0.05).sum(axis=0)
    assert stats.binomtest(int(found[0]), studies, expected).pvalue > 0.001
    # Signed ranks of ten pairs come in steps: at most 5 %, and with an effect a few per cent less power.
    assert stats.binomtest(int(found[1]), studies, expected - (0.05 if gap else 0.0)).pvalue > 0.001
