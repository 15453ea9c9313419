"""Reading files: tables, profile files, unknown files and folders."""

from __future__ import annotations

from pathlib import Path

import pytest

from reba.errors import ProfileError, ReadError
from reba.readers import is_recording, is_recording_folder, read
from reba.readers.recording.profile import find_profile
from tests.support.says import says
from tests.support.synthetic_bodies import table_file


def test_a_posture_table_is_completed_sorted_and_hashed(tmp_path: Path) -> None:
    file = table_file(tmp_path / "a.csv", ["0.1,20,5,1", "0.0,10,5,1", "0.1,99,5,1", "0.2,30,,2"])
    table = read(file)
    assert table.profile == "table"
    assert list(table.data.columns[:2]) == ["time", "trunk_flexion"]
    assert table.data["trunk_flexion"].tolist() == [10.0, 20.0, 30.0]
    assert table.data["load"].tolist() == [1.0, 1.0, 2.0]
    assert len(table.unmeasured) == 20
    assert len(table.quality.sha256) == 64
    assert any("repeat the time" in text for text in table.quality.warnings)


def test_joint_columns_of_a_csv_by_a_named_profile(tmp_path: Path) -> None:
    names = find_profile("human_description").names
    rows = [",".join([f"{i / 50}", *[f"{0.01 * i + 0.001 * k:.6f}" for k in range(len(names))]]) for i in range(60)]
    file = table_file(tmp_path / "joints.csv", rows, ",".join(["time", *names]))
    assert read(file).profile == "human_description"
    assert read(file, profile="human_description").quality.rate == pytest.approx(50.0)
    with pytest.raises(ProfileError) as caught:
        read(file, profile="ros4hri")
    says(caught, "profile ros4hri", "does not fit", "reba profiles")
    with pytest.raises(ProfileError) as caught:
        read(file, topic="nothing")
    says(caught, "no stream 'nothing'", "joints")


def test_names_of_ones_own_by_a_profile_file(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text(
        'name = "lab"\ntitle = "t"\nsource = "s"\nkind = "joints"\nunit = "deg"\nrequired = ["back"]\n'
        '[chains]\nthorax = ["-z back"]\n[columns]\nknee_flexion_left = ["-knee", 5]\n'
    )
    rows = [f"{i / 50},{10 + i / 10},{-i / 10}" for i in range(100)]
    table = read(table_file(tmp_path / "lab.csv", rows, "time,back,knee"), profile=mine)
    assert table.profile == "lab"
    assert table.data["trunk_flexion"].iloc[[0, -1]].tolist() == [10.0, 19.9]
    assert table.data["knee_flexion_left"].iloc[-1] == pytest.approx(14.9)
    assert table.why_unmeasured["neck_flexion"] == "this source has no such joint"


def test_unknown_files_are_refused_with_what_is_read(tmp_path: Path) -> None:
    with pytest.raises(ReadError) as caught:
        read(tmp_path / "missing.mcap")
    says(caught, "missing.mcap", "no such file")
    strange = tmp_path / "walk.xyz"
    strange.write_bytes(b"\x00\x00\x00\x18ftypmp42" * 10)
    with pytest.raises(ReadError) as caught:
        read(strange)
    says(caught, "walk.xyz", "format is unknown", "MCAP", "BVH", "C3D")
    assert not is_recording(strange)
    empty = tmp_path / "empty.xyz"
    empty.write_bytes(b"")
    with pytest.raises(ReadError) as caught:
        read(empty)
    says(caught, "empty.xyz", "the file is empty")


def test_folders_of_splits_are_recordings(tmp_path: Path) -> None:
    for name in ("run_0.mcap", "run_1.mcap"):
        (tmp_path / name).write_bytes(b"")
    assert is_recording_folder(tmp_path)
    (tmp_path / "other.mcap").write_bytes(b"")
    assert not is_recording_folder(tmp_path)
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    assert is_recording_folder(tmp_path)


@pytest.mark.parametrize(
    ("names", "one"),
    [
        (("a_0.db3", "a_1.db3"), True),
        (("a_0.db3.zstd", "a_1.db3.zstd"), True),
        (("lab_2026-03-01-10-00-00_0.bag", "lab_2026-03-01-10-05-00_1.bag"), True),
        (("lab_2026-03-01-10-00-00_0.bag", "lab_2026-03-02-10-05-00_0.bag"), False),
        (("2026-03-01-10-00-00.bag", "2026-03-02-10-05-00.bag"), False),
        (("a_0.bag", "b_1.bag"), False),
    ],
)
def test_splits_of_bags(names: tuple[str, ...], one: bool, tmp_path: Path) -> None:
    for name in names:
        (tmp_path / name).write_bytes(b"")
    assert is_recording_folder(tmp_path) == one


def test_databases_of_other_programs_are_no_recordings(tmp_path: Path) -> None:
    for name, expected in (("notes.sqlite", False), ("a.db3", True)):
        (tmp_path / name).write_bytes(b"SQLite format 3\0" + bytes(100))
        assert is_recording(tmp_path / name) == expected
