"""Statistics as text: numbers, p values and signed differences, as reports and conclusions print them."""

from __future__ import annotations


def number(value: float | None, digits: int = 2) -> str:
    """Number with a fixed count of decimals and a true minus sign; a dash for None."""
    return "–" if value is None else f"{value:z.{digits}f}".replace("-", "\N{MINUS SIGN}")


def p_value(value: float | None) -> str:
    """P value with two significant digits, for tables; a dash for None.

    >>> p_value(0.0123), p_value(1.24e-9), p_value(None)
    ('0.012', '1.2e-09', '–')
    """
    return "–" if value is None else f"{value:.2g}" if value < 0.0995 else f"{value:.2f}"


def p_text(p: float | None) -> str:
    """P value with three decimals, for sentences.

    >>> p_text(0.0312), p_text(0.00002), p_text(None)
    ('p = 0.031', 'p < 0.001', 'p not defined')
    """
    return "p not defined" if p is None else "p < 0.001" if p < 0.001 else f"p = {p:.3f}"


def signed(value: float | None) -> str:
    """Number with its sign and two decimals, without one where it rounds to nothing; "not defined" for None.

    >>> signed(0.5), signed(-0.001), signed(None)
    ('+0.50', '0.00', 'not defined')
    """
    if value is None:
        return "not defined"
    text = f"{value:+.2f}"
    return text[1:] if not float(text) else text.replace("-", "\N{MINUS SIGN}")
