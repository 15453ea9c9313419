"""Angle percentiles and the share of time in each class of every angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.gravity import against_gravity
from reba.limits import quantities
from reba.posture import INDEX
from reba.report.phrases import angle_name
from reba.report.recording import Recording

QUANTILES: Final = (0.05, 0.50, 0.95)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AngleRow:
    """One measured angle.

    Attributes:
        name: for people.
        lowest, p5, p50, p95, highest: time-weighted percentiles and extremes [deg].
        measured: share of time with a value.
        beyond: (class in words, share of the measured time) of every class but the lowest that occurs.
    """

    name: str
    lowest: float
    p5: float
    p50: float
    p95: float
    highest: float
    measured: float
    beyond: tuple[tuple[str, float], ...]


def angle_rows(record: Recording) -> list[AngleRow]:
    """Return the measured angles as they are scored, in worksheet order."""
    if not record.frames:
        return []
    angles = np.array(record.scores.angles.T, np.float64, order="C")
    if record.scores.rules.upper_arm_reference == "gravity":
        against_gravity(angles)
    found = []
    for quantity in quantities(record.scores.rules):
        for column in quantity.columns:
            values = angles[INDEX[column]]
            known = ~np.isnan(values)
            if not known.any():
                continue
            weights = record.weights[known]
            values = values[known]
            left = np.ones(len(values), bool)
            beyond = []
            for index, one in enumerate(quantity.classes):
                inside = left & (values >= one.low) & (values <= one.high)
                left &= ~inside
                share = float(weights[inside].sum() / weights.sum())
                if index and share > 0:
                    beyond.append((one.text, share))
            p5, p50, p95 = _quantiles(values, weights)
            found.append(
                AngleRow(
                    name=angle_name(column),
                    lowest=float(values.min()),
                    p5=p5,
                    p50=p50,
                    p95=p95,
                    highest=float(values.max()),
                    measured=float(weights.sum() / record.seconds),
                    beyond=tuple(beyond),
                )
            )
    return found


def _quantiles(values: Array, weights: Array) -> list[float]:
    """Return weighted quantiles that are values that occurred."""
    order = np.argsort(values)
    reached = np.cumsum(weights[order])
    at = np.searchsorted(reached, np.array(QUANTILES) * reached[-1] - 1e-9)
    return [float(value) for value in values[order][np.minimum(at, len(values) - 1)]]
