"""Provenance: which version of the package computed a result, stated in every output.

    JSON      member `provenance`, with `version`
    Parquet   metadata key `provenance`, the same as JSON
    CSV       the JSON beside it (`<name>.meta.json`): a column or a line of its own would break readers of numbers
    MCAP      `library` of the header (a copy has that of the recording behind it), and key `provenance` of the
              metadata record
    Excel     the creator in its properties, and rows of the sheet `Summary`
    HTML      <meta name="generator">
    SVG       <metadata>
    code      a line of its own with the generator; so PDDL, as its first comment

There is no time stamp among it: the same command on the same version gives the same bytes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from reba._version import __version__
from reba.files import as_json
from reba.open_file import open_regular

if TYPE_CHECKING:
    import pandas as pd

MEMBER: Final = "provenance"
"""Name of the member, and of the metadata key."""


def provenance() -> dict[str, Any]:
    """Return what says which program computed a result.

    >>> list(provenance())
    ['version']
    """
    return {"version": __version__}


def with_provenance(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return data with the member `provenance`; what the data already say of their origin is kept.

    >>> with_provenance({"frames": 2, "provenance": {"version": "0.0.1"}})
    {'frames': 2, 'provenance': {'version': '0.0.1'}}
    """
    return {**data, MEMBER: {**provenance(), **data.get(MEMBER, {})}}


def generator(program: str = "dreba") -> str:
    """Return program and version as one text.

    >>> generator("reba").split()[0]
    'reba'
    """
    return f"{program} {__version__}"


def other_version(origin: Any) -> str:
    """Return how the version that computed something, by its provenance, differs from this one, "" if it is the same.

    >>> other_version({"version": "0.0.1"}).startswith("computed by dreba 0.0.1, this is ")
    True
    >>> other_version(provenance())
    ''
    """
    version = origin.get("version") if isinstance(origin, Mapping) else None
    if version == __version__:
        return ""
    return f"computed by {'an unknown version' if version is None else f'dreba {version}'}, this is {__version__}"


def parquet_metadata(
    existing: Mapping[bytes, bytes] | None, origin: Mapping[str, Any] | None = None
) -> dict[bytes, bytes]:
    """Return the metadata of a Parquet schema with the provenance, by default that of this version."""
    return {**(existing or {}), MEMBER.encode(): as_json(provenance() if origin is None else origin).encode()}


def write_parquet(frame: pd.DataFrame, path: Path, origin: Mapping[str, Any] | None = None) -> None:
    """Write a table without its index as Parquet with the provenance, by default that of this version."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pandas(frame, preserve_index=False)
    metadata = parquet_metadata(table.schema.metadata, origin)
    with path.open("wb") as stream:  # pyarrow opens no path that is not UTF-8
        pq.write_table(table.replace_schema_metadata(metadata), stream, compression="zstd")


def parquet_provenance(path: Path) -> Any:
    """Return the provenance of a Parquet file, None without one.

    Raises:
        OSError, ValueError: the file is not Parquet, or damaged.
    """
    import pyarrow.parquet as pq

    with open_regular(path) as file:
        text = (pq.read_schema(file).metadata or {}).get(MEMBER.encode())
    return None if text is None else json.loads(text)
