"""Body measures: segment lengths scaled by stature and sex (de Leva 1996, Drillis & Contini 1966), from human.toml."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from lgp.errors import SceneError
from reba.errors import did_you_mean

TABLE = Path(__file__).parent / "data" / "human.toml"
STATURE = (1.40, 2.10)
"""[m] Range of adult statures to which the body measures are scaled."""


@cache
def table() -> dict[str, Any]:
    """Return human.toml: joints, segments, frames, capsules and sources (read once)."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


def lengths(stature: float, sex: str) -> dict[str, float]:
    """Return body measure -> length [m].

    Raises:
        SceneError: unknown sex, or stature out of range.

    >>> round(lengths(1.741, "male")["upper_arm"], 4)
    0.2817
    """
    by_sex = table()["de_leva"]
    if sex not in by_sex:
        raise SceneError(f"human sex is {sex!r}, expected one of {', '.join(by_sex)}{did_you_mean(sex, by_sex)}")
    if not STATURE[0] <= stature <= STATURE[1]:
        raise SceneError(f"human stature is {stature:g} m, expected {STATURE[0]} to {STATURE[1]} m")
    segments = {name: value for name, value in by_sex[sex].items() if name != "stature"}
    scale = stature / by_sex[sex]["stature"]
    fractions = {name: fraction * stature for name, fraction in table()["fractions"].items()}
    return {name: value * scale for name, value in segments.items()} | fractions
