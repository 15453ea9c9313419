"""Numbers that writers put where they have no value, such as -9999."""

from __future__ import annotations

from typing import Final

import numpy as np

from reba.arrays import Array, Flags

CODES: Final = (999.0, 999.9, 999.99, 9999.0, 9999.9, 9999.99, 99999.0, 99999.9, 999999.0)
"""Absolute values of codes, ascending; 999.0 is beyond any angle in degrees and any load in kilograms."""


def coded(values: Array) -> Flags:
    """Return which numbers are codes.

    >>> coded(np.array([-999.0, 999.5, 0.0, np.nan])).tolist()
    [True, False, False, False]
    """
    size = np.abs(values)
    large = np.asarray(size >= CODES[0])
    return large & np.isin(size, CODES) if large.any() else large  # the search takes ten times as long
