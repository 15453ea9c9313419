"""How far the posture angles and scores read from each encoding agree with those read from the recording itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

import reba
import reba.readers
from reba.posture.columns import ANGLES, COLUMNS
from reba.posture.table import PostureTable
from reba.readers.recording.profile import profile_text

SHARES = ("same REBA", "same REBA by carried columns", "REBA in stated range")


@dataclass(frozen=True)
class Agreement:
    """One encoding against the recording, over the frames both have.

    Attributes:
        frames: how many.
        profile: name of the profile that was recognised.
        largest: angle column -> largest absolute difference [deg]; NaN = not measured in the encoding.
        typical: angle column -> 99th percentile of it [deg].
        same: share of frames with the same REBA score, everything unmeasured taken as neutral in both.
        carried: the same with every column that the encoding lacks taken out of the recording as well.
        inside: share of frames whose REBA score from the recording lies in the range stated for the encoding.
        mean: mean REBA score, unmeasured angles neutral.
    """

    frames: int
    profile: str
    largest: dict[str, float]
    typical: dict[str, float]
    same: float
    carried: float
    inside: float
    mean: float


def _last(table: PostureTable, count: int) -> PostureTable:
    """Return the last `count` frames: the encodings leave the first one, a T-pose, out."""
    data = table.data.iloc[-count:].reset_index(drop=True)
    return PostureTable(data.assign(time=data["time"] - data["time"].iloc[0]), source=table.source)


def _differences(first: pd.DataFrame, second: pd.DataFrame, column: str) -> np.ndarray:
    apart = np.abs(first[column].to_numpy() - second[column].to_numpy())
    return np.minimum(apart, 360.0 - apart)


def compare(recording: PostureTable, encoded: PostureTable) -> Agreement:
    """Compare two posture tables of the same movement; the recording may have more frames at its start."""
    count = len(encoded.data)
    first, second = _last(recording, count), _last(encoded, count)
    apart = {column: _differences(first.data, second.data, column) for column in COLUMNS}
    lacking = [column for column in COLUMNS if second.data[column].isna().all()]
    masked = PostureTable(first.data.assign(**dict.fromkeys(lacking, np.nan)))
    whole, part, other = (
        reba.score(table, missing="neutral").data["reba"].to_numpy(int) for table in (first, masked, second)
    )
    ranges = reba.score(second).data
    low, high = (ranges[name].to_numpy(int) for name in ("reba_low", "reba_high"))
    measured = {column: values[~np.isnan(values)] for column, values in apart.items()}
    return Agreement(
        frames=count,
        profile=encoded.profile,
        largest={name: float(v.max()) if v.size else float("nan") for name, v in measured.items()},
        typical={name: float(np.percentile(v, 99)) if v.size else float("nan") for name, v in measured.items()},
        same=float(np.mean(whole == other)),
        carried=float(np.mean(part == other)),
        inside=float(np.mean((low <= whole) & (whole <= high))),
        mean=float(np.mean(other)),
    )


def read_by_chest(recording: Path, folder: Path) -> PostureTable:
    """Read an Xsens BVH with the trunk taken from the chest instead of the line from hips to shoulders.

    Args:
        recording: the file.
        folder: where a copy of the profile with that one change may be written.
    """
    shipped = profile_text("bvh_xsens")
    changed = folder / "bvh_xsens_chest.toml"
    changed.write_text('trunk = "thorax"\n' + shipped.replace('"bvh_xsens"', '"bvh_xsens_chest"'))
    return reba.read(recording, profile=changed)


def compare_all(recording: Path, paths: dict[str, Path], folder: Path) -> dict[str, Agreement]:
    """Read the recording and every encoding of it and compare them.

    Joint states of human.urdf whose trunk is the chest are compared twice, the second time ("..., chest") with the
    trunk of the recording by its chest as well.
    """
    line, chest = reba.read(recording), read_by_chest(recording, folder)
    found = {}
    for name, path in paths.items():
        encoded = reba.read(path)
        found[name] = compare(line, encoded)
        if name.startswith("human_urdf") and name != "human_urdf_line":
            found[f"{name}, chest"] = compare(chest, encoded)
    return found


def agreement_table(found: dict[str, Agreement]) -> str:
    """Return the comparison as a Markdown table: 99th percentile (largest) difference in degrees, of the worse side."""
    rows = [["", "profile", *(angle.name for angle in ANGLES), *SHARES, "mean REBA"]]
    for name, one in found.items():
        cells = []
        for angle in ANGLES:
            typical, largest = (
                max(values[column] for column in angle.columns) for values in (one.typical, one.largest)
            )
            cells.append("not measured" if np.isnan(largest) else f"{typical:.2f} ({largest:.2f})")
        rows.append(
            [
                name,
                one.profile,
                *cells,
                *(f"{100 * share:.1f} %" for share in (one.same, one.carried, one.inside)),
                f"{one.mean:.2f}",
            ]
        )
    lines = ["| " + " | ".join(row) + " |" for row in zip(*rows, strict=True)]
    return "\n".join([lines[0], "|" + "---|" * len(rows), *lines[1:]])
