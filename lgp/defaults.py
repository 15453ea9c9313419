"""Defaults that commands name in their help, without the packages that planning loads."""

from __future__ import annotations

from typing import Final

COST: Final = "convex"
"""Default surrogate: convex, with its minimum near the rest posture."""
SCENE_COST: Final = "scene"
"""In the place of a surrogate: the one that the scene states."""
