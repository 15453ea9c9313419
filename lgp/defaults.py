"""Defaults that commands name in their help, without the packages that planning loads."""

from __future__ import annotations

from typing import Final

COST: Final = "convex"
"""Default surrogate: convex, with its minimum near the rest posture."""
TIME_WEIGHT: Final = 0.2
"""Cost of a second: with fixed phases an action more has to save more than its time (a crate put down and lifted again
on its way saved 0.19 a second)."""
SCENE_COST: Final = "scene"
"""In the place of a surrogate: the one that the scene states."""
