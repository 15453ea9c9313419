"""Tables with a row for each point and frame: as the same table with a row for each frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from reba.errors import ProfileError
from reba.posture.columns import COLUMNS
from reba.readers import read
from reba.readers.formats.long_points import wide_points
from tests.reba.readers.test_partial_skeletons import COCO, PERSON
from tests.support.says import says


def _long(times: bool = False, sets: tuple[str, ...] = ("3d_xyz",)) -> pd.DataFrame:
    """Return the person as FreeMoCap writes it [mm]; every further set of points lies elsewhere."""
    rows = [
        {
            "frame": at,
            "timestamp": at / 30.0 if times else None,
            "keypoint": word,
            **dict(zip("xyz", 1000.0 * PERSON[name][at] + 10.0 * number, strict=True)),
            "model": "rtmpose.body",
            "trajectory": trajectory,
            "reprojection_error": None,
        }
        for at in range(80)
        for number, trajectory in enumerate(sets)
        for name, word in COCO.items()
    ]
    return pd.DataFrame(rows)


def _wide() -> pd.DataFrame:
    data = {
        f"{word}_{axis}": 1000.0 * PERSON[name][:, at] for name, word in COCO.items() for at, axis in enumerate("xyz")
    }
    return pd.DataFrame({"time": np.arange(80) / 30.0, **data})


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize("times", [True, False])
def test_it_reads_like_a_row_for_each_frame(tmp_path: Path, ending: str, times: bool) -> None:
    long, wide = tmp_path / f"long{ending}", tmp_path / "wide.csv"
    table = _long(times)
    table.sample(frac=1.0, random_state=0).to_csv(long, index=False) if ending == ".csv" else table.to_parquet(long)
    _wide().to_csv(wide, index=False)
    measured, expected = read(long, rate=None if times else 30.0), read(wide)
    assert measured.profile == "keypoints_coco"
    np.testing.assert_allclose(measured.data[["time", *COLUMNS]], expected.data[["time", *COLUMNS]], atol=1e-6)


def test_two_sets_of_points_are_a_question(tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    _long(sets=("3d_xyz", "rigid_3d_xyz")).to_csv(path, index=False)
    with pytest.raises(ProfileError) as caught:
        read(path, rate=30.0)
    says(caught, "2 bodies", "rtmpose.body/3d_xyz", "rtmpose.body/rigid_3d_xyz", "--topic")
    assert read(path, rate=30.0, topic="rtmpose.body/3d_xyz").profile == "keypoints_coco"


def test_an_absent_point_is_a_gap() -> None:
    table = _long()
    wide = wide_points(table[~((table["frame"] == 3) & (table["keypoint"] == "left_hip"))])
    assert wide is not None
    assert len(wide) == 80
    assert wide["left_hip_x"].isna().tolist() == [at == 3 for at in range(80)]


@pytest.mark.parametrize(
    "table",
    [
        _wide(),
        _long().rename(columns={"z": "depth"}),
        _long().drop(columns="keypoint"),
        _long().assign(frame=None),
        _long()[lambda rows: rows["keypoint"].isin(["left_hip", "nose"])],
        pd.DataFrame({"time": [0.0, 1.0], "name": ["a", "b"], "x": [0, 0], "y": [0, 0], "z": [0, 0]}),
    ],
)
def test_other_tables_stay_as_they_are(table: pd.DataFrame) -> None:
    assert wide_points(table) is None
