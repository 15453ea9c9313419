"""What is measured of every recording: names, the paper's words for them, and how they are shown."""

from __future__ import annotations

from typing import Final

TOTAL: Final = "reba"
"""The measure that a study is decided by: time-weighted mean REBA."""

PARTS: Final[dict[str, str]] = {
    "load_force": "Weight (load and force)",
    "upper_arm": "Shoulder (upper arm)",
    "lower_arm": "Elbow (lower arm)",
    "wrist": "Wrist",
    "trunk": "Trunk",
    "neck": "Neck",
    "legs": "Legs",
    "coupling": "Coupling",
    "activity": "Activity",
}
"""Part scores whose means are compared, those that the paper's Fig. 11 speaks of first; the words in front are its."""

SIDED: Final = ("upper_arm", "lower_arm", "wrist", "coupling")
"""Parts with a score per side; compared is the side that gives the total in each frame."""

LEVELS: Final = tuple(f"level_{level}" for level in range(5))
"""Shares of time in each action level."""
DEMANDING: Final = "demanding"
"""Share of time at REBA 4 or more: action level 2, medium, and above."""
EXTRA: Final[dict[str, str]] = {
    DEMANDING: "Share of time at REBA 4 or more",
    "seconds": "Duration of the recordings [s]",
}
"""Measures that are described beside the parts and not tested."""
