"""Movement between key postures: minimum-jerk interpolation, tremor and quantisation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def minimum_jerk(keys: Array, durations: Array, rate: float) -> Array:
    """Interpolate between key postures with the minimum-jerk profile of Flash and Hogan (1985).

    Args:
        keys: (k, d) postures.
        durations: (k - 1,) seconds from each posture to the next.
        rate: samples per second.

    Returns:
        (n, d) postures from the first key at time 0, all derivatives continuous but the jerk at the keys.

    >>> minimum_jerk(np.array([[0.0], [1.0]]), np.array([1.0]), 4.0).round(3).ravel().tolist()
    [0.0, 0.104, 0.5, 0.896, 1.0]
    """
    ends = np.concatenate([[0.0], np.cumsum(durations)])
    time = np.arange(int(np.floor(ends[-1] * rate)) + 1) / rate
    start = np.clip(np.searchsorted(ends, time, side="right") - 1, 0, len(durations) - 1)
    share = np.clip((time - ends[start]) / durations[start], 0.0, 1.0)[:, None]
    step = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    return keys[start] + step * (keys[start + 1] - keys[start])


def tremor(rng: np.random.Generator, shape: tuple[int, int], amount: float, width: int = 5) -> Array:
    """Smooth noise (n, d) with standard deviation `amount` and a correlation of about `width` samples."""
    window = np.hanning(width + 2)[1:-1]
    window *= amount / np.sqrt((window**2).sum())
    white = rng.standard_normal((shape[0] + width - 1, shape[1]))
    return np.stack([np.convolve(column, window, mode="valid") for column in white.T], axis=1)


def quantise(values: Array, bits: int) -> Array:
    """Round to multiples of 2**-bits: such doubles end in zero bytes and compress well."""
    scale = float(2**bits)
    return np.rint(values * scale) / scale
