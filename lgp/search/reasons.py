"""Why there is no plan, in one line: the first reasons of many, and the limit that ended a search."""

from __future__ import annotations

from collections.abc import Sequence

REASONS = 4
"""Number of reasons that are given where there is no plan; those of all sequences are in the nodes."""


def in_short(reasons: Sequence[str]) -> str:
    """Return the first reasons and how many more there are.

    Example:
        >>> in_short(["the box is too heavy", *"abcd"])
        'the box is too heavy; a; b; c; and 1 more'
    """
    more = f"; and {len(reasons) - REASONS} more" if len(reasons) > REASONS else ""
    return "; ".join(reasons[:REASONS]) + more


def why_cut_short(seconds: float | None, reasons: Sequence[str]) -> str:
    """Return which limit ended a search without a plan, and why what it had tried until then has none.

    Args:
        seconds: the time limit, None where the number of problems was the limit.
        reasons: of the sequences without a path.

    Example:
        >>> why_cut_short(60.0, ["path: arm.fore is 4 mm in table.bench"])
        'the time limit of 60 s was reached, allow more; until then: path: arm.fore is 4 mm in table.bench'
    """
    limit = "the limit of problems was reached" if seconds is None else f"the time limit of {seconds:g} s was reached"
    until_then = f"; until then: {in_short(reasons)}" if reasons else ""
    return f"{limit}, allow more{until_then}"
