"""Scores while a recording is being made: the same numbers as `reba score`, one frame at a time.

    source (growing MCAP file, lines) -> segments -> settle -> stage (bodies or rows) -> Frames -> session -> lines

What the readers decide from a whole recording (unit, vertical, columns that were not measured, neutral posture) is
decided from its first seconds here, by the same functions; frames of that time wait and are handed out after it.
Everything kept is bounded: it does not grow with the length of the recording.
"""

from __future__ import annotations
