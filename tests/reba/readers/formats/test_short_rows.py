"""Tables whose rows lack or repeat fields: the size of the file bounds the memory, not its header times its rows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import reba
from reba.errors import ReadError
from reba.readers.formats import open_recording
from tests.support.says import says

MARKERS, ROWS = 3000, 30_000


def names(markers: int) -> list[str]:
    return [f"m{number}" for number in range(markers)]


def trc(markers: int, rows: int) -> str:
    keys = "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits"
    header = f"PathFileType\t4\t(X/Y/Z)\tx.trc\n{keys}\n60\t60\t{rows}\t{markers}\tm\n"
    columns = "Frame#\tTime\t" + "\t\t\t".join(names(markers)) + "\n"
    axes = "\t\t" + "\t".join(f"{axis}{number}" for number in range(markers) for axis in "XYZ") + "\n\n"
    return header + columns + axes + "".join(f"{row + 1}\t{row / 60}\t1\n" for row in range(rows))


def vicon(markers: int, rows: int) -> str:
    top = "Trajectories\n100\n,," + ",,,".join(f"s:{name}" for name in names(markers)) + ",,\n"
    axes = "Frame,Sub Frame" + ",X,Y,Z" * markers + "\n," + ",mm" * (3 * markers)
    return top + axes + "\n" + "".join(f"{row},0,1\n" for row in range(rows))


def csv(markers: int, rows: int) -> str:
    columns = ",".join(f"{name}_{axis}" for name in names(markers) for axis in "xyz")
    return f"time,{columns}\n" + "".join(f"{row},1\n" for row in range(rows))


@pytest.mark.parametrize("make", [trc, vicon, csv])
def test_rows_that_lack_nearly_all_fields_of_a_large_header_are_refused(
    make: Callable[[int, int], str], tmp_path: Path
) -> None:
    path = tmp_path / f"shift.{'trc' if make is trc else 'csv'}"
    path.write_text(make(MARKERS, ROWS))
    assert path.stat().st_size < 1_000_000
    with pytest.raises(ReadError) as error:
        reba.read(path)
    says(error, path, "fields", "export it again")


def test_a_packed_table_that_is_nearly_all_alike_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "shift.parquet"
    schema = pa.schema([(name, pa.float64()) for name in ("time", "trunk_flexion", *names(20))])
    same = pa.table([pa.array(np.zeros(1_000_000))] * len(schema), schema)
    pq.write_table(same, path, compression="zstd", row_group_size=len(same))
    with pytest.raises(ReadError) as error:
        reba.read(path)
    says(error, path, "1000000 rows", "22 fields", "export it again")


def test_rows_in_which_no_marker_is_seen_are_gaps(tmp_path: Path) -> None:
    path = tmp_path / "shift.trc"
    path.write_text(trc(100, 2000))
    (stream,) = open_recording(path).streams
    assert sum(len(block.time) for block in stream.blocks()) == 2000
