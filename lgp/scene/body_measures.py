"""The human: joints, limits and frames from a table of body measures, as a Pinocchio model.

Joint names and senses are those of human.urdf (`human_36dof_ISB_model`), so that recordings and plans share them; five
joints of the pelvis against the place where the person stands come before them.
"""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from lgp.errors import SceneError
from reba.errors import did_you_mean

TABLE = Path(__file__).parent / "data" / "human.toml"
STATURE = (1.40, 2.10)
"""[m] Statures that the body measures may be scaled to."""


@cache
def table() -> dict[str, Any]:
    """Return the table of joints, segments and sources (read once)."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


def lengths(stature: float, sex: str) -> dict[str, float]:
    """Return the named body measures [m].

    Raises:
        SceneError: the sex is unknown, or the stature no adult's.

    >>> round(lengths(1.741, "male")["upper_arm"], 4)
    0.2817
    """
    by_sex = table()["de_leva"]
    if sex not in by_sex:
        raise SceneError(f"human sex is {sex!r}, expected one of {', '.join(by_sex)}{did_you_mean(sex, by_sex)}")
    if not STATURE[0] <= stature <= STATURE[1]:
        raise SceneError(f"human stature is {stature:g} m, expected {STATURE[0]} to {STATURE[1]} m")
    measured = {name: value for name, value in by_sex[sex].items() if name != "stature"}
    scale = stature / by_sex[sex]["stature"]
    fractions = {name: fraction * stature for name, fraction in table()["fractions"].items()}
    return {name: value * scale for name, value in measured.items()} | fractions
