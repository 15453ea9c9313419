"""Write score tables and posture tables: Parquet, CSV and MCAP.

The rules with every threshold, what was assumed and what was not measured go with the numbers: as Parquet metadata
(key `reba`), as an MCAP metadata record, and beside a CSV as `<name>.meta.json`. Every file is written beside its
target and renamed once it is whole.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from reba._version import __version__
from reba.errors import RebaError
from reba.files import as_json, write_atomic, write_text
from reba.posture.factors import FACTORS
from reba.posture.table import PostureTable
from reba.scores import Scores
from reba.writers.mcap import write_mcap

ROWS: Final = 16_384
"""Rows converted at a time, so that writing an hour does not need a second copy of the table."""
SUFFIXES: Final = (".parquet", ".csv", ".mcap")


def write_scores(scores: Scores, path: str | Path) -> None:
    """Write the score table; the suffix of `path` chooses .parquet, .csv or .mcap.

    An .mcap holds the original topics as well if the scored recording was MCAP.

    Raises:
        RebaError: unknown suffix, or the file cannot be written.
    """
    _write(scores.data, _about_scores(scores), Path(path), scores.postures, "scores")


def write_postures(
    postures: PostureTable, path: str | Path, *, records: Mapping[str, Mapping[str, str]] | None = None
) -> None:
    """Write a posture table; the suffix of `path` chooses .parquet, .csv or .mcap.

    Args:
        records: further metadata records of an .mcap: name -> text by key.

    Raises:
        RebaError: unknown suffix, records for another one than .mcap, or the file cannot be written.
    """
    if records and Path(path).suffix.lower() != ".mcap":
        raise RebaError(f"{path}: only an .mcap carries metadata records; choose that ending")
    _write(postures.data, about_postures(postures), Path(path), postures, "postures", records)


def about_postures(postures: PostureTable) -> dict[str, Any]:
    """Return what belongs to a posture table beside its numbers, as plain data."""

    return {
        "reba_version": __version__,
        "source": Path(postures.source).name,
        "topic": postures.topic,
        "profile": postures.profile,
        "recognised": postures.recognised,
        "unmeasured": list(postures.unmeasured),
        "why_unmeasured": dict(postures.why_unmeasured),
        "assumed": list(postures.assumed),
        "epoch": postures.epoch,
        "quality": dataclasses.asdict(postures.quality),
    }


def _about_scores(scores: Scores) -> dict[str, Any]:
    return {
        **about_postures(scores.postures),
        "rules": dataclasses.asdict(scores.rules),
        "missing": scores.missing,
        "assumed": list(scores.assumed),
        "factors": {name: _factor(getattr(scores.factors, name)) for name in FACTORS},
        "activity": scores.activity_causes,
    }


def _factor(values: Any) -> Any:
    """Return a factor that is the same in every frame, or "per frame"; its points stand in the score table."""
    given = np.unique(np.asarray(values))
    return given[0].item() if len(given) == 1 else "per frame"


def _write(
    data: pd.DataFrame,
    about: dict[str, Any],
    path: Path,
    postures: PostureTable,
    kind: str,
    records: Mapping[str, Mapping[str, str]] | None = None,
) -> None:
    suffix = path.suffix.lower()
    if suffix == ".parquet":
        write_atomic(path, lambda part: _parquet(data, about, part))
    elif suffix == ".csv":
        write_atomic(path, lambda part: data.to_csv(part, index=False, chunksize=ROWS))
        text = as_json(about, indent=1) + "\n"
        write_atomic(path.with_name(path.name + ".meta.json"), lambda part: write_text(part, text))
    elif suffix == ".mcap":
        write_atomic(path, lambda part: write_mcap(data, about, part, postures, kind, records))
    else:
        raise RebaError(f"{path}: ending {suffix!r} is unknown; choose one of {', '.join(SUFFIXES)}")


def _parquet(data: pd.DataFrame, about: dict[str, Any], path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.Schema.from_pandas(data.iloc[:0], preserve_index=False)
    note = as_json(about)
    schema = schema.with_metadata({**(schema.metadata or {}), b"reba": note.encode()})
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        for start in range(0, max(len(data), 1), ROWS):
            rows = pa.Table.from_pandas(data.iloc[start : start + ROWS], schema=schema, preserve_index=False)
            writer.write_table(rows)
