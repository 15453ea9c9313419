"""The parts of live scoring: windows, alerts, bounded memory, the figure."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import reba
from reba.live.command import parse_seconds
from reba.live.foxglove import COLOUR_SCALE, GREY, colour_of, skeleton_markers
from reba.live.frames import Frames, is_later
from reba.live.output import Latency
from reba.live.session import Alert, LiveScorer, score_of_level
from reba.method.scoring import UNKNOWN
from reba.posture.factors import Factors

RATE = 20.0


def frames(scores: list[int], start: float = 0.0) -> Frames:
    """Return upright postures, or with the trunk far bent and a load, so that REBA is 1, or high."""
    angles = np.zeros((len(scores), len(reba.COLUMNS)))
    angles[:, reba.COLUMNS.index("lower_arm_flexion_left")] = 80.0
    angles[:, reba.COLUMNS.index("lower_arm_flexion_right")] = 80.0
    angles[np.array(scores) > 1, 0] = 70.0
    angles[np.array(scores) > 1, reba.COLUMNS.index("knee_flexion_left")] = 70.0
    angles[np.array(scores) > 1, reba.COLUMNS.index("upper_arm_flexion_left")] = 100.0
    load = np.where(np.array(scores) > 1, 12.0, 0.0)
    return Frames(start + np.arange(len(scores)) / RATE, angles, Factors(load=load))


def test_an_alert_is_raised_and_cleared_after_the_hold() -> None:
    high = [1] * 20 + [9] * 10 + [1] * 5 + [9] * 60 + [1] * 10 + [9] * 5 + [1] * 60
    scorer = LiveScorer("measured", 2.0, Alert(7, 1.0))
    records, _ = scorer.add(frames(high))
    levels = {record["reba"] for record in records}
    assert min(levels) == 1
    assert max(levels) >= 7
    events = [(round(record["time"], 6), record["alert"]["event"]) for record in records if record["alert"]["event"]]
    # 10 frames are half a second: too short; 60 are enough, and the dip of half a second behind them clears nothing.
    first, last = 35 / RATE, (35 + 60 + 15) / RATE
    assert events == [(first + 1.0, "raised"), (last + 1.0, "cleared")]
    assert scorer.summary()["alerts"]["raised"] == 1


def test_the_window_is_the_mean_of_its_frames() -> None:
    random = np.random.default_rng(2)
    pattern = random.choice([1, 9], 400).tolist()
    records, scores = LiveScorer("measured", 3.0, Alert(8, 0.0)).add(frames(pattern))
    reba_scores = scores.reba.astype(float)
    for at in (100, 250, 399):
        inside = reba_scores[at - 60 : at]
        assert records[at]["window"]["mean"] == pytest.approx(inside.mean(), abs=1e-9)
        assert records[at]["window"]["share_above"] == pytest.approx((inside >= 8).mean(), abs=1e-9)
        assert records[at]["exposure"]["mean"] == pytest.approx(reba_scores[:at].mean(), abs=1e-9)


@given(st.lists(st.sampled_from([1, 9]), min_size=1, max_size=60), st.integers(1, 7))
def test_blocks_do_not_matter(pattern: list[int], size: int) -> None:
    whole, _ = LiveScorer("measured", 1.0, Alert(8, 0.2)).add(frames(pattern))
    scorer, parts = LiveScorer("measured", 1.0, Alert(8, 0.2)), []
    given_frames = frames(pattern)
    for at in range(0, len(pattern), size):
        part = slice(at, at + size)
        load = Factors(load=given_frames.factors.load[part])
        parts += scorer.add(Frames(given_frames.time[part], given_frames.angles[part], load))[0]
    assert parts == whole


def test_memory_does_not_grow_with_the_length() -> None:
    scorer = LiveScorer("measured", 2.0, Alert(8, 1.0))
    block = frames([1, 9] * 25)
    length = len(block.time) / RATE

    def go_on(count: int, start: int) -> None:
        for number in range(start, start + count):
            scorer.add(Frames(block.time + number * length, block.angles, block.factors))

    go_on(12, 0)
    tracemalloc.start()
    go_on(4, 12)
    before = tracemalloc.get_traced_memory()[0]
    go_on(40, 16)
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert grown < 50_000


def test_a_level_begins_at_a_score() -> None:
    levels = ["negligible", "low", "medium", "high", "very-high"]
    assert [score_of_level(level) for level in levels] == [1, 2, 4, 8, 11]


@pytest.mark.parametrize(("text", "expected"), [("2s", 2.0), ("0.5", 0.5), ("1min", 60.0), (".5 s", 0.5)])
def test_lengths_of_time(text: str, expected: float) -> None:
    assert parse_seconds("hold", text) == expected


@given(st.lists(st.floats(0, 100), min_size=1), st.floats(-1, 50))
def test_later_times_increase(times: list[float], last: float) -> None:
    selected = np.array(times)[is_later(np.array(times), last)]
    assert (np.diff(np.concatenate([[last], selected])) > 0).all()
    assert selected.max(initial=last) == max([last, *times])


def test_percentiles_are_right_to_two_percent() -> None:
    values = np.random.default_rng(1).exponential(0.01, 5000)
    times = Latency()
    for value in values.tolist():
        times.add(value)
    for share in (0.5, 0.99):
        percentile = times.percentile(share)
        assert percentile == pytest.approx(np.quantile(values, share), rel=0.03)


def test_the_skeleton_stands_and_is_coloured_by_part() -> None:
    given_frames = frames([1, 9])
    _, scores = LiveScorer("measured", 1.0, Alert(8, 1.0)).add(given_frames)
    upright, bent = (skeleton_markers(given_frames.angles[at], scores, at) for at in (0, 1))
    for shown in (upright, bent):
        assert shown.lines.shape == (len(shown.colours), 2, 3)
        assert shown.lines[..., 2].min() == pytest.approx(0.0)
    assert upright.head[2] > bent.head[2]
    assert bent.head[0] > upright.head[0] + 0.3
    # The trunk is drawn first: green upright, redder bent.
    assert upright.colours[0] == COLOUR_SCALE[0]
    assert bent.colours[0][0] > 0.8
    assert colour_of("trunk", UNKNOWN) == GREY
    assert colour_of("wrist_left", 3) == COLOUR_SCALE[-1]
