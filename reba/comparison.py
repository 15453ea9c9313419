"""Two recordings side by side: before and after, or one worker and another."""

from __future__ import annotations

from typing import Any

from reba.exposure import PARTS
from reba.scores import Scores


def compare(a: Scores, b: Scores) -> dict[str, Any]:
    """Return the summaries of two recordings and b minus a for every figure both have.

    Part means are compared over frames in which they are known; a figure that one side lacks has no difference.
    """
    first, second = a.summary(), b.summary()
    difference = {
        "reba": {key: _minus(first["reba"][key], second["reba"][key]) for key in first["reba"]},
        "range": {key: _minus(first["range"][key], second["range"][key]) for key in first["range"]},
        "held": _minus(first["held"]["reba"], second["held"]["reba"]),
        "action_levels": {
            level: _minus(first["action_levels"][level], second["action_levels"][level])
            for level in first["action_levels"]
        },
        "parts": {part: _minus(first["parts"][part]["mean"], second["parts"][part]["mean"]) for part in PARTS},
    }
    only = {
        "only_a_unmeasured": sorted(set(a.unmeasured) - set(b.unmeasured)),
        "only_b_unmeasured": sorted(set(b.unmeasured) - set(a.unmeasured)),
    }
    return {"a": first, "b": second, "difference": difference, **only}


def _minus(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else b - a
