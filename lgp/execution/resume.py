"""Going on after a crash: the state that is kept in the log, and the log that goes on in one file.

The broken log is set aside, its messages up to the break are copied into a new one, and the run goes on there: one
file holds the whole run. What is aside is deleted at the end; after one more crash the log that came further counts.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lgp.errors import LgpError
from lgp.execution.log_reader import Past, read_past
from lgp.execution.simulation import Attachment

Array = NDArray[np.float64]

ASIDE = ".interrupted"
"""Added to the name of a log while its messages are copied."""


def checkpoint(
    epoch: float, time: float, q: Array, closed: Iterable[str], things: Mapping[str, Attachment]
) -> dict[str, Any]:
    """Return what a restart needs of the world as plain data.

    Args:
        epoch: wall-clock time at which the run began [s].
        time: since then [s].
        q: (nq,) configuration of everybody.
        closed: hands whose grippers are closed.
        things: where objects truly are, for a simulated world.
    """
    return {
        "epoch": epoch,
        "time": time,
        "q": q.tolist(),
        "closed": sorted(closed),
        "things": {
            name: {"hand": at.hand, "rotation": at.rotation.tolist(), "position": at.position.tolist()}
            for name, at in things.items()
        },
    }


def attachments(state: Mapping[str, Any]) -> dict[str, Attachment]:
    """Return where objects are by a checkpoint."""
    return {
        name: Attachment(at["hand"], np.array(at["rotation"]), np.array(at["position"]))
        for name, at in state["things"].items()
    }


def continue_log(file: Path) -> Past:
    """Set the log of an interrupted run aside and return what it says.

    Raises:
        LgpError: there is no log, or its run is over.
        ReadError: it is no MCAP log.
    """
    aside = file.with_name(file.name + ASIDE)
    pasts = [past for past in map(_past, (file, aside)) if past is not None]
    if not pasts:
        raise LgpError(f"{file}: there is no log to go on from; run without --resume")
    past = max(pasts, key=lambda one: one.last)
    if past.over:
        raise LgpError(f"{file}: the run is over; run without --resume to begin again")
    os.replace(past.file, aside)
    return replace(past, file=aside)


def _past(file: Path) -> Past | None:
    """Return what a log says, None if there is none or it breaks off before it says where the run stood."""
    if not file.is_file() or not file.stat().st_size:
        return None
    return read_past(file)
