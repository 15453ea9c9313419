"""Draw every angle of the posture table: zero in grey, a positive value in blue; one SVG for each into `docs/angles/`.

    python docs/draw_angles.py [--folder docs/angles]

Bodies are drawn by the stick figure of the reports, so what is drawn here is what the package means by an angle.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reba.posture.columns import INDEX
from reba.posture.skeleton import LENGTHS, joints

Array = NDArray[np.float64]
Point = tuple[float, float]

FOLDER = Path(__file__).resolve().parent / "angles"
SIZE = 240.0
GREY, BLUE, INK = "#9aa1a9", "#1f6fa8", "#2b2f36"

VIEWS = {"from the right": (0, 1, 1.0), "from the front": (2, 1, -1.0), "from above": (2, 0, 1.0)}
"""View -> axis that points right, axis that points up, and the sign of the first: x forward, y up, z right."""

CHAINS = (
    ("hip", "neck", "head"),
    *(
        tuple(f"{name}_{side}" for name in names)
        for side in ("left", "right")
        for names in (("hip", "knee", "ankle", "toe"), ("shoulder", "elbow", "wrist", "hand"))
    ),
    ("shoulder_left", "shoulder_right"),
    ("hip_left", "hip_right"),
    ("head", "nose"),
)
FROM_ABOVE = (("shoulder_left", "shoulder_right"), ("hip_left", "hip_right"), ("head", "nose"))
"""What is worth drawing from above."""


@dataclass(frozen=True)
class Drawing:
    """How an angle is shown: the view, the value drawn [deg], what is positive, and what zero is."""

    view: str
    value: float
    positive: str
    zero: str


DRAWINGS = {
    "trunk_flexion": Drawing("from the right", 40, "forward", "upright"),
    "trunk_side_bend": Drawing("from the front", 30, "to the right", "upright"),
    "trunk_twist": Drawing("from above", 35, "to the left", "shoulders above the hips"),
    "neck_flexion": Drawing("from the right", 35, "forward", "head as the trunk"),
    "neck_side_bend": Drawing("from the front", 30, "to the right", "head as the trunk"),
    "neck_twist": Drawing("from above", 40, "to the left", "nose ahead"),
    "knee_flexion": Drawing("from the right", 60, "bent", "straight"),
    "upper_arm_flexion": Drawing("from the right", 60, "forward of the trunk", "hanging"),
    "upper_arm_abduction": Drawing("from the front", 50, "away from the body", "hanging"),
    "shoulder_elevation": Drawing("from the front", 25, "raised", "at rest"),
    "lower_arm_flexion": Drawing("from the right", 90, "bent", "straight"),
    "wrist_flexion": Drawing("thumb towards you", 45, "to the palm", "hand in line with the forearm"),
    "wrist_deviation": Drawing("back of a right hand", 25, "to the little finger", "hand in line with the forearm"),
    "wrist_twist": Drawing("a right hand, seen by its owner", 60, "palm down (pronation)", "thumb up"),
}


def main() -> None:
    """Write all drawings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=FOLDER)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for name in DRAWINGS:
        (given.folder / f"{name}.svg").write_text(draw(name), encoding="utf-8", newline="\n")


def draw(name: str) -> str:
    """Return the SVG of one angle."""
    drawing = DRAWINGS[name]
    label = f"{name} +{drawing.value:g}"
    strokes = "".join(_hand(name, drawing) if name.startswith("wrist") else _body(name, drawing))
    titles = _text(8, 18, label, BLUE) + _text(8, 34, f"positive: {drawing.positive}", INK)
    titles += _text(8, SIZE + 30, f"0: {drawing.zero}", GREY) + _text(8, SIZE + 46, drawing.view, INK)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {SIZE:g} {SIZE + 54:g}" width="{SIZE:g}" role="img" '
        f'aria-label="{label}: positive {drawing.positive}; 0 {drawing.zero}">'
        f'<rect width="100%" height="100%" fill="#ffffff"/>{titles}{strokes}</svg>\n'
    )


def _body(name: str, drawing: Drawing) -> Iterable[str]:
    right, up, sign = VIEWS[drawing.view]
    chains = FROM_ABOVE if drawing.view == "from above" else CHAINS
    scale, middle = (640.0, 0.0) if drawing.view == "from above" else (185.0, 0.02)
    for colour, value in ((GREY, 0.0), (BLUE, drawing.value)):
        angles = np.zeros(len(INDEX))
        for column, at in INDEX.items():
            if column in (name, f"{name}_right"):
                angles[at] = value
        places = joints(angles)
        flat = {
            joint: (SIZE / 2 + scale * sign * place[right], SIZE / 2 + 22 - scale * (place[up] - middle))
            for joint, place in places.items()
        }
        for chain in chains:
            if value and not _moved(chain, joints(np.zeros(len(INDEX))), places):
                continue
            yield _line([flat[joint] for joint in chain], colour)
        yield _circle(flat["head"], min(scale * LENGTHS["head"] / 2, 26.0), colour)


def _moved(chain: tuple[str, ...], before: dict[str, Array], after: dict[str, Array]) -> bool:
    return any(np.linalg.norm(before[joint] - after[joint]) > 1e-6 for joint in chain)


def _hand(name: str, drawing: Drawing) -> Iterable[str]:
    """Draw forearm and hand; the twist is seen along the forearm."""
    centre = (SIZE / 2, SIZE / 2 + 30)
    if name == "wrist_twist":
        for colour, value in ((GREY, 0.0), (BLUE, drawing.value)):
            turn = np.radians(value)
            across = np.array([-np.sin(turn), -np.cos(turn)])
            palm = [tuple(np.array(centre) + reach * across) for reach in (-48.0, 48.0)]
            yield _line([(float(x), float(y)) for x, y in palm], colour, width=16.0)
            thumb = np.array(centre) + 48.0 * across
            tip = thumb + 30.0 * across + 10.0 * np.array([-across[1], across[0]])
            yield _line([(float(thumb[0]), float(thumb[1])), (float(tip[0]), float(tip[1]))], colour, width=9.0)
        return
    for colour, value in ((GREY, 0.0), (BLUE, drawing.value)):
        turn = np.radians(value)
        tip = (centre[0] + 80.0 * np.sin(turn), centre[1] - 80.0 * np.cos(turn))
        if not value:
            yield _line([(centre[0], centre[1] + 85.0), centre], colour, width=14.0)
        yield _line([centre, tip], colour, width=12.0)
        side = -1.0 if name == "wrist_deviation" else 0.0
        if side:
            root = (centre[0] + 26.0 * np.sin(turn), centre[1] - 26.0 * np.cos(turn))
            yield _line([root, (root[0] + 34.0 * np.sin(turn - 0.8), root[1] - 34.0 * np.cos(turn - 0.8))], colour, 8.0)


def _line(points: list[Point], colour: str, width: float = 5.0) -> str:
    places = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return (
        f'<polyline points="{places}" fill="none" stroke="{colour}" stroke-width="{width:g}" '
        'stroke-linecap="round" stroke-linejoin="round"/>'
    )


def _circle(at: Point, radius: float, colour: str) -> str:
    shape = f'cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="{radius:.1f}"'
    return f'<circle {shape} fill="#ffffff" stroke="{colour}" stroke-width="4"/>'


def _text(x: float, y: float, words: str, colour: str) -> str:
    return f'<text x="{x:g}" y="{y:g}" font-family="sans-serif" font-size="13" fill="{colour}">{words}</text>'


if __name__ == "__main__":
    main()
