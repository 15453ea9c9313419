"""How people differ when they do the same: habits, occasions, motor noise and speed, as a seeded model.

A recording is the course of the plan for the person's stature, each action stretched in time, plus three offsets of
every angle: a habit (the same in all of a person's recordings), an occasion (drawn for each recording) and smooth noise
within it. All are normal, independent over angles and without regard to the condition, so two conditions with the same
course differ by chance alone. The numbers are free choices, in the size of what repeated reaches of people vary by;
they serve to try the statistics, not to predict people.
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
"""Angles of heavy or stiff parts, which vary by half as much as others."""
NEVER_BACKWARDS: Final = ("knee_flexion", "lower_arm_flexion")
"""Joints that end at straight."""


@dataclass(frozen=True)
class MotionVariability:
    """How much people vary.

    Attributes:
        stature, stature_sd: [m] mean and spread; drawn within `statures`.
        statures: [m] shortest and tallest.
        habit: [deg] spread between people.
        occasion: [deg] spread between recordings of one person.
        motor: [deg] spread of the noise within a recording.
        memory: [s] time constant of the noise.
        speed: spread of the logarithm of durations between people.
        pace: the same between the actions of a recording.
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
"""The default."""


@dataclass(frozen=True)
class Person:
    """A simulated participant: stature [m], habit (22,) [deg], and factor on all durations."""

    stature: float
    habit: Array
    slowness: float


@dataclass(frozen=True)
class Movement:
    """A simulated recording: time (n,) [s], angles (n, 22) [deg], load held (n,) [kg]."""

    time: Array
    angles: Array
    load: Array

    def table(self) -> pd.DataFrame:
        """Return it as a posture table with a `load` column."""
        import pandas as pd

        table = pd.DataFrame(np.column_stack([self.time, self.angles, self.load]))
        return table.set_axis(["time", *COLUMNS, "load"], axis=1)


def person(rng: np.random.Generator, vary: MotionVariability = VARIATION) -> Person:
    """Draw a participant; stature is known to the centimetre, as it is measured."""
    stature = float(np.clip(rng.normal(vary.stature, vary.stature_sd), *vary.statures))
    return Person(round(stature, 2), _spread(rng, vary.habit), float(np.exp(rng.normal(0.0, vary.speed))))


def perform(
    course: RetargetedMotion,
    who: Person,
    rng: np.random.Generator,
    *,
    rate: float = 30.0,
    vary: MotionVariability = VARIATION,
    offset: Array | float = 0.0,
) -> Movement:
    """Return one recording.

    Args:
        course: for the person's stature.
        who: the participant.
        rng: of this recording alone.
        rate: frames a second.
        vary: how much this recording varies.
        offset: (22,) [deg] added to every frame: an effect of known size.
    """
    from scipy.interpolate import PchipInterpolator

    stretched = stretch(course, who.slowness * np.exp(rng.normal(0.0, vary.pace, int(course.phase.max()) + 1)))
    time = np.arange(0.0, stretched[-1] + 1e-9, 1.0 / rate)
    angles = PchipInterpolator(stretched, course.posture)(time)
    angles += who.habit + _spread(rng, vary.occasion) + offset
    angles += smooth_noise(rng, len(time), rate, vary.memory) * vary.motor * WEIGHTS
    for name in NEVER_BACKWARDS:
        for column in (INDEX[f"{name}_left"], INDEX[f"{name}_right"]):
            angles[:, column] = np.maximum(angles[:, column], 0.0)
    held = course.carried[np.clip(np.searchsorted(stretched, time, side="left"), 0, len(stretched) - 1)]
    return Movement(time, angles, held)


def stretch(course: RetargetedMotion, factors: Array) -> Array:
    """Return the times (T,) [s] of a course whose actions take longer by (actions,) factors.

    >>> course = Course(np.arange(4.0), np.array([0, 0, 1, 1]), np.zeros((4, 22)), np.zeros(4))
    >>> stretch(course, np.array([1.0, 2.0])).tolist()
    [0.0, 1.0, 3.0, 5.0]
    """
    steps = np.diff(course.time) * factors[course.phase[1:]]
    return np.concatenate([[0.0], np.cumsum(steps)])


def smooth_noise(rng: np.random.Generator, frames: int, rate: float, memory: float) -> Array:
    """Return (frames, 22) smooth noise of unit variance: white noise through two equal first-order low passes.

    Once filtered it is an Ornstein-Uhlenbeck process, which jumps about; twice, its path has a velocity, as a limb has.
    It starts as it goes on: what precedes the recording is drawn too and dropped.
    """
    from scipy.signal import lfilter

    keep = float(np.exp(-1.0 / (rate * memory)))
    before = int(np.ceil(10.0 * rate * memory))
    white = rng.normal(size=(before + frames, len(COLUMNS)))
    # The impulse response is (k + 1) keep^k, whose squares add up to (1 + keep^2) / (1 - keep^2)^3.
    scale = np.sqrt((1.0 - keep**2) ** 3 / (1.0 + keep**2))
    found: Array = scale * lfilter([1.0], [1.0, -2.0 * keep, keep**2], white, axis=0)[before:]
    return found


def _weights() -> Array:
    return np.array([0.5 if angle.name in STEADY else 1.0 for angle in ANGLES for _ in angle.columns])


WEIGHTS: Final[Array] = _weights()
"""(22,) factor on all spreads of an angle."""


def _spread(rng: np.random.Generator, degrees: float) -> Array:
    return rng.normal(0.0, degrees, len(COLUMNS)) * WEIGHTS
