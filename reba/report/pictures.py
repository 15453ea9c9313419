"""Pictures of a camera that stand in a report: what the page gets of them, and what it says about them."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

Look = Literal["pixelated", "clear"]
LOOKS: Final[tuple[Look, ...]] = ("pixelated", "clear")
"""How pictures are shown."""


@dataclass(frozen=True)
class Picture:
    """One picture.

    Attributes:
        time: of the frame that it was looked for [s].
        after: how much later it was recorded [s], negative for earlier.
        data: JPEG.
    """

    time: float
    after: float
    data: bytes

    @property
    def url(self) -> str:
        """The picture as an address that needs no network."""
        return f"data:image/jpeg;base64,{base64.b64encode(self.data).decode()}"


@dataclass(frozen=True)
class Pictures:
    """Pictures of one recording, by time; `note` says why there are none, or which of several cameras they are from.

    Attributes:
        blocks: squares of one color on the longer side of a pixelated picture, 0 for clear ones.
        topics: names of the cameras of the recording, which a page without names does not show.
    """

    pictures: tuple[Picture, ...] = ()
    blocks: int = 0
    note: str = ""
    topics: tuple[str, ...] = ()

    def nearest(self, time: float) -> Picture | None:
        """Return the picture that is nearest to a time [s]."""
        return min(self.pictures, key=lambda one: abs(one.time + one.after - time), default=None)

    def caption(self, picture: Picture, time: float) -> str:
        """Return what stands below a picture that is shown at a time [s].

        >>> Pictures(blocks=40).caption(Picture(2.0, 0.03, b""), 2.0)
        'Camera 0.03 s later, pixelated.'
        """
        after = picture.time + picture.after - time
        when = "at this moment" if abs(after) < 0.005 else f"{abs(after):.2f} s {'later' if after > 0 else 'earlier'}"
        return f"Camera {when}{', pixelated' if self.blocks else ''}."

    def packed(self) -> dict[str, Any] | None:
        """Return what the page's script shows at the cursor, None without pictures."""
        if not self.pictures:
            return None
        return {
            "times": [round(one.time + one.after, 3) for one in self.pictures],
            "pictures": [one.url for one in self.pictures],
            "pixelated": bool(self.blocks),
        }


NONE: Final = Pictures()
"""Of a report without pictures."""


def statement(some: Sequence[Pictures]) -> str:
    """Return what a page says about its pictures."""
    shown = [one for one in some if one.pictures]
    if not shown:
        return "It contains no pictures."
    blocks = [one.blocks for one in shown]
    count = sum(len(one.pictures) for one in shown)
    many = "one picture of a camera" if count == 1 else f"{count} pictures of a camera"
    if not all(blocks):
        return f"It contains {many}, which are not pixelated: people in them can be recognised."
    return (
        f"It contains {many}, pixelated as a whole to {max(blocks)} squares on the longer side, finer ones are not in "
        "the file. Faces were not looked for: someone who is close to the camera, or known by clothes or place, may "
        "still be recognised."
    )
