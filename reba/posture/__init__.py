"""The posture table: one row per frame, angles in degrees, NaN = not measured.

Columns, signs and units are public (README, "The posture table") and the same in every room of the packages.
"""

from __future__ import annotations

from reba.posture.columns import ANGLES, COLUMNS, INDEX, SIDES, Angle
from reba.posture.table import PostureTable, Quality

__all__ = ["ANGLES", "COLUMNS", "INDEX", "SIDES", "Angle", "PostureTable", "Quality"]
