"""Where the eye is, so that all of a scene is in the picture; the page does the same for the size of its window."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ANGLE = 30.0
"""[deg] Height of what the camera sees."""
ROOM = 1.08
"""How much wider the picture is than what must be in it."""

NEAREST = 0.3
"""[m] From the eye to what it sees, at least."""


class Camera(NamedTuple):
    """An eye (3,) that looks at a target (3,), up along z."""

    eye: Array
    target: Array


def framed(points: Array, towards: Array, aspect: float, angle: float = ANGLE) -> Camera:
    """Return the nearest camera that sees all points.

    Args:
        points: (n, 3) [m].
        towards: (3,) unit vector from the scene to the eye, not straight up.
        aspect: width by height of the picture.
        angle: height of the picture [deg].

    >>> camera = framed(np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]), np.array([1.0, 0.0, 0.0]), 1.0, 90.0)
    >>> camera.eye.round(2).tolist()
    [1.08, 0.0, 0.0]
    """
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    up = np.cross(towards, right)
    across, above, near = points @ right, points @ up, points @ towards
    tall = np.tan(np.radians(angle) / 2.0)
    # Planes through the eye bound the picture: of all points, the outermost of each side decides.
    needed = max(
        float(((offset + slope * near).max() - (offset - slope * near).min()) / (2.0 * slope))
        for offset, slope in ((across, tall * aspect), (above, tall))
    )
    centre = float(near.mean())
    eye = max(centre + ROOM * (needed - centre), float(near.max()) + NEAREST)
    target = _middle(across, eye - near) * right + _middle(above, eye - near) * up + centre * towards
    return Camera(target + (eye - centre) * towards, target)


def _middle(offset: Array, depth: Array) -> float:
    """Return where the eye must be for points at (n,) offsets and depths [m] to be in the middle of the picture."""
    middle = float(offset.max() + offset.min()) / 2.0
    for _ in range(8):
        seen = (offset - middle) / depth
        high, low = int(seen.argmax()), int(seen.argmin())
        # The eye from which the outermost two are seen equally far aside.
        middle = float((offset[high] * depth[low] + offset[low] * depth[high]) / (depth[low] + depth[high]))
    return middle
