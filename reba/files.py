"""Plain data as strict JSON text: NumPy scalars as numbers, what is no number (NaN, infinity) as null."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def as_json(value: Any, *, indent: int | None = None) -> str:
    """Return plain data as JSON that every reader takes.

    >>> as_json({"rate": float("nan"), "frames": np.int64(1)})
    '{"rate": null, "frames": 1}'
    """
    return json.dumps(_plain(value), indent=indent, allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
