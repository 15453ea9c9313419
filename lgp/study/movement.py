"""Random model of human motion variability: between persons, between recordings, within a recording, and in duration.

A recording is the planned motion for the stature of the person, with the duration of each action scaled, plus three
offsets of every angle: habit (equal in all recordings of a person), occasion (drawn for each recording) and smooth
noise within it. All are normal, independent over angles and equally distributed in all conditions, so that two
conditions with the same motion differ by chance only. The standard deviations are free choices in the order of those of
repeated reaching; they serve to test the statistics, not to predict people.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from lgp.study.retarget import RetargetedMotion
from reba.arrays import Array
from reba.posture.columns import ANGLES, COLUMNS, INDEX

if TYPE_CHECKING:
    import pandas as pd

STEADY: Final = ("trunk_flexion", "trunk_side_bend", "trunk_twist", "knee_flexion", "shoulder_elevation")
"""Angles of heavy or stiff parts of the body, with half the standard deviation of the others."""
NOT_NEGATIVE: Final = ("knee_flexion", "lower_arm_flexion")
"""Joints whose range ends at 0 degrees (straight)."""


@dataclass(frozen=True)
class MotionVariability:
    """Parameters of the motion variability.

    Attributes:
        stature, stature_sd: mean and standard deviation [m]; drawn values are clipped to `statures`.
        statures: shortest and tallest [m].
        habit: standard deviation between persons [deg].
        occasion: standard deviation between recordings of a person [deg].
        motor: standard deviation of the noise within a recording [deg].
        memory: time constant of the noise [s].
        speed: standard deviation between persons of the logarithm of durations.
        pace: standard deviation between the actions of a recording of the logarithm of durations.
    """

    stature: float = 1.70
    stature_sd: float = 0.10
    statures: tuple[float, float] = (1.48, 1.96)
    habit: float = 4.0
    occasion: float = 2.0
    motor: float = 2.0
    memory: float = 0.4
    speed: float = 0.15
    pace: float = 0.10


VARIATION: Final = MotionVariability()
"""Default parameters."""


@dataclass(frozen=True)
class Person:
    """Simulated participant: stature [m], habit (22,) [deg], and factor on all durations."""

    stature: float
    habit: Array
    slowness: float


@dataclass(frozen=True)
class Movement:
    """Simulated recording: time (n,) [s], angles (n, 22) [deg], load in the hands (n,) [kg]."""

    time: Array
    angles: Array
    load: Array

    def table(self) -> pd.DataFrame:
        """Posture table with a `load` column."""
        import pandas as pd

        table = pd.DataFrame(np.column_stack([self.time, self.angles, self.load]))
        return table.set_axis(["time", *COLUMNS, "load"], axis=1)


def person(rng: np.random.Generator, vary: MotionVariability = VARIATION) -> Person:
    """Draw a participant; the stature is rounded to a centimetre, as it is measured."""
    stature = float(np.clip(rng.normal(vary.stature, vary.stature_sd), *vary.statures))
    return Person(round(stature, 2), _angle_offsets(rng, vary.habit), float(np.exp(rng.normal(0.0, vary.speed))))


def perform(
    motion: RetargetedMotion,
    participant: Person,
    rng: np.random.Generator,
    *,
    rate: float = 30.0,
    vary: MotionVariability = VARIATION,
    offset: Array | float = 0.0,
) -> Movement:
    """Simulate one recording of a participant, with `rate` frames per second.

    Args:
        motion: planned motion for the stature of the participant.
        rng: of this recording alone.
        offset: (22,) [deg] added to every frame: an effect of known size.
    """
    from scipy.interpolate import PchipInterpolator

    pace = np.exp(rng.normal(0.0, vary.pace, int(motion.phase.max()) + 1))
    scaled = scale_durations(motion, participant.slowness * pace)
    time = np.arange(0.0, scaled[-1] + 1e-9, 1.0 / rate)
    angles = PchipInterpolator(scaled, motion.posture)(time)
    angles += participant.habit + _angle_offsets(rng, vary.occasion) + offset
    angles += smooth_noise(rng, len(time), rate, vary.memory) * vary.motor * WEIGHTS
    for name in NOT_NEGATIVE:
        for column in (INDEX[f"{name}_left"], INDEX[f"{name}_right"]):
            angles[:, column] = np.maximum(angles[:, column], 0.0)
    load = motion.carried[np.clip(np.searchsorted(scaled, time, side="left"), 0, len(scaled) - 1)]
    return Movement(time, angles, load)


def scale_durations(motion: RetargetedMotion, factors: Array) -> Array:
    """Times (T,) [s] of a motion with the durations of its actions multiplied by (actions,) factors.

    >>> motion = RetargetedMotion(np.arange(4.0), np.array([0, 0, 1, 1]), np.zeros((4, 22)), np.zeros(4))
    >>> scale_durations(motion, np.array([1.0, 2.0])).tolist()
    [0.0, 1.0, 3.0, 5.0]
    """
    steps = np.diff(motion.time) * factors[motion.phase[1:]]
    return np.concatenate([[0.0], np.cumsum(steps)])


def smooth_noise(rng: np.random.Generator, frames: int, rate: float, memory: float) -> Array:
    """Smooth noise (frames, 22) of unit variance: white noise through two equal first-order low-pass filters.

    One filter gives an Ornstein-Uhlenbeck process, whose velocity is not defined; a second one makes the path of the
    noise differentiable, as that of a limb is. Ten time constants before the first frame are drawn and discarded.
    """
    from scipy.signal import lfilter

    decay = float(np.exp(-1.0 / (rate * memory)))
    warm_up = int(np.ceil(10.0 * rate * memory))
    white = rng.normal(size=(warm_up + frames, len(COLUMNS)))
    # Impulse response (k + 1) decay^k, with the sum of squares (1 + decay^2) / (1 - decay^2)^3.
    scale = np.sqrt((1.0 - decay**2) ** 3 / (1.0 + decay**2))
    noise: Array = scale * lfilter([1.0], [1.0, -2.0 * decay, decay**2], white, axis=0)[warm_up:]
    return noise


def _weights() -> Array:
    return np.array([0.5 if angle.name in STEADY else 1.0 for angle in ANGLES for _ in angle.columns])


WEIGHTS: Final[Array] = _weights()
"""Factors (22,) on the standard deviations of the angles."""


def _angle_offsets(rng: np.random.Generator, degrees: float) -> Array:
    return rng.normal(0.0, degrees, len(COLUMNS)) * WEIGHTS
