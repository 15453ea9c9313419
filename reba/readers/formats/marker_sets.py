"""Labelled marker positions of any format -> one stream of points per subject, in metres.

Vicon and others write a label as `Subject:MARKER` and trajectories without a name as `*12`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from reba.arrays import Array
from reba.errors import ReadError
from reba.readers.formats.file_content import unpacked_name
from reba.readers.recording.stream import ReadLog, Recording, Topic, array_stream, unique_names


def marker_recording(
    path: Path,
    format: tuple[str, str],
    labels: Sequence[str],
    time: Array,
    points: Array,
    log: ReadLog,
    *,
    topics: Sequence[Topic] = (),
    up: str = "",
) -> Recording:
    """Return a recording with one stream per subject, in the order of the file.

    A single subject gives a stream named as the file, several give streams named as the subjects. Markers without a
    label are left out and listed; at least one must have a label.

    Args:
        format: name of the reader, and of the format for messages.
        labels: k labels, with or without `Subject:`; "" and `*...` mean unlabelled.
        time: (n,) [s].
        points: (n, k, 3) [m], NaN in gaps.
        log: notes made on opening.
        topics: further topics to list.
    """
    subjects: dict[str, list[int]] = {}
    markers: list[str] = []
    unlabelled = 0
    for index, label in enumerate(labels):
        subject, _, marker = label.strip().rpartition(":")
        markers.append(marker.strip())
        if not markers[-1] or markers[-1].startswith("*"):
            unlabelled += 1
        else:
            subjects.setdefault(subject.strip(), []).append(index)
    if not subjects:
        raise ReadError(
            path, f"none of its {len(labels)} markers has a label", hint="label the markers and export again"
        )
    streams, listed = [], []
    for subject, columns in subjects.items():
        name = subject if subject and len(subjects) > 1 else unpacked_name(path).stem
        names = unique_names([markers[index] for index in columns], log)
        part = points if len(columns) == len(labels) else points[:, columns]
        streams.append(array_stream(name, "points", format[1], names, time, part, opened=log, up=up))
        gaps = float(np.mean(np.isnan(part[..., 0]))) if part.size else 0.0
        why = f"{len(names)} markers" + (f" of {subject}" if subject else "") + f", {100 * gaps:.1f} % gaps"
        listed.append(Topic(name, format[1], len(time), True, why))
    if unlabelled:
        listed.append(Topic("unlabelled", format[1], len(time), False, f"{unlabelled} markers without a label"))
    return Recording(str(path), format[0], tuple(streams), (*listed, *topics), log)
