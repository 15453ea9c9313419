"""The posture of one frame as a coloured stick figure in space: lines for limbs, one colour for each part score."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.posture import INDEX
from reba.report.stickfigure import LIMBS, joints
from reba.scoring import UNKNOWN, ScoreArrays
from reba.tables import PART_MAXIMA

Array = NDArray[np.float64]
Colour = tuple[float, float, float, float]

STATURE: Final = 1.75
"""[m] The size of the figure."""
GREY: Final[Colour] = (0.6, 0.6, 0.6, 0.6)
"""Limbs whose part score is not determined."""
SCALE: Final[tuple[Colour, ...]] = ((0.18, 0.63, 0.30, 1.0), (0.98, 0.75, 0.18, 1.0), (0.80, 0.14, 0.14, 1.0))
"""From the lowest part score to the highest."""
PLAIN: Final[tuple[tuple[str, str, str], ...]] = (
    ("shoulder_left", "shoulder_right", "trunk"),
    ("hip_left", "hip_right", "legs"),
)
"""Lines that are no limbs, and the part whose colour they take."""


@dataclass(frozen=True)
class Figure:
    """Points to draw.

    Attributes:
        lines: (m, 2, 3) ends of m lines [m]: x forward, y to the left, z up; the feet stand on z = 0.
        colours: of each line.
        head: (3,) centre of the head [m].
        head_colour: of the head.
    """

    lines: Array
    colours: tuple[Colour, ...]
    head: Array
    head_colour: Colour


def part_of(limb: str) -> str:
    """Return the part score that colours a limb.

    >>> part_of("shank_left"), part_of("wrist_right")
    ('legs', 'wrist_right')
    """
    return "legs" if limb.startswith(("thigh", "shank")) else limb


def colour_of(part: str, score: int) -> Colour:
    """Return the colour of a part score on the way from its lowest to its highest value."""
    if score == UNKNOWN:
        return GREY
    highest = next(most for name, most in PART_MAXIMA.items() if part.startswith(name))
    place = (score - 1) / (highest - 1) * (len(SCALE) - 1)
    below = min(int(place), len(SCALE) - 2)
    share = place - below
    red, green, blue, alpha = ((1 - share) * a + share * b for a, b in zip(SCALE[below], SCALE[below + 1], strict=True))
    return red, green, blue, alpha


def figure(angles: Array, scores: ScoreArrays, frame: int, sitting: bool = False) -> Figure:
    """Return the figure of one frame.

    Args:
        angles: (22,) degrees, NaN = not measured, drawn neutral and grey where it leaves the part score open.
        scores: of n frames.
        frame: which of them.
        sitting: whether the person sits.
    """
    place = joints(angles, sitting)
    floor = min(float(point[1]) for point in place.values())
    at = {name: STATURE * np.array([p[0], -p[2], p[1] - floor]) for name, p in place.items()}
    drawn = [(a, b, part_of(limb)) for limb, (a, b, _) in LIMBS.items()]
    drawn += [(a, a.replace("ankle", "toe"), "legs") for a in at if a.startswith("ankle")]
    drawn += PLAIN
    colour = {part: colour_of(part, int(scores[part][frame])) for _, _, part in drawn}
    neck = GREY if np.isnan(angles[INDEX["neck_flexion"]]) else colour["neck"]
    return Figure(
        lines=np.array([(at[a], at[b]) for a, b, _ in drawn]),
        colours=tuple(colour[part] for _, _, part in drawn),
        head=at["head"],
        head_colour=neck,
    )
