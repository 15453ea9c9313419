"""What the whole of a recording says about its angles: columns not measured, hinges of the other sign.

`correct` decides from the samples there are and returns the decision, so that frames that come later can be treated
alike (`reba.live`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reba.posture import INDEX
from reba.readers.checks import dead_columns, empty_columns, impossible_columns
from reba.readers.collect import Samples
from reba.readers.joints import some
from reba.readers.mapping import Mapper
from reba.readers.profile import Profile
from reba.readers.stream import Kind

Array = NDArray[np.float64]

BENT = 10.0
"""[deg] A hinge that bends the other way by more is not hyperextended, its sign is."""


@dataclass(frozen=True)
class Corrections:
    """What was done to the angles of a recording.

    Attributes:
        turned: positions of columns whose sign was turned round.
        hidden: positions of columns that were not measured and were blanked.
        reasons: column -> why it has no value.
    """

    turned: tuple[int, ...]
    hidden: tuple[int, ...]
    reasons: dict[str, str]

    def apply(self, angles: Array) -> None:
        """Do the same to further (n, 22) angles [deg], in place."""
        angles[:, self.turned] = -angles[:, self.turned]
        angles[:, self.hidden] = np.nan


def correct(samples: Samples, mapper: Mapper, profile: Profile, kind: Kind, neutral: str) -> Corrections:
    """Blank the columns that were not measured and turn wrong signs, in place; return what was done.

    Args:
        samples: of the whole recording, as mapped.
        mapper: what mapped them, after all of them.
        profile: what their names mean.
        kind: of the stream.
        neutral: neutral posture that is going to be subtracted.
    """
    angles = samples.angles
    reasons = {
        **dead_columns(angles, samples.seconds, kind, profile.dummies),
        **mapper.dead(samples.seconds),
    }
    if neutral == "none":
        for column in profile.needs_neutral:
            reasons[column] = "it has no zero of its own: give a neutral posture (neutral='first:3s')"
    turned = _upright_sign(angles, profile.sign_from_range, mapper)
    if kind != "joints":
        reasons |= impossible_columns(angles)
    elif wrong := [column for column in impossible_columns(angles) if column not in reasons]:
        mapper.warnings.append(f"most frames are impossible in {some(wrong)}: another convention than {profile.name}?")
    reasons |= profile.cannot
    hidden = tuple(INDEX[column] for column in reasons)
    angles[:, hidden] = np.nan
    for column in empty_columns(angles):
        reasons.setdefault(column, "no value in any frame")
    return Corrections(turned, hidden, reasons)


def _upright_sign(angles: Array, columns: tuple[str, ...], mapper: Mapper) -> tuple[int, ...]:
    """Turn the sign of hinges round if the largest bend of all of them is negative: a limb bends one way only."""
    at = tuple(INDEX[column] for column in columns)
    values = angles[:, at]
    lowest, highest = (float(pick(values, initial=0.0)) for pick in (np.nanmin, np.nanmax))
    if not at or lowest >= -BENT or -lowest <= highest:
        return ()
    angles[:, at] = -values
    span = f"{lowest:.0f} .. {highest:.0f}"
    mapper.assumed.append(f"{', '.join(columns)}: flexion is negative in this source ({span} deg); sign turned round")
    return at
