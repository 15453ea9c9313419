"""Values that most arguments of public functions are not: each ends in the package's own error, in one line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import reba
from reba.checks import shown

WRONG: tuple[Any, ...] = (
    None,
    3,
    -2.5,
    "x",
    b"x",
    object(),
    [],
    {},
    np.zeros(3),
    np.zeros((2, 5)),
    np.array(["a", "b"]),
    Path("nowhere"),
    float("nan"),
    float("inf"),
    1e300,
    10**400,
    -(16**5000),
    True,
    np.full((2, 22), np.nan),
    np.empty((0, 22)),
    [10**400],
    [None],
    [[1], [1, 2]],
    {1: 2},
    {"a": None},
    {"a"},
    pd.DataFrame({"a": ["x"]}),
    pd.Series([1, 2]),
    2 + 1j,
    "x" * 5000,
    "a\nb",
    "a\0b",
    "\ud800",
)
"""Of these most do not fit any one argument; those that do must simply work."""


def refuses(name: str, call: Callable[[Any], Any], more: tuple[Any, ...] = ()) -> None:
    """Assert that a call with each of these values works, or is refused in one line."""
    for wrong in (*WRONG, *more):
        try:
            call(wrong)
        except reba.RebaError as error:
            text = str(error)
            assert text, (name, wrong)
            assert "\n" not in text, (name, wrong)
        except Exception as error:
            raise AssertionError(f"{name}: {shown(wrong)} ends in {error!r}") from error
