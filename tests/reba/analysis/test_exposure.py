"""Exposure over time, against examples worked out by hand."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reba
from reba.analysis.exposure import (
    HELD_SECONDS,
    Distribution,
    distribution,
    durations,
    intervals,
    level_shares,
    sustained,
    worst_intervals,
)

# Trunk flexion (elbows at 80 deg, load 12 kg, nothing else) -> REBA.
TRUNK = {2: 0.0, 3: 15.0, 4: 30.0, 5: 70.0}


def scores_of(reba_scores: list[int | None], time: np.ndarray | None = None) -> reba.Scores:
    """Return scores with given REBA values (2 to 5 by the trunk; None by an unmeasured trunk)."""
    n = len(reba_scores)
    frame = pd.DataFrame(dict.fromkeys(reba.COLUMNS, np.zeros(n)))
    for side in ("left", "right"):
        frame[f"lower_arm_flexion_{side}"] = 80.0
    frame["trunk_flexion"] = [np.nan if score is None else TRUNK[score] for score in reba_scores]
    frame["time"] = np.arange(n) * 1.0 if time is None else time
    return reba.score(frame, load=12.0, activity="none")


def test_the_helper_gives_these_scores() -> None:
    # A(1..4, 1, 1) = 1, 2, 2, 3; plus 2 for the load: C(3..5, 1) = 2, 3, 3, 4.
    scores = scores_of([2, 3, 4, 5])
    assert scores.data["reba"].tolist() == [2, 3, 3, 4]


def test_durations() -> None:
    np.testing.assert_allclose(durations(np.array([0.0, 1.0, 2.0, 3.0])), [1, 1, 1, 1])
    # Steps up to five periods are time; longer ones are gaps that count one period.
    np.testing.assert_allclose(durations(np.array([0.0, 0.1, 0.2, 0.7, 0.8, 5.0])), [0.1, 0.1, 0.5, 0.1, 0.1, 0.1])
    np.testing.assert_allclose(durations(np.array([0.0, 0.01, 0.02, 0.2, 0.21])), [0.01, 0.01, 0.18, 0.01, 0.01])
    assert durations(np.array([3.0])).tolist() == [1.0]
    assert durations(np.zeros(0)).tolist() == []


def test_distribution_by_hand() -> None:
    weights = np.array([6.0, 3.0, 1.0])
    assert distribution(np.array([1, 5, 9]), weights) == Distribution(mean=3.0, median=1, p90=5, max=9)
    assert distribution(np.array([1, 5, 9]), np.array([4.0, 3.0, 3.0])).p90 == 9
    assert distribution(np.array([1, np.nan, 9]), weights).mean == pytest.approx(15 / 7)
    assert distribution(np.array([np.nan]), np.ones(1)) == Distribution(None, None, None, None)
    assert distribution(np.zeros(0), np.zeros(0)) == Distribution(None, None, None, None)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.integers(1, 15), st.integers(1, 9)), min_size=1, max_size=30))
def test_percentiles_of_weights_are_those_of_repeats(pairs: list[tuple[int, int]]) -> None:
    values, weights = np.array(pairs).T
    repeated = np.sort(np.repeat(values, weights))
    found = distribution(values, weights.astype(float))
    for q, value in ((0.5, found.median), (0.9, found.p90)):
        assert value in repeated
        assert (repeated <= value).mean() >= q - 1e-9
        assert (repeated < value).mean() <= q + 1e-9
    assert found.mean == pytest.approx(repeated.mean())
    assert found.max == repeated[-1]


def test_level_shares() -> None:
    shares = level_shares(scores_of([2, 2, 3, 5, None]))
    assert shares == pytest.approx({"0": 0, "1": 0.6, "2": 0.2, "3": 0, "4": 0, "undetermined": 0.2})


def test_gaps_do_not_weigh() -> None:
    scores = scores_of([2, 2, 5, 5], np.array([0.0, 1.0, 2.0, 100.0]))
    assert scores.summary()["reba"]["mean"] == pytest.approx(3.0)
    assert scores.summary()["seconds"] == pytest.approx(4.0)
    assert [(s.start, s.end) for s in intervals(scores, 4)] == [(2.0, 3.0), (100.0, 101.0)]


@pytest.mark.parametrize(("frames", "score"), [(9, 2), (10, 4), (11, 4)])
def test_a_score_counts_as_held_after_one_second(frames: int, score: int) -> None:
    values: list[int | None] = [2] * 20 + [5] * frames + [2] * 20
    assert sustained(scores_of(values, np.arange(len(values)) * 0.1)) == score


def test_worst_intervals() -> None:
    values: list[int | None] = [2] * 5 + [5] * 2 + [3] * 4 + [2] * 3 + [5] * 6 + [2] * 3
    found = worst_intervals(scores_of(values))
    assert [(s.start, s.end, s.reba) for s in found[:2]] == [(14.0, 20.0, 4), (5.0, 7.0, 4)]
    assert values[found[0].frame] == 5
    assert [s.reba for s in found] == sorted((s.reba for s in found), reverse=True)


def test_the_highest_score_comes_first() -> None:
    """A short time at a score is worse than a long one below it, not than a long one in which a higher one occurs."""
    values: list[int | None] = [2] * 20 + [3] * 12 + [5] * 4 + [3] * 12 + [2] * 20 + [3] * 40 + [2] * 20
    scores = scores_of(values, np.arange(len(values)) * 0.1)
    found = worst_intervals(scores)
    assert found[0].reba == 3
    reached = [int(scores.data["reba"].iloc[one.frame]) for one in found]
    assert reached == sorted(reached, reverse=True)


def test_a_sustained_score_has_both_ends() -> None:
    held = scores_of([None] * 30 + [3] * 30).summary()["held"]
    assert (held["reba"], held["reba_high"]) == (3, 4)


def test_flicker_does_not_end_an_interval() -> None:
    """Two frames below the score inside three seconds are noise; a second below it is a pause."""
    values: list[int | None] = [2] * 10 + [5] * 15 + [3] * 2 + [5] * 15 + [3] * 10 + [5] * 12 + [2] * 10
    found = worst_intervals(scores_of(values, np.arange(len(values)) * 0.1))
    assert [(round(s.start, 1), round(s.end, 1)) for s in found[:2]] == [(1.0, 4.2), (5.2, 6.4)]
    # A peak of one frame now and then is no interval: the pauses are longer than the peaks.
    peaks: list[int | None] = ([3] * 4 + [5]) * 10
    assert all(s.end - s.start < 0.2 for s in worst_intervals(scores_of(peaks, np.arange(50) * 0.1)) if s.reba == 4)
    # A gap ends it.
    time = np.arange(len(values)) * 0.1 + np.where(np.arange(len(values)) >= 26, 5.0, 0.0)
    assert (1.0, 2.5) in [(round(s.start, 1), round(s.end, 1)) for s in worst_intervals(scores_of(values, time))]


@settings(max_examples=40, deadline=None)
@given(st.lists(st.sampled_from([2, 3, 5, None]), min_size=1, max_size=60), st.sampled_from([0.1, 0.5, 1.0]))
def test_shares_and_worst_intervals_hold_together(values: list[int | None], period: float) -> None:
    scores = scores_of(values, np.arange(len(values)) * period)
    summary = scores.summary()
    assert sum(summary["action_levels"].values()) + summary["action_level_undetermined"] == pytest.approx(1.0)
    worst = sorted(worst_intervals(scores), key=lambda s: s.start)
    assert all(a.end <= b.start + 1e-9 for a, b in itertools.pairwise(worst))
    low = scores.data["reba_low"].to_numpy(int)
    for interval in worst:
        inside = (scores.time >= interval.start - 1e-9) & (scores.time < interval.end - 1e-9)
        below = np.flatnonzero(inside & (low < interval.reba))
        assert below.size <= inside.sum() / 2
        for pause in np.split(below, np.flatnonzero(np.diff(below) > 1) + 1):
            assert pause.size * period < HELD_SECONDS
        assert low[interval.frame] == low[inside].max()
    assert summary["range"]["mean_low"] <= summary["range"]["mean_high"]


def test_summary_is_the_public_shape() -> None:
    summary = scores_of([2, 3, 5, None]).summary()
    assert set(summary) >= {"frames", "seconds", "rules", "profile", "unmeasured", "assumed", "reba", "range",
                            "action_levels", "worst", "parts"}  # fmt: skip
    assert set(summary["reba"]) == {"mean", "median", "p90", "max"}
    assert set(summary["range"]) >= {"mean_low", "mean_high"}
    assert list(summary["action_levels"]) == ["0", "1", "2", "3", "4"]
    assert all(set(worst) >= {"time", "reba", "why"} for worst in summary["worst"])
    assert summary["parts"]["trunk"] == {"mean": pytest.approx((1 + 2 + 4) / 3), "determined": 0.75}
    assert summary["rules"]["name"] == "measured"
    assert summary["rules"]["trunk_upright"] == 5.0
    assert "right arm unsupported" in summary["assumed"]


def test_nothing_determined() -> None:
    summary = scores_of([None, None]).summary()
    assert summary["reba"] == {"mean": None, "median": None, "p90": None, "max": None}
    assert summary["action_level_undetermined"] == 1.0
    assert all(worst["reba"] is None for worst in summary["worst"])


def test_empty_recording() -> None:
    summary = scores_of([]).summary()
    assert (summary["frames"], summary["seconds"], summary["worst"]) == (0, 0.0, [])
