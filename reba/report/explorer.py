"""Data of the timeline that is explored: scores, parts and angles of the frames that the cursor can reach.

A recording of an hour has more frames than a page can hold: kept are the frames with the extreme scores of equal parts
of the time axis, and every frame of the worst intervals up to a limit. Numbers are packed as base64.
"""

from __future__ import annotations

import base64
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from reba.method.classes import angle_classes
from reba.method.tables import PART_MAXIMA
from reba.posture.columns import COLUMNS, INDEX
from reba.posture.columns import PARTS as BODY_PARTS
from reba.posture.factors import ACTIVITIES, SUPPORTS, codes, flag
from reba.posture.skeleton import LENGTHS, LIMBS, NEUTRAL, SPOTS
from reba.report.findings import WorstInterval, worse_side
from reba.report.labels import PARTS, angle_name
from reba.report.plots import drawn_gaps, time_range
from reba.report.series import PARTS_OF_MEANS, VIEWS, part_means, steps
from reba.report.summary import RecordingSummary

BUCKETS: Final = 750
"""Parts of the time axis of one recording; at most `OF_BUCKET` frames of each are kept."""
OF_BUCKET: Final = 6
FULL_RATE: Final = 1250
"""Frames of the worst intervals that are kept beside them, shared by the intervals."""
UNMEASURED: Final = -32768
"""Stands for NaN among angles in tenths of a degree."""
TENTHS: Final = 10.0
NO_SCORE: Final = 255
"""Stands for NaN among scores in tenths."""


def skeleton() -> dict[str, Any]:
    """Return what the figure that follows the cursor is drawn from: lengths, limbs and the places of marks."""
    return {
        "columns": list(COLUMNS),
        "lengths": LENGTHS,
        "neutral": NEUTRAL.tolist(),
        "limbs": [[a, b, INDEX[angle]] for a, b, angle in LIMBS.values()],
        "spots": {part: list(joints) for part, joints in SPOTS.items()},
    }


def explorer(record: RecordingSummary, intervals: list[WorstInterval], span: float, number: int = 1) -> dict[str, Any]:
    """Return the data of one recording, which has frames.

    Args:
        span: length of the time axis [s].
        number: recordings in the report, which share its size.
    """
    scores, n = record.scores, record.frames
    frames = cursor_frames(record, intervals, number)
    means = {name: part_means(scores, record.curves[name], PARTS_OF_MEANS) for name in VIEWS}
    time = scores.time[frames]
    ends = time + record.weights[frames]
    # Between two frames that stand in no gap the value of the first one lasts until the second.
    starts = np.array([start for start, _ in record.gaps])
    piece = np.searchsorted(starts, time, side="left")
    last = np.append(np.diff(piece) != 0, True)
    until = np.where(last, ends, np.append(time[1:], 0.0))
    support = codes("support", scores.factors.support, SUPPORTS, n)
    angles = scores.angles[frames]
    measured = [column for column in COLUMNS if not np.isnan(scores.angles[:, INDEX[column]]).all()]
    classes = {column: one for one in angle_classes(scores.rules) for column in one.columns}
    activity = sum(
        np.broadcast_to(flag(kind, getattr(scores.factors, kind), n), (n,))[frames].astype(np.uint8) << bit
        for bit, kind in enumerate(ACTIVITIES)
    )
    return {
        "range": time_range(record, span),
        "time": _packed(time),
        "until": _packed(until),
        "totals": {
            name: _ends(record.curves[name].low[frames], record.curves[name].high[frames]) for name in VIEWS
        },
        "means": {
            "range": means["reba"].edges[[0, -1]].tolist(),
            **{name: _ends(_tenths_of_score(one.low), _tenths_of_score(one.high)) for name, one in means.items()},
        },
        "parts": [
            {
                "name": name,
                "title": title,
                "highest": PART_MAXIMA[name.removesuffix("_left").removesuffix("_right")],
                **_ends(record.ends.low[name][frames], record.ends.high[name][frames]),
            }
            for name, title in PARTS.items()
        ],
        "angles": [
            {
                "column": INDEX[column],
                "name": angle_name(column),
                "part": classes[column].part,
                "edges": sorted({round(edge, 2) for known in classes[column].classes
                                 for edge in (known.low, known.high) if np.isfinite(edge)}),
                "values": _packed(_tenths(angles[:, INDEX[column]])),
            }
            for column in measured
        ],
        "sitting": _packed((np.broadcast_to(support, n)[frames] == SUPPORTS.index("sitting")).astype(np.uint8)),
        "activity": _packed(np.asarray(activity, np.uint8)),
        "gaps": [[round(a, 4), round(b, 4)] for a, b in drawn_gaps(record)],
        "intervals": [[one.number, one.start, one.end, one.time] for one in intervals],
        "first": first_part(record),
    }  # fmt: skip


def first_part(record: RecordingSummary) -> str:
    """Return the part whose angles are shown first: the main cause that has angles, else the trunk."""
    for group in record.summary["verdict"]["parts"]:
        if group in BODY_PARTS:
            worse = "right" if worse_side(record)[0] == "right" else "left"
            return group if group in PARTS else f"{group}_{worse}"
    return "trunk"


def cursor_frames(record: RecordingSummary, intervals: list[WorstInterval], number: int = 1) -> NDArray[np.int64]:
    """Return the rows of the frames that the cursor can reach, in time order."""
    scores = record.scores
    buckets = max(BUCKETS // number, 60)
    if record.frames <= OF_BUCKET * buckets:
        return np.arange(record.frames)
    chosen = [steps(scores, record.curves["reba"], record.gaps, buckets).frame]
    room = FULL_RATE // number // max(len(intervals), 1)
    for one in intervals:
        a, b = np.searchsorted(scores.time, [one.start - 1e-9, one.end - 1e-9])
        middle = scores.frame_at(one.time)
        a, b = max(a, middle - room // 2), min(b, middle + room // 2)
        chosen.append(np.append(np.arange(a, b), middle))
    return np.unique(np.concatenate(chosen)).astype(np.int64)


def _ends(low: NDArray[Any], high: NDArray[Any]) -> dict[str, str | None]:
    """Return both ends of a score, the upper one as None where it is the lower one."""
    first, second = low.astype(np.uint8), high.astype(np.uint8)
    return {"low": _packed(first), "high": None if np.array_equal(first, second) else _packed(second)}


def _tenths(angles: NDArray[Any]) -> NDArray[np.int16]:
    return np.where(np.isnan(angles), UNMEASURED, np.round(angles * TENTHS)).astype(np.int16)


def _tenths_of_score(scores: NDArray[Any]) -> NDArray[np.uint8]:
    return np.where(np.isnan(scores), NO_SCORE, np.round(scores * TENTHS)).astype(np.uint8)


def _packed(values: NDArray[Any]) -> str:
    """Return an array in the byte order of browsers as base64."""
    return base64.b64encode(np.ascontiguousarray(values, values.dtype.newbyteorder("<")).tobytes()).decode()
