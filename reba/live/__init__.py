"""Live scoring: the scores of `reba score`, frame by frame while a recording is written.

    source (growing MCAP file, JSON lines) -> segments -> converter (joints or table rows) -> Frames -> LiveScorer
    -> JSON lines

What the readers decide from a complete recording (unit, vertical, unmeasured columns, neutral posture) is decided here
from its first seconds, by the same functions; frames of that time are yielded after the decision. Memory is bounded: it
does not grow with the length of the recording.
"""

from __future__ import annotations
