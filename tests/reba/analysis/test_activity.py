"""Activity from the movement: signals with known answers."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reba
from reba.analysis.activity import Activity, detect, turning_movements
from reba.posture.columns import INDEX

RULES = reba.Rules()


def angles_of(n: int, **columns: object) -> np.ndarray:
    """Return (n, 22) unmeasured angles with some columns given."""
    angles = np.full((n, len(reba.COLUMNS)), np.nan)
    for name, values in columns.items():
        angles[:, INDEX[name]] = values
    return angles


def found(
    time: np.ndarray, rules: reba.Rules = RULES, walking: np.ndarray | None = None, **columns: object
) -> Activity:
    return detect(time, angles_of(len(time), **columns), rules, walking)


def clock(seconds: float, rate: float) -> np.ndarray:
    return np.arange(round(seconds * rate) + 1) / rate


def sine(time: np.ndarray, per_minute: float, swing: float) -> np.ndarray:
    return swing / 2 * np.sin(2 * np.pi * per_minute / 60 * time)


# -- static --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [1.0, 10.0, 20.0, 25.0, 60.0, 100.0])
@pytest.mark.parametrize(("seconds", "static"), [(59, False), (60, False), (62, True)])
def test_a_hold_of_about_a_minute(rate: float, seconds: float, static: bool) -> None:
    """60 s is not longer than 60 s; both ends of the hold jump away at once."""
    time = clock(120, rate)
    held = (time >= 20) & (time <= 20 + seconds)
    other = np.where(np.arange(len(time)) % 2, 40.0, 70.0)  # never still outside the hold
    result = found(time, trunk_flexion=np.where(held, 10.0, other))
    assert result.static.any() == static
    if static:
        nearly = (time >= 20 - 0.05) & (time <= 20 + seconds + 0.05)  # frames stand on a grid of 20 Hz
        assert not (result.static & ~nearly).any()
        assert result.static[held].mean() > 0.97
        assert result.causes["static"] == {"trunk": pytest.approx(result.static.mean())}


@pytest.mark.parametrize(("band", "static"), [(10.0, True), (10.5, False)])
def test_the_band_of_a_hold(band: float, static: bool) -> None:
    time = clock(90, 20)
    assert found(time, trunk_flexion=sine(time, 60, band) * (1 - 1e-12)).static.any() == static


def test_all_angles_of_the_part_must_hold() -> None:
    time = clock(90, 10)
    moving = sine(time, 6, 40)
    assert not found(time, trunk_flexion=0.0, trunk_twist=moving).static.any()
    assert found(time, trunk_flexion=0.0, neck_flexion=moving).causes["static"] == {"trunk": 1.0}


def test_a_gap_ends_a_hold() -> None:
    time = clock(80, 10)
    flexion = np.zeros(len(time))
    flexion[400:420] = np.nan
    assert not found(time, trunk_flexion=flexion).static.any()
    flexion[400:420] = 0.0
    flexion[400:403] = np.nan  # three samples in a row are bridged
    assert found(time, trunk_flexion=flexion).static.all()
    without = np.delete(time, slice(400, 420))
    assert not found(without, trunk_flexion=np.zeros(len(without))).static.any()


@pytest.mark.parametrize("step", [5.0, 10.0, 30.0])
def test_sparse_observations_keep_their_time(step: float) -> None:
    time = np.arange(0.0, 300.0, step)
    assert found(time, trunk_flexion=0.0).static.all()
    short = np.arange(0.0, 60.0 + step / 2, step)
    assert not found(short, trunk_flexion=0.0).static.any()


# -- repeated ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("per_minute", "repeated"), [(2.0, False), (3.5, False), (6.0, True), (20.0, True)])
@pytest.mark.parametrize("rate", [5.0, 20.0, 90.0])
def test_the_rate_of_repetition(per_minute: float, repeated: bool, rate: float) -> None:
    time = clock(180, rate)
    result = found(time, wrist_flexion_left=sine(time, per_minute, 30))
    assert result.repeated.any() == repeated
    if repeated:
        assert result.repeated.mean() > 0.9
        assert set(result.causes["repeated"]) == {"wrist_left"}


@pytest.mark.parametrize(("swing", "repeated"), [(9.0, False), (12.0, True), (58.0, True), (65.0, False)])
def test_the_range_of_repetition(swing: float, repeated: bool) -> None:
    time = clock(120, 20)
    assert found(time, lower_arm_flexion_right=80 + sine(time, 12, swing)).repeated.any() == repeated


def test_noise_is_no_repetition() -> None:
    time = clock(120, 50)
    noise = np.random.default_rng(0).normal(0, 1.0, len(time))
    result = found(time, trunk_flexion=noise, wrist_flexion_left=noise)
    assert not result.repeated.any()
    assert not result.unstable.any()


def test_a_burst_counts_only_while_it_lasts() -> None:
    time = clock(300, 20)
    inside = (time > 100) & (time < 130)
    result = found(time, wrist_flexion_left=np.where(inside, sine(time, 24, 40), 0.0))
    assert result.repeated[(time > 102) & (time < 128)].all()
    assert not result.repeated[(time < 95) | (time > 135)].any()


def gait(time: np.ndarray, strides: float) -> dict[str, np.ndarray]:
    phase = 2 * np.pi * strides / 60 * time
    return {
        "knee_flexion_left": 30 + 28 * np.sin(phase),
        "knee_flexion_right": 30 + 28 * np.sin(phase + np.pi),
        "upper_arm_flexion_left": 20 * np.sin(phase + np.pi),
        "upper_arm_flexion_right": 20 * np.sin(phase),
    }


def test_walking_is_neither_repeated_nor_rapid_legs() -> None:
    time = clock(60, 60)
    result = found(time, **gait(time, 55))
    assert not result.repeated[120:-120].any()
    assert not result.unstable.any()


def test_slow_alternation_is_no_walking() -> None:
    time = clock(120, 20)
    assert found(time, **gait(time, 10)).repeated.any()


def test_knees_that_bend_together_are_no_walking() -> None:
    time = clock(60, 20)
    squats = 30 + sine(time, 12, 50)
    assert found(time, knee_flexion_left=squats, knee_flexion_right=squats).repeated.any()


def test_walking_can_be_given() -> None:
    time = clock(120, 20)
    squats = 30 + sine(time, 12, 50)
    known = np.ones(len(time), bool)
    assert not found(time, walking=known, knee_flexion_left=squats, knee_flexion_right=squats).repeated.any()


# -- rapid large changes -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("change", "seconds", "unstable"), [(65, 0.3, True), (55, 0.3, False), (65, 1.0, False)])
@pytest.mark.parametrize("rate", [20.0, 50.0, 120.0])
def test_rapid_changes(change: float, seconds: float, unstable: bool, rate: float) -> None:
    time = clock(20, rate)
    result = found(time, trunk_flexion=np.interp(time, [10, 10 + seconds], [0, change]))
    assert result.unstable.any() == unstable
    if unstable:
        assert result.unstable[(time > 10) & (time < 10 + seconds)].all()
        assert not result.unstable[(time < 9.3) | (time > 11.0)].any()


def test_hands_may_be_fast() -> None:
    time = clock(20, 50)
    jump = np.where(time > 10, 80.0, 0.0)
    assert not found(time, wrist_flexion_left=jump, lower_arm_flexion_left=jump).unstable.any()
    assert found(time, upper_arm_flexion_left=jump).causes["unstable"].keys() == {"upper_arm_left"}


def test_a_jump_across_a_gap_is_not_rapid() -> None:
    time = np.concatenate([clock(10, 20), 15 + clock(10, 20)])
    assert not found(time, trunk_flexion=np.where(time > 12, 90.0, 0.0)).unstable.any()


# -- short, broken and irregular recordings --------------------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 1, 2, 3])
@pytest.mark.parametrize("make", [np.zeros, lambda n: np.full(n, np.nan)])
def test_few_frames(n: int, make: Callable[[int], np.ndarray]) -> None:
    result = found(np.arange(n) * 0.1, trunk_flexion=make(n))
    for flags in (result.static, result.repeated, result.unstable):
        assert flags.shape == (n,)
        assert not flags.any()


def test_nothing_measured() -> None:
    result = found(clock(120, 10))
    assert not (result.static | result.repeated | result.unstable).any()
    assert result.causes == {"static": {}, "repeated": {}, "unstable": {}}


def test_constant_time() -> None:
    assert not found(np.zeros(10), trunk_flexion=0.0).static.any()


def test_a_clock_that_jumps_by_hours() -> None:
    """Two holds far apart: each counts for itself, and the grid stays small."""
    time = np.concatenate([clock(70, 20), 1e9 + clock(70, 20), 2e9 + clock(30, 20)])
    result = found(time, trunk_flexion=0.0)
    assert result.static[: 2 * 1401].all()
    assert not result.static[2 * 1401 :].any()


def test_irregular_sampling() -> None:
    rng = np.random.default_rng(1)
    time = np.sort(rng.uniform(0, 180, 4000))
    result = found(time, trunk_flexion=0.0, wrist_flexion_left=sine(time, 10, 30))
    assert result.static.mean() > 0.95
    assert result.repeated.mean() > 0.9


def test_input_is_not_changed() -> None:
    time = clock(80, 10)
    angles = angles_of(len(time), trunk_flexion=0.0)
    before, walking = angles.copy(), np.zeros(len(time), bool)
    detect(time, angles, RULES, walking)
    np.testing.assert_array_equal(angles, before)
    assert not walking.any()


# -- swings --------------------------------------------------------------------------------------------------------


def mostturning_movements(signal: list[int], least: int) -> int:
    """Return the most movements to and fro of at least `least` that any choice of turning points gives."""
    up, down = [0] * len(signal), [0] * len(signal)
    for end in range(len(signal)):
        for start in range(end):
            if signal[end] - signal[start] >= least:
                up[end] = max(up[end], down[start] + 1)
            if signal[start] - signal[end] >= least:
                down[end] = max(down[end], up[start] + 1)
    return max(up + down)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.integers(-6, 6), min_size=2, max_size=40), st.integers(1, 6))
def test_swings_by_brute_force(values: list[int], least: int) -> None:
    signal = np.array(values, float)
    swings = list(turning_movements(signal, least))
    sizes = [signal[end] - signal[start] for start, end in swings]
    assert all(abs(size) >= least for size in sizes)
    assert all(a < b for a, b in swings)
    for (_, end), (start, _) in itertools.pairwise(swings):
        assert end == start
    assert all(a * b < 0 for a, b in itertools.pairwise(sizes))
    # Within a swing nothing lies beyond its ends and nothing turns back by `least`.
    for (start, end), size in zip(swings, sizes, strict=True):
        inside = np.sign(size) * signal[start : end + 1]
        assert inside.max() == inside[-1]
        assert inside.min() == inside[0]
        assert (np.maximum.accumulate(inside) - inside).max() < least
    assert len(swings) == mostturning_movements(values, least)


def test_swings_of_a_triangle() -> None:
    signal = np.array([0.0, 10.0, 20.0, 10.0, 0.0, 10.0, 20.0])
    assert list(turning_movements(signal, 15.0)) == [(0, 2), (2, 4), (4, 6)]
    assert list(turning_movements(signal, 25.0)) == []
    signal[3] = np.nan
    assert list(turning_movements(signal, 15.0)) == [(0, 2), (2, 4), (4, 6)]
