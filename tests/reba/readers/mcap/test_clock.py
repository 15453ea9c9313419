"""The clock of a channel: taken in at once or message by message, thinned or not, it is the same."""

from __future__ import annotations

import numpy as np
import pytest

from reba.readers.mcap.clock import ChannelClock, RecordingClock, channel_clock
from reba.readers.mcap.trace import MOST_POINTS, Nanoseconds, Trace

SECOND = 10**9
LOG = 1_700_000_000 * SECOND + np.arange(600) * SECOND // 50


def restart(stamp: Nanoseconds, at: int) -> Nanoseconds:
    return np.concatenate([stamp[:at], stamp[:-at]])


STAMPS = {
    "even": LOG - LOG[0],
    "restart": restart(LOG - LOG[0], 400),
    "unset at first": np.maximum(LOG - LOG[5], 0),
    "unset at first, and a restart": restart(np.maximum(LOG - LOG[20], 0), 400),
}


def clock_of(stamp: Nanoseconds, size: int, *, thin: bool = False) -> ChannelClock:
    trace = Trace()
    for at in range(0, len(stamp), size):
        trace.add(LOG[at : at + size], stamp[at : at + size].copy())
        if thin:
            trace.thin()
    return channel_clock(trace, use_stamps=True)


@pytest.mark.parametrize("name", STAMPS)
@pytest.mark.parametrize("size", [1, 7])
def test_how_messages_arrive_changes_nothing(name: str, size: int) -> None:
    stamp = STAMPS[name]
    whole, parts = clock_of(stamp, len(stamp)), clock_of(stamp, size)
    assert [(one.start, one.restarted) for one in whole.passes] == [(one.start, one.restarted) for one in parts.passes]
    numbers = np.arange(len(stamp))
    np.testing.assert_array_equal(whole.times(numbers, LOG, stamp)[0], parts.times(numbers, LOG, stamp)[0])


def test_a_restart_after_stamps_that_were_not_set_is_one() -> None:
    assert clock_of(STAMPS["unset at first, and a restart"], 600).restarts == 1


def test_an_endless_recording_takes_bounded_memory() -> None:
    trace = Trace()
    for at in range(3 * MOST_POINTS):
        log = LOG[:1] + at * SECOND // 50
        trace.add(log, log - LOG[0] - (0 if at < MOST_POINTS else 30 * SECOND))
        trace.thin()
    assert len(trace.points().number) <= MOST_POINTS + 1
    clock = channel_clock(trace, use_stamps=True)
    assert [one.start for one in clock.passes] == [0, MOST_POINTS]


def test_stamps_of_whole_seconds_are_no_clock() -> None:
    stamp = (LOG // SECOND) * SECOND
    clock = clock_of(stamp, 50)
    assert not clock.by_stamp
    np.testing.assert_array_equal(clock.times(np.arange(600), LOG, stamp)[0], LOG)


def test_messages_of_one_stamp_that_come_together_keep_it() -> None:
    """Transforms that are sent one by one, here 23 in each second."""
    trace = Trace()
    log = LOG[0] + np.repeat(np.arange(30), 23) * SECOND + np.tile(np.arange(23), 30) * 100_000
    trace.add(log, log // SECOND * SECOND)
    assert channel_clock(trace, use_stamps=True).by_stamp


@pytest.mark.parametrize("joints", [(), (400,), (200, 450)])
@pytest.mark.parametrize("frames", [(), (300,), (400,), (410,), (150, 450)])
@pytest.mark.parametrize("back", [100, 149])
def test_topics_whose_clocks_do_not_restart_alike_stay_together(
    joints: tuple[int, ...], frames: tuple[int, ...], back: int
) -> None:
    """A player that loops one of two topics, or simulators that are reset one after the other."""
    traces, stamps = [], []
    for restarts in (frames, joints):
        stamp = LOG - back * SECOND // 50 * np.searchsorted(restarts, np.arange(600), side="right")
        traces.append(Trace())
        traces[-1].add(LOG, stamp.copy())
        stamps.append(stamp)
    clock = RecordingClock(traces)
    assert clock.source == "header.stamp"
    for channel, stamp in zip(clock.channels, stamps, strict=True):
        np.testing.assert_array_equal(channel.times(np.arange(600), LOG, stamp)[0], LOG)
    alone = [at for at in joints if all(abs(at - other) > 25 for other in frames)]
    assert [round((seam - LOG[0]) * 50 / SECOND) for seam in clock.seams] == sorted([*frames, *alone])


def test_one_topic_that_restarts_beside_another_clock_is_read_by_log_time() -> None:
    traces = [Trace(), Trace()]
    traces[0].add(LOG, LOG.copy())
    traces[1].add(LOG, restart(LOG - LOG[0], 400))
    clock = RecordingClock(traces)
    assert clock.source == "log_time"
    assert "differ by" in clock.why
