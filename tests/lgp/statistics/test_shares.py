"""Tests of shares against brute force, simulation and published examples."""

from itertools import product

import numpy as np
import pytest
from scipy.stats import fisher_exact, random_table

from lgp.statistics.shares import equivalent, exact_homogeneity, independent_difference, paired_difference


@pytest.mark.parametrize("table", [((3, 1), (1, 3)), ((8, 2), (1, 5)), ((10, 0), (4, 6))])
def test_two_choices_are_fishers_test(table):
    assert exact_homogeneity(*table).p == pytest.approx(fisher_exact(table).pvalue)


@pytest.mark.parametrize("table", [((5, 2, 0), (1, 3, 4)), ((4, 4, 4), (4, 4, 4)), ((6, 0, 1), (5, 0, 2))])
def test_three_choices_are_the_sum_over_all_tables(table):
    rows, columns = np.sum(table, axis=1), np.sum(table, axis=0)
    law = random_table(rows, columns)
    every = [
        np.array([head, columns - head])
        for head in (np.array(part) for part in product(*(range(c + 1) for c in columns)))
        if head.sum() == rows[0]
    ]
    chances = np.array([law.pmf(one) for one in every])
    assert chances.sum() == pytest.approx(1.0)
    observed = law.pmf(np.array(table))
    assert exact_homogeneity(*table).p == pytest.approx(chances[chances <= observed * (1 + 1e-9)].sum())


def test_hundred_runs_against_hundred():
    assert exact_homogeneity((26, 40, 34), (26, 40, 34)).p == pytest.approx(1.0)
    far = exact_homogeneity((71, 25, 4), (26, 40, 34))
    assert far.p < 1e-10
    assert far.cramer_v == pytest.approx(0.49, abs=0.01)
    assert np.isnan(exact_homogeneity((0, 0, 0), (1, 2, 3)).p)


def test_many_runs_against_hundred_take_no_more_memory_than_hundred():
    many = exact_homogeneity((260_000, 400_000, 340_000), (26, 40, 34))
    assert many.n == (1_000_000, 100)
    assert many.p == pytest.approx(1.0)
    # The order of the samples does not matter, nor which of them is the smaller one.
    assert exact_homogeneity((9, 5, 1), (2, 3, 4)).p == pytest.approx(exact_homogeneity((2, 3, 4), (9, 5, 1)).p)


def test_the_interval_of_an_independent_difference_holds_its_level():
    rng = np.random.default_rng(0)
    draws = zip(rng.binomial(20, 0.9, size=4000), rng.binomial(100, 0.95, size=4000), strict=True)
    found = [independent_difference(int(a), 20, int(b), 100) for a, b in draws]
    assert 0.93 < np.mean([one.low <= -0.05 <= one.high for one in found]) < 0.98
    ends = independent_difference(0, 20, 100, 100)
    assert ends.difference == -1.0 <= ends.low < ends.high < -0.7
    assert np.isnan(independent_difference(0, 0, 1, 100).low)


def test_the_interval_of_a_paired_difference_holds_its_level():
    rng = np.random.default_rng(0)
    chances = (0.15, 0.30, 0.55)  # left, came, stayed: a difference of 0.15
    draws = rng.multinomial(40, chances, size=4000)
    inside = [(change := paired_difference(int(a), int(b), 40)).low <= 0.15 <= change.high for a, b, _ in draws]
    assert 0.93 < np.mean(inside) < 0.98


def test_a_few_equal_runs_show_no_equivalence():
    few, many = paired_difference(0, 0, 6), paired_difference(0, 0, 100)
    assert few.difference == many.difference == 0.0
    assert not equivalent(few.low, few.high, 0.1)
    assert equivalent(many.low, many.high, 0.1)
    assert not equivalent(None, None, 0.1)
    assert not equivalent(-0.2, 0.05, 0.1)
