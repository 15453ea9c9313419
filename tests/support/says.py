"""What an error says, checked by its facts and not by its sentence."""

from __future__ import annotations

from typing import Any

import pytest


def says(error: BaseException | pytest.ExceptionInfo[Any] | str, *facts: object) -> None:
    """Assert that a message is one line and names every fact: what was given, what is expected, what to do next.

    >>> says("load is -1 kg; expected 0 or more", "load", -1, "0 or more")
    """
    text = str(error.value if isinstance(error, pytest.ExceptionInfo) else error)
    assert "\n" not in text.strip(), text
    missing = [fact for fact in facts if str(fact).lower() not in text.lower()]
    assert not missing, f"{text!r} does not say {missing}"
