"""Rows of a table as JSON messages, and the JSON schema that viewers need to plot them.

Foxglove and Lichtblick know one plain type per property, and show nothing of a topic whose schema has a list of types,
such as ["number", "null"]: a value that is missing is left out of its message instead.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, Final

import pandas as pd
from pandas.api import types

from reba.arrays import Indices
from reba.posture.columns import COLUMNS

BLOCK_ROWS: Final = 512
"""Frames converted to JSON text at a time; bounds the memory for text."""
_MISSING: Final = re.compile(r',"(?:[^"\\]|\\.)*":null')
"""A member without a value, not the first one. Inside of a text, quotes have a backslash before them."""


def schema_of(data: pd.DataFrame, title: str) -> dict[str, Any]:
    """Return the JSON schema of the rows of a table: one plain type per property, absent where it has no value.

    >>> schema_of(pd.DataFrame({"time": [0.0], "shock": [True]}), "t")["properties"]["shock"]
    {'type': 'boolean', 'description': 'absent: not known'}
    """

    def about(name: str) -> str:
        if name == "time":
            return "seconds since the start of the recording"
        return "degrees; absent: not measured" if name in COLUMNS else "absent: not known"

    properties = {
        str(name): {"type": json_type(column), "description": about(str(name))} for name, column in data.items()
    }
    return {"title": title, "type": "object", "properties": properties}


def json_type(column: pd.Series) -> str:
    """Return the JSON type of the values of a column; of mixed ones, which become text, "string"."""
    if types.is_bool_dtype(column.dtype):
        return "boolean"
    if types.is_numeric_dtype(column.dtype):
        return "integer" if types.is_integer_dtype(column.dtype) else "number"
    kinds = {type(value) for value in column.dropna().tolist()}
    if kinds == {bool}:
        return "boolean"
    return "number" if kinds and kinds <= {int, float} else "string"


def json_rows(data: pd.DataFrame, order: Indices) -> Iterator[bytes]:
    """Yield the JSON text of rows in an order; `time`, the first column, always has a value."""
    mixed = [name for name, column in data.items() if column.dtype == object and json_type(column) == "string"]
    for first in range(0, len(order), BLOCK_ROWS):
        rows = data.iloc[order[first : first + BLOCK_ROWS]].dropna(axis="columns", how="all")
        if mixed:
            texts = {str(name): rows[name].map(str, na_action="ignore") for name in mixed if name in rows}
            rows = rows.assign(**texts)
        lines = rows.to_json(orient="records", lines=True, double_precision=9).splitlines()
        yield from ((_MISSING.sub("", line) if ":null" in line else line).encode() for line in lines)


def without_missing(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return plain data without members that have no value, also those of the objects in it.

    >>> without_missing({"mean": None, "window": {"low": 3, "high": None}})
    {'window': {'low': 3}}
    """
    return {
        key: without_missing(value) if isinstance(value, dict) else value
        for key, value in record.items()
        if value is not None
    }
