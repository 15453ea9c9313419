"""One stream and one profile -> posture angles, block by block."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from reba.angles import Body, posture_angles
from reba.posture import INDEX
from reba.readers.frames import FrameMapper
from reba.readers.joints import JointMapper
from reba.readers.points import PointMapper
from reba.readers.profile import Profile
from reba.readers.root import RootPose
from reba.readers.stream import Block, Stream

Array = NDArray[np.float64]
Names = Mapping[str, tuple[str, ...]]
"""Joint, segment or point of a profile -> its signals in a stream."""


class Mapper(Protocol):
    """Turns blocks of one kind of stream into bodies; `joints.py`, `frames.py`, `points.py`.

    Attributes:
        wanted: the signals it needs.
        assumed: what had to be assumed.
        warnings: what a user must know.
    """

    wanted: tuple[str, ...]
    assumed: list[str]
    warnings: list[str]

    def begin(self) -> None:
        """Start a pass over the recording."""

    def body(self, block: Block) -> Body:
        """Return the body of a block of n samples."""

    def settled(self) -> bool:
        """Return whether its choices fit the whole recording; if not, it chose anew and needs another pass."""

    def dead(self, seconds: float) -> dict[str, str]:
        """Return columns that nothing in the recording gives, and why."""


def mapper_for(profile: Profile, names: Names, stream: Stream, root: RootPose | None = None) -> Mapper:
    """Return the mapper of a profile's kind for a stream in which `names` were found."""
    if profile.kind == "points":
        return PointMapper(profile, names, stream)
    single = {slot: signals[0] for slot, signals in names.items()}
    if profile.kind == "frames":
        return FrameMapper(profile, single, stream)
    return JointMapper(profile, single, stream, root)


def block_angles(mapper: Mapper, block: Block) -> Array:
    """Return the (n, 22) angles [deg] of a block, to 1e-9 deg.

    The rounding undoes the noise of the conversions, so that a joint recorded at 20 deg in radians lies on the edge of
    its class and not beside it.
    """
    with np.errstate(invalid="ignore"):
        return np.round(posture_angles(mapper.body(block), len(block.time)), 9) + 0.0


def obtainable(profile: Profile, names: Names) -> tuple[str, ...]:
    """Return the columns that a profile gives from the signals found, by trying it on a made-up sample."""
    if not names:
        return ()
    signals = tuple(dict.fromkeys(signal for group in names.values() for signal in group))
    random = np.random.default_rng(0)
    shape = {"joints": (), "points": (3,), "frames": (7,)}[profile.kind]
    values = random.uniform(0.1, 0.3, (2, len(signals), *shape))
    stream = Stream("", profile.kind, "", signals, lambda log, wanted: iter(()), up="z")
    mapper = mapper_for(profile, names, stream)
    mapper.begin()
    angles = block_angles(mapper, Block(np.zeros(2), signals, values, ("",) * len(signals)))
    hidden = {*profile.cannot, *mapper.dead(0.0)}
    return tuple(
        column for column, index in INDEX.items() if np.isfinite(angles[:, index]).any() and column not in hidden
    )
