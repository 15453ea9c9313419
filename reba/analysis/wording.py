"""Durations, shares and ranges of figures as text, alike in the terminal and on pages."""

from __future__ import annotations

from typing import Final

TIE: Final = 1e-4
"""[s] Added before rounding: sums of the same durations differ in their last digits, and ties go up. The page of a
report adds the same (`reba/report/page.js`)."""


def seconds(value: float) -> str:
    """Return a duration: "12.3 s", "2 min 56 s", "1 h 00 min".

    >>> seconds(176.2)
    '2 min 56 s'
    """
    value += TIE
    if value < 60:
        return f"{value:.1f} s"
    if value < 7200:
        return f"{int(value) // 60} min {int(value) % 60:02d} s"
    return f"{int(value) // 3600} h {int(value) // 60 % 60:02d} min"


def moment(time: float, digits: int | None = None) -> str:
    """Return a time of a recording: "28.8 s", from two minutes on "37 min 52 s", "2 h 12 min 03 s".

    `digits` of a second are written if given, else one below two minutes and none above.

    >>> moment(103.4), moment(7923.9), moment(7923.9, 1)
    ('103.4 s', '2 h 12 min 03 s', '2 h 12 min 03.9 s')
    """
    if digits is not None:
        time = round(time, digits)
    if time < 120:
        return f"{time:.{1 if digits is None else digits}f} s"
    hours, rest = divmod(int(time), 3600)
    last = rest % 60 + (round(time % 1, digits) if digits else 0)
    width = 3 + digits if digits else 2
    return (f"{hours} h {rest // 60:02d}" if hours else f"{rest // 60}") + f" min {last:0{width}.{digits or 0}f} s"


def interval(start: float, end: float) -> str:
    """Return an interval of a recording with as many digits of a second as its length asks for.

    >>> interval(28.12, 29.6), interval(1.58, 1.6)
    ('28.1 to 29.6 s, 1.5 s long', '1.58 to 1.60 s, 0.02 s long')
    >>> interval(2063.1, 2064.6)
    '34 min 23.1 s to 34 min 24.6 s, 1.5 s long'
    """
    length = end - start
    digits = 1 if length >= 0.1 else 2 if length >= 0.01 else 3
    long = seconds(length) if digits == 1 else f"{length:.{digits}f} s"
    first = moment(start, digits)
    both_seconds = first.removesuffix(" s") if end < 120 else first
    return f"{both_seconds} to {moment(end, digits)}, {long} long"


def percent(share: float, digits: int | None = None) -> str:
    """Return a share: "0 %", "<0.1 %", "3.4 %", "38 %", or with a number of digits.

    >>> percent(0.034), percent(0.38), percent(0.38, 1)
    ('3.4 %', '38 %', '38.0 %')
    """
    if 0 < share < 0.001:
        return "<0.1 %"
    return f"{100 * share + TIE / 100:.{share_digits(share) if digits is None or share == 0 else digits}f} %"


def share_digits(*shares: float) -> int:
    """Return the digits of shares that stand beside each other [%]: one if any is below a tenth.

    >>> share_digits(0.3, 0.0), share_digits(0.3, 0.098)
    (0, 1)
    """
    return int(any(0 < share < 0.0995 for share in shares))


def percentage_points(low: float, high: float, digits: int) -> str:
    """Return a difference of shares, or both ends of its range, as text.

    >>> percentage_points(0.318, 0.318, 0), percentage_points(-0.005, 0.0213, 1)
    ('+32 percentage points', '-0.5 to +2.1 percentage points')
    """
    ends = (f"{100 * end:+.{digits}f}" for end in (low, high))
    shown = (end.lstrip("+-") if not float(end) else end for end in ends)
    return f"{both(*shown)} percentage points"


def span(low: float | None, high: float | None, digits: int = 0) -> str:
    """Return a range as text, "4 to 8", or one number if both ends are equal; "not known" for None.

    >>> span(4, 8), span(5.04, 5.02, 1)
    ('4 to 8', '5.0')
    """
    if low is None or high is None:
        return "not known"
    return both(f"{low:.{digits}f}", f"{high:.{digits}f}")


def both(first: str, second: str) -> str:
    """Return two ends as text, or one where they read the same.

    >>> both("3 s", "5 s"), both("3 s", "3 s")
    ('3 s to 5 s', '3 s')
    """
    return first if first == second else f"{first} to {second}"
