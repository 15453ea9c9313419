"""The page of the screwdriver experiment, and everything else that is written once the runs are made."""

from __future__ import annotations


def number(value: float | None, digits: int = 2) -> str:
    """Return a number in words, a dash where there is none."""
    return "–" if value is None else f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")


def p_value(value: float | None) -> str:
    """Return an exact p value: two digits that count.

    Example:
        >>> p_value(0.0123), p_value(1.24e-9), p_value(None)
        ('0.012', '1.2e-09', '–')
    """
    return "–" if value is None else f"{value:.2g}" if value < 0.0995 else f"{value:.2f}"


def p_said(p: float | None) -> str:
    """Return a p value as it is written in a sentence.

    >>> p_said(0.0312), p_said(0.00002), p_said(None)
    ('p = .031', 'p < .001', 'p not defined')
    """
    return "p not defined" if p is None else "p < .001" if p < 0.001 else f"p = {p:.3f}".replace("0.", ".")


def signed(value: float | None) -> str:
    """Return a number with its sign."""
    return "not defined" if value is None else f"{value:+.2f}".replace("-", "\N{MINUS SIGN}")
