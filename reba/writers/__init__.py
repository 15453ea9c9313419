"""Write score tables and posture tables: Parquet, CSV, MCAP and Excel workbooks.

The rules with every threshold, the assumed factors and the unmeasured angles are written with the numbers: as Parquet
metadata (key `reba`), as an MCAP metadata record, and beside a CSV as `<name>.meta.json`, with the version that
computed them (`reba.provenance`). No text of a CSV is a formula (`reba.cells`); `reba.read` gives it back as it was.
Every file is written under a temporary name in the target folder and renamed when it is complete.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from reba.analysis.score_table import SCORES
from reba.cells import cells_of
from reba.checks import PATH, YES_NO, Allowed, accepts, instance
from reba.errors import RebaError
from reba.files import as_json, write_atomic, write_atomic_stream, write_text
from reba.method.scoring import SCORE_COLUMNS
from reba.outputs import FileOutput, check_outputs
from reba.posture.columns import COLUMNS
from reba.posture.factors import FACTORS
from reba.posture.table import PostureTable
from reba.provenance import parquet_metadata, with_provenance
from reba.readers.formats.score_file import ABOUT
from reba.scores import Scores
from reba.writers.mcap import write_mcap
from reba.writers.xlsx import check_frames, write_xlsx

BLOCK_ROWS: Final = 4096
"""Rows converted at a time, a row group of Parquet, so that writing one hour (360,000 rows at 100 Hz) needs no second
copy of the table; more of them take more memory and pack no better."""
CSV_ROWS: Final = 2000
"""Rows that are texts in memory at once; a text takes ten times the memory of its number."""
SUFFIXES: Final = (".parquet", ".csv", ".mcap", ".xlsx")


def table_output(path: str | Path) -> FileOutput:
    """Return what is written for a table of this name."""
    return FileOutput(path, SUFFIXES, (ABOUT,) if Path(path).suffix.lower() == ".csv" else ())


@accepts(RebaError, scores=SCORES, path=PATH, as_ros=YES_NO)
def write_scores(scores: Scores, path: str | Path, *, as_ros: bool = False) -> None:
    """Write the score table; the ending of `path` chooses .parquet, .csv, .mcap or .xlsx.

    A workbook has sheets for summary, worst intervals and frames, and one whose formulas take the angles of a frame to
    its REBA. Beside the scores stand the angles and factors that they came from; `reba.read_scores` reads them back.
    An .mcap is a copy of the scored recording if that was MCAP, with a topic of scores at the log times of its
    messages.

    Args:
        scores: scores of one recording.
        path: file to write; its folder is created if missing.
        as_ros: scores of an .mcap as ROS messages, which come with their definition, instead of JSON.

    Raises:
        RebaError: unknown ending, `as_ros` with another one than .mcap, the file cannot be written, or it is the
            recording itself.
    """
    check_as_ros(as_ros, path)
    data, about = _with_postures(scores), _score_metadata(scores)
    _write(data, about, Path(path), scores.postures, "scores", as_ros=as_ros, scores=scores)


def check_as_ros(as_ros: bool, path: str | Path | None) -> None:
    """Check that scores to be written as ROS messages go into an .mcap.

    Raises:
        RebaError: they do not.
    """
    if as_ros and (path is None or Path(path).suffix.lower() != ".mcap"):
        given = f"{path}: " if path is not None else ""
        raise RebaError(f"{given}ROS messages (--as-ros) are written into an .mcap; give an output that ends in .mcap")


def _are_records(value: Any) -> bool:
    return isinstance(value, Mapping) and all(
        isinstance(name, str)
        and isinstance(record, Mapping)
        and all(isinstance(text, str) for text in (*record, *record.values()))
        for name, record in value.items()
    )


@accepts(
    RebaError,
    postures=instance("what reba.read returns", PostureTable),
    path=PATH,
    records=Allowed("names with texts by key", _are_records).or_none(),
)
def write_postures(
    postures: PostureTable, path: str | Path, *, records: Mapping[str, Mapping[str, str]] | None = None
) -> None:
    """Write a posture table; the ending of `path` chooses .parquet, .csv, .mcap or .xlsx.

    Args:
        postures: postures of one recording.
        path: file to write; its folder is created if missing.
        records: further metadata records of an .mcap: name -> text by key.

    Raises:
        RebaError: unknown ending, records for a format other than .mcap, the file cannot be written, or it is the
            recording itself.
    """
    if records and Path(path).suffix.lower() != ".mcap":
        raise RebaError(f"{path}: metadata records need an .mcap file; choose the ending .mcap")
    data = postures.data
    if postures.scored is not None:  # of a file of scores
        data = data.drop(columns=[name for name in SCORE_COLUMNS if name in data and name not in FACTORS])
    _write(data, posture_metadata(postures), Path(path), postures, "postures", records)


def posture_metadata(postures: PostureTable) -> dict[str, Any]:
    """Return the metadata of a posture table as plain data: source, profile, assumptions, quality."""
    return {
        "source": Path(postures.source).name,
        "topic": postures.topic,
        "profile": postures.profile,
        "recognised": postures.recognised,
        "unmeasured": list(postures.unmeasured),
        "why_unmeasured": dict(postures.why_unmeasured),
        "assumed": list(postures.assumed),
        "people": list(postures.people),
        "epoch": postures.epoch,
        "quality": dataclasses.asdict(postures.quality),
    }


def _score_metadata(scores: Scores) -> dict[str, Any]:
    return {
        **posture_metadata(scores.postures),
        "rules": dataclasses.asdict(scores.rules),
        "missing": scores.missing,
        **({} if scores.error is None else {"error": scores.error.to_dict()}),
        "assumed": list(scores.assumed),
        "factors": {name: _factor_value(getattr(scores.factors, name)) for name in FACTORS},
        "activity": scores.activity_causes,
    }


def _with_postures(scores: Scores) -> pd.DataFrame:
    """Return the score table with the angles and factors beside it, from which `reba.read_scores` scores again."""
    postures, n = scores.postures.data, len(scores.data)
    angles = postures[list(COLUMNS)] if set(COLUMNS) <= set(postures) else pd.DataFrame(scores.angles, columns=COLUMNS)
    names = [name for name in FACTORS if name not in scores.data]  # the points of the coupling stand for it
    factors = pd.DataFrame({name: _of_frames(getattr(scores.factors, name), n) for name in names}, copy=False)
    return pd.concat([part.reset_index(drop=True) for part in (scores.data, angles, factors)], axis=1)


def _of_frames(values: Any, n: int) -> NDArray[Any]:
    """Return the value of a factor in each of n frames; texts in memory of their own, as older Arrow needs them."""
    every = np.broadcast_to(values, n)
    return every.astype(object) if every.dtype.kind in "OU" else every


def _factor_value(values: Any) -> Any:
    """Return the value of a constant factor, else "per frame"; the score table contains the points of each frame."""
    distinct = np.unique(np.asarray(values))
    return distinct[0].item() if len(distinct) == 1 else "per frame"


def _write(
    data: pd.DataFrame,
    metadata: dict[str, Any],
    path: Path,
    postures: PostureTable,
    kind: str,
    records: Mapping[str, Mapping[str, str]] | None = None,
    *,
    as_ros: bool = False,
    scores: Scores | None = None,
) -> None:
    check_outputs(table_output(path), inputs=postures.inputs)
    suffix = path.suffix.lower()
    if suffix == ".xlsx":
        check_frames(path, len(data))
        write_atomic(path, lambda part: write_xlsx(data, with_provenance(metadata), scores, part))
        return
    if suffix == ".parquet":
        write_atomic_stream(path, lambda part: _write_parquet(data, metadata, part))
    elif suffix == ".csv":
        text = as_json(with_provenance(metadata), indent=1) + "\n"
        write_atomic(
            path,
            lambda part: cells_of(data).to_csv(part, index=False, chunksize=CSV_ROWS),
            beside={ABOUT: lambda part: write_text(part, text)},
        )
    else:
        about = with_provenance(metadata)
        write_atomic(path, lambda part: write_mcap(data, about, part, postures, kind, records, as_ros=as_ros))


def _write_parquet(data: pd.DataFrame, metadata: dict[str, Any], stream: BinaryIO) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.Schema.from_pandas(data.iloc[:0], preserve_index=False)
    for at, name in enumerate(schema.names):
        if data[name].dtype == object:  # texts, whose type no empty column shows
            schema = schema.set(at, pa.field(name, pa.array(data[name], from_pandas=True).type))
    schema = schema.with_metadata({**parquet_metadata(schema.metadata), b"reba": as_json(metadata).encode()})
    with pq.ParquetWriter(stream, schema, compression="zstd") as writer:
        for start in range(0, max(len(data), 1), BLOCK_ROWS):
            rows = pa.Table.from_pandas(data.iloc[start : start + BLOCK_ROWS], schema=schema, preserve_index=False)
            writer.write_table(rows)
