"""Statistics as text: p values in sentences and tables."""

from __future__ import annotations

import pytest

from lgp.statistics.formatting import p_text, p_value


def test_p_values_in_words() -> None:
    assert [p_text(p) for p in (0.5, 0.0451, 1e-9, None)] == ["p = 0.500", "p = 0.045", "p < 0.001", "p not defined"]


@pytest.mark.parametrize(
    ("p", "text"), [(None, "–"), (1.0, "1.00"), (0.0996, "0.10"), (0.0994, "0.099"), (1.24e-9, "1.2e-09")]
)
def test_p_values_have_two_significant_digits(p: float | None, text: str) -> None:
    assert p_value(p) == text
