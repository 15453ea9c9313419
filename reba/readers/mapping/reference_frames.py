"""Which way is up, and do the names of left and right fit: asked of the body, not of the convention.

Camera systems write y down, exporters turn axes, labels get exchanged. The head of a person is above the feet over
most of a recording, and toes point forward; both are summed over all frames and compared with what was assumed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reba.angles import unit

Array = NDArray[np.float64]

AGAINST = -0.5
"""Cosine between the vertical a file states and the body's own, below which the file is not believed."""

ASLANT = 0.5
"""The same for a vertical that is only usual with a source."""


def axis_vector(name: str) -> Array:
    """Return the unit vector of "x", "-y" ...

    >>> axis_vector("-y").tolist()
    [0.0, -1.0, 0.0]
    """
    vector = np.zeros(3)
    vector["xyz".index(name[-1])] = -1.0 if name[0] == "-" else 1.0
    return vector


def axis_name(vector: Array) -> str:
    """Return the name of the signed axis nearest to a vector."""
    index = int(np.argmax(np.abs(vector)))
    return ("-" if vector[index] < 0 else "") + "xyz"[index]


class Orientation:
    """The vertical of a recording, chosen from its first frames and checked against all of them.

    Args:
        stated: vertical axis that the file states, "" if it does not.
        usual: vertical axis that is usual with the source, "" if there is none.
    """

    def __init__(self, stated: str, usual: str) -> None:
        self.stated, self.usual = stated, usual
        self.name = stated or usual
        self.swapped = False
        self.assumed: list[str] = []
        self.warnings: list[str] = []
        self.begin()

    @property
    def up(self) -> Array | None:
        """The vertical, or None where neither the file nor the body shows it."""
        return axis_vector(self.name) if self.name else None

    def begin(self) -> None:
        """Start a pass over the recording."""
        self._upward = np.zeros(3)
        self._facing = self._lines = 0.0
        self._frames = 0

    def watch(self, upward: Array | None, right: Array | None, forward: Array | None, shoulders: Array | None) -> None:
        """Take up (n, 3) directions of a block: feet to head, left to right hip, heel to toe, left to right shoulder.

        Any of them may be None or hold NaN.
        """
        if upward is not None:
            self._upward += np.nansum(unit(upward), axis=0)
        if right is None:
            return
        self._frames += len(right)
        if not self.name and np.any(self._upward):
            self.name = axis_name(self._upward)
        if forward is not None and self.up is not None:
            ahead = unit(np.cross(self.up, right))
            self._facing += float(np.nansum(np.sum(ahead * unit(forward), axis=1)))
        if shoulders is not None:
            self._lines += float(np.nansum(np.sum(unit(right) * unit(shoulders), axis=1)))

    def settled(self) -> bool:
        """Return whether what was chosen fits all frames; otherwise choose anew, and the recording is read again."""
        before = (self.name, self.swapped)
        length = float(np.linalg.norm(self._upward))
        if length > 0:
            body = self._upward / length
            cosine = float(body @ axis_vector(self.name)) if self.name else -1.0
            if cosine < (AGAINST if self.stated else ASLANT) and self.name != axis_name(body):
                old, self.name = self.name, axis_name(body)
                if old:
                    self._warn(f"the vertical is {self.name} by the body (head above feet), not {old}")
        if not self.stated and self.name and self.name != self.usual and np.any(self._upward):
            self._assume(f"vertical {self.name} found from the body (head above feet)")
        if self._frames and self._facing / self._frames < -0.3:
            self.swapped = not self.swapped
            self._warn("left and right look exchanged (toes or face point backwards for the hip line); sides exchanged")
        if self._frames and self._lines / self._frames < -0.3:
            self._warn("left and right of hips and shoulders contradict each other: check the names")
        return before == (self.name, self.swapped)

    def _warn(self, text: str) -> None:
        if text not in self.warnings:
            self.warnings.append(text)

    def _assume(self, text: str) -> None:
        if text not in self.assumed:
            self.assumed.append(text)
