"""Columns of data with names, in whatever form: tables, mappings, records, rows; and data whose order is in doubt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from reba.errors import PostureError, join_names
from reba.posture.columns import COLUMNS, COLUMNS_OF

_NAMES = frozenset((*COLUMNS, *COLUMNS_OF))
_MOST = 4
"""Labels that a message repeats."""


def named_columns(data: Any) -> dict[str, Any] | None:
    """Return the columns of named data, or None for data without names.

    A DataFrame; a Series of one pose, or of one angle over time; a mapping; a structured array; whatever offers
    `to_pandas`, such as tables of Arrow and Polars; `PostureTable`, `Scores`, `dreba.Poses`; a list of poses by name.
    A name that stands twice has a DataFrame of its columns.

    >>> named_columns(np.array([(5.0, 3.0)], dtype=[("neck_twist", float), ("trunk_twist", float)])).keys()
    dict_keys(['neck_twist', 'trunk_twist'])
    """
    if isinstance(data, pd.DataFrame):
        if not any(isinstance(name, str) for name in data.columns):
            return None
        return {str(name): data[name] for name in data.columns}
    if isinstance(record := _record(data), Mapping):
        return dict(record)
    if isinstance(data, pd.Series):
        return {data.name: data} if isinstance(data.name, str) and data.name in _NAMES else None
    if isinstance(data, np.ndarray):
        return {name: data[name] for name in data.dtype.names} if data.dtype.names else None
    if isinstance(data, Sequence) and len(data):
        rows = [_record(row) for row in data]
        known = [row for row in rows if row is not None]
        names = dict.fromkeys(name for row in known for name in row)
        return {name: [row.get(name) for row in known] for name in names} if len(known) == len(rows) else None
    if isinstance(angles := getattr(data, "angles", None), np.ndarray):  # Scores, Poses
        return dict(zip(COLUMNS, angles.T, strict=True))
    if isinstance(frame := getattr(data, "data", None), pd.DataFrame):  # PostureTable
        return named_columns(frame)
    if callable(convert := getattr(data, "to_pandas", None)) and not isinstance(data, type):
        try:
            return named_columns(convert())
        except ValueError:  # such as an array of three dimensions with labels
            return None
    return None


def _record(row: Any) -> Mapping[str, Any] | None:
    """Return one pose by name: a mapping, a Series with names, a named tuple or a row of a structured array."""
    if isinstance(row, Mapping):  # but no sparse matrix by (row, column)
        return row if all(isinstance(name, str) for name in row) else None
    if isinstance(row, pd.Series):
        if row.index.dtype.kind not in "OV" or not any(isinstance(name, str) for name in row.index):
            return None
        if row.index.is_unique:
            return {str(name): value for name, value in row.items()}
        values = {str(name): row[name] for name in row.index}
        return {name: v.to_frame().T if isinstance(v, pd.Series) else v for name, v in values.items()}
    if isinstance(row, np.void) or (isinstance(row, np.ndarray) and row.ndim == 0):
        return {name: row[name] for name in row.dtype.names} if row.dtype.names else None
    fields = getattr(row, "_fields", None)
    return dict(zip(fields, row, strict=True)) if isinstance(row, tuple) and fields else None


def refuse_doubtful_order(data: Any, error: type[ValueError] = PostureError) -> None:
    """Refuse data without names that would be read by position although their labels or rows stand in another order.

    Raises:
        PostureError: labels that are neither names nor rising numbers, names down the rows, or names in some rows only.
    """
    if isinstance(data, pd.DataFrame | pd.Series):
        columns = isinstance(data, pd.DataFrame)
        labels = data.columns if columns else data.index
        if columns and len(_NAMES.intersection(label for label in data.index if isinstance(label, str))):
            raise error("the names of the columns stand in the index; expected one pose a row, so transpose the table")
        if labels.dtype.kind not in "iufmM" or not (labels.is_monotonic_increasing and labels.is_unique):
            shown = join_names([str(label) for label in labels[: _MOST + 1]], _MOST)
            raise error(f"angles are labelled {shown}; expected names of reba.COLUMNS, or an array in their order")
    elif isinstance(data, list | tuple) and any(_record(row) is not None for row in data):
        raise error("some poses have names and others have none; expected names in all of them")
