"""Numbers and lists as the report writes them."""

from __future__ import annotations

from collections.abc import Sequence

from reba.posture import ANGLES, SIDES
from reba.report.words import BODY
from reba.tables import ACTION_LEVELS, LEVEL_OF


def seconds(value: float) -> str:
    """Return a duration: "12.3 s", "2 min 56 s", "1 h 00 min".

    >>> seconds(176.2)
    '2 min 56 s'
    """
    if value < 120:
        return f"{value:.1f} s"
    if value < 7200:
        return f"{int(value) // 60} min {int(value) % 60:02d} s"
    return f"{int(value) // 3600} h {int(value) // 60 % 60:02d} min"


def percent(share: float) -> str:
    """Return a share: "0 %", "<0.1 %", "3.4 %", "38 %", with a space that does not break.

    >>> percent(0.034)
    '3.4\xa0%'
    """
    if 0 < share < 0.001:
        return "<0.1\xa0%"
    return f"{100 * share:.0f}\xa0%" if share == 0 or share >= 0.0995 else f"{100 * share:.1f}\xa0%"


def span(low: float | None, high: float | None, digits: int = 0) -> str:
    """Return "4 to 8", or one number where both ends are equal; "not known" for None.

    >>> span(4, 8), span(5.04, 5.02, 1)
    ('4 to 8', '5.0')
    """
    if low is None or high is None:
        return "not known"
    first, second = f"{low:.{digits}f}", f"{high:.{digits}f}"
    return first if first == second else f"{first} to {second}"


def risk(low: int | None, high: int | None) -> str:
    """Return the risk of a score or a range of scores: "high", "medium to very high"."""
    if low is None or high is None:
        return "not known"
    first, second = ACTION_LEVELS[LEVEL_OF[low]][0], ACTION_LEVELS[LEVEL_OF[high]][0]
    return first if first == second else f"{first} to {second}"


def action(level: int) -> str:
    """Return what an action level asks for: "no action necessary", "action necessary soon"."""
    asked = ACTION_LEVELS[level][1]
    return f"no action {asked.removeprefix('none ')}" if asked.startswith("none ") else f"action {asked}"


def listed(items: Sequence[str]) -> str:
    """Return "a", "a and b" or "a, b and c"."""
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}" if items else ""


def angle_name(column: str) -> str:
    """Return a column for people.

    >>> angle_name("wrist_flexion_left")
    'left wrist flexion'
    """
    for side in SIDES:
        if column.endswith(f"_{side}"):
            return f"{side} {column.removesuffix(f'_{side}')}".replace("_", " ").replace("lower arm", "elbow")
    return column.replace("_", " ")


def body_parts(columns: Sequence[str]) -> list[str]:
    """Return columns for people, a whole part or both sides as one: "the wrists", "neck twist".

    >>> body_parts(["neck_twist", "knee_flexion_left", "knee_flexion_right"])
    ['neck twist', 'the knees']
    """
    of_angle = {angle.name: angle.columns for angle in ANGLES}
    found = []
    for _, words, angles in BODY:
        every = [column for name in angles for column in of_angle[name]]
        if all(column in columns for column in every):
            found.append(words)
            continue
        for name in angles:
            if all(column in columns for column in of_angle[name]):
                found.append(name.replace("_", " "))
            else:
                found += [angle_name(column) for column in of_angle[name] if column in columns]
    return found
