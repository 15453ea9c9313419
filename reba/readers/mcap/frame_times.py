"""The log times of the frames of a posture table that was made of a recording of messages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.posture.table import PostureTable
from reba.readers.mcap import gathered
from reba.readers.mcap.channels import DecodableChannel, Unused
from reba.readers.mcap.store import StoredFile
from reba.readers.recording.stream import ReadLog, stream_called

Times = tuple[NDArray[np.int64], NDArray[np.int64]]
"""(n,) log and (n,) publish times [ns]."""


def own_times(time: Array, epoch: float) -> Times:
    """Return the log and publish times of (n,) times of a table [s] after its epoch [s]: both are these times."""
    nanoseconds = round(epoch * 1e9) + np.rint(time * 1e9).astype(np.int64)
    return nanoseconds, nanoseconds


def frame_times(
    files: Sequence[tuple[StoredFile, list[DecodableChannel | Unused]]], postures: PostureTable, time: Array
) -> Times:
    """Return the log and publish times of the messages that frames come from; of other tables their own times.

    Args:
        files: of the recording, as `open_files` returns them.
        time: (n,) times of the frames [s], increasing.
    """
    channels = [channel for _, some in files for channel in some]
    stream = stream_called(gathered(Path(postures.source), channels, ReadLog()).streams, postures.topic)
    if stream is not None and stream.logged is not None:
        # Rows keep their own time, and of scored ones the epoch is that of what was scored.
        later = 0.0 if postures.scored is not None else postures.epoch - stream.epoch
        return stream.logged(time + later, frozenset(postures.signals))
    return own_times(time, postures.epoch)
