"""Units of length: names whole or cut short, as programs write them, and the size of a body where none is named."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from reba.arrays import Array
from reba.errors import ReadError
from reba.readers.recording.stream import ReadLog, clip

METRES: Final[Mapping[str, float]] = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), 0.01),
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), 0.001),
    **dict.fromkeys(("in", "inch", "inches"), 0.0254),
    **dict.fromkeys(("ft", "foot", "feet"), 0.3048),
}
"""Length of one unit [m] by its name in lower case."""
LEAST: Final = 3
"""Letters that suffice of a longer name: C3D files have units of four characters, "mete" and "mill"."""
BODY: Final = (0.3, 3.0)
"""[m] Extent of a body in a recording, from a crouching child to a tall person who reaches up; decides the unit."""


def length_of(unit: str) -> float | None:
    """Return the length of one unit [m], None for an unknown one.

    >>> [length_of(text) for text in ("METERS", " mm ", "mete", "(cm)", "furlong")]
    [1.0, 0.001, 1.0, 0.01, None]
    """
    word = unit.strip(" \t\0()[].\"'").lower()
    if word in METRES or len(word) < LEAST:
        return METRES.get(word)
    return next((length for name, length in METRES.items() if name.startswith(word)), None)


def metres(path: Path, unit: str, where: str) -> float:
    """Return the length [m] of one unit; `where` names its place in the file for an unknown unit."""
    scale = length_of(unit)
    if scale is None:
        raise ReadError(path, f"{where}: unit {clip(unit)} is unknown", hint="write mm, cm or m there")
    return scale


def metres_by_size(points: Array, log: ReadLog, usual: str) -> float:
    """Return the unit of length [m] in which points (n, k, 3) have the size of a body, else the `usual` one; noted."""
    gaps = (points == 0).all(axis=-1, keepdims=True) | ~np.isfinite(points).all(axis=-1, keepdims=True)
    finite = np.where(gaps, np.nan, points)
    present = (~gaps).sum(axis=(1, 2))
    if not present.any():
        return METRES[usual]
    known = 2 * present > present.max()  # part of a body is smaller
    with np.errstate(invalid="ignore"):
        extents = np.nanmax(finite[known], axis=1) - np.nanmin(finite[known], axis=1)
    extent = float(np.median(np.nanmax(extents, axis=1)))
    plane = finite[known][..., :2]
    if usual == "m" and extent < 1 and np.nanmin(plane) >= 0 and np.nanmax(plane) <= 1:
        log.warn(
            "x and y lie between 0 and 1 and no unit is stated: if they are shares of an image, as landmarks of "
            "MediaPipe, angles are wrong; give world landmarks, in metres"
        )
    for unit in ("m", "cm", "mm"):
        if BODY[0] <= extent * METRES[unit] <= BODY[1]:
            log.warn(f"the unit of the points is not stated; read as {unit}, in which the body is {extent:.4g} tall")
            return METRES[unit]
    log.warn(
        f"the unit of the points is not stated, and no unit gives the size of a body; {usual} was assumed, "
        "but angles do not depend on it"
    )
    return METRES[usual]
