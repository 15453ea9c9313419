"""SMPL poses in NumPy archives: known postures come back from every layout; archives are bounded and not unpickled."""

from __future__ import annotations

import io
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import reba
from reba.readers.formats import is_recording, open_recording
from tests.support.says import says
from tests.support.smpl_poses import CAMERA, Z_UP, smpl_pose
from tests.support.synthetic_bodies import check_movement, moving_postures

N = len(moving_postures())


def amass(width: int = 156, key: str = "mocap_framerate") -> dict[str, np.ndarray]:
    pose = smpl_pose(moving_postures(), Z_UP, heading=25.0)
    return {
        "trans": np.zeros((N, 3)),
        "gender": np.array("female"),
        key: np.array(120.0),
        "betas": np.zeros(16),
        "dmpls": np.zeros((N, 8)),
        "poses": np.concatenate([pose, np.full((N, width - 66), 0.1)], axis=1),
    }


def library(world: np.ndarray | None = None, body: int = 63) -> dict[str, np.ndarray]:
    pose = smpl_pose(moving_postures(), world)
    rest = np.zeros((N, body - 63))
    return {"global_orient": pose[:, :3], "body_pose": np.concatenate([pose[:, 3:], rest], axis=1)}


def read(folder: Path, arrays: dict[str, np.ndarray], **options: object) -> reba.PostureTable:
    path = folder / "walk.npz"
    np.savez_compressed(path, **arrays)  # type: ignore[arg-type]
    return reba.read(path, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("key", ["mocap_framerate", "mocap_frame_rate"])
@pytest.mark.parametrize(("width", "model"), [(72, "SMPL"), (156, "SMPL-H"), (165, "SMPL-X")])
def test_amass(tmp_path: Path, key: str, width: int, model: str) -> None:
    table = read(tmp_path, amass(width, key))
    assert (table.profile, table.unmeasured, len(table.data)) == ("smpl", (), N)
    check_movement(table)
    np.testing.assert_allclose(table.data["time"], np.arange(N) / 120.0)
    assert table.quality.time_source == key
    assert not table.quality.warnings
    assert is_recording(tmp_path / "walk.npz")
    (topic, *others) = open_recording(tmp_path / "walk.npz").topics
    says(topic.type, f"{model} poses")
    says(topic.why, "22 joints", "vertical z as in AMASS")
    assert {other.name for other in others} == {"trans", "gender", "betas", "dmpls", key}
    assert any("spine3" in text for text in table.assumed)


def test_archives_without_a_pose_are_no_recordings(tmp_path: Path) -> None:
    np.savez(tmp_path / "shape.npz", betas=np.zeros(16), gender="male")
    assert not is_recording(tmp_path / "shape.npz")


@pytest.mark.parametrize("body", [63, 69])
@pytest.mark.parametrize("form", ["flat", "joints", "person", "batch", "person in each frame", "root in a row"])
def test_global_orient_and_body_pose(tmp_path: Path, body: int, form: str) -> None:
    arrays = library(body=body)
    if form == "joints":
        arrays["body_pose"] = arrays["body_pose"].reshape(N, -1, 3)
    if form == "person":
        arrays = {name: values[None] if name == "body_pose" else values for name, values in arrays.items()}
    if form == "batch":
        arrays = {name: values[None] for name, values in arrays.items()}
    if form == "person in each frame":
        arrays = {name: values[:, None] for name, values in arrays.items()}
    if form == "root in a row":
        arrays["global_orient"] = arrays["global_orient"][:, None].astype(np.float32)
    table = read(tmp_path, {**arrays, "fps": np.array([50])})
    check_movement_roughly(table)
    assert not table.quality.warnings


def check_movement_roughly(table: reba.PostureTable) -> None:
    """Single precision gives a hundred thousandth of a radian; what never moves counts as not measured."""
    assert not set(table.unmeasured) & set(moving_postures()[1])
    for column in reba.COLUMNS:
        if column in table.unmeasured:
            continue
        expected = [posture.get(column, 0.0) for posture in moving_postures()]
        np.testing.assert_allclose(table.data[column], expected, atol=1e-3, err_msg=column)


def test_the_vertical_of_a_camera_follows_from_the_body(tmp_path: Path) -> None:
    table = read(tmp_path, {**library(CAMERA), "fps": np.array(30.0)})
    check_movement(table)
    (warning,) = table.quality.warnings
    says(warning, "vertical is -y by the body", "camera is taken as level")
    # A rate of AMASS, turned to y up by another tool.
    table = read(tmp_path, {**library(), "mocap_framerate": np.array(30.0)})
    check_movement(table)
    says(table.quality.warnings[0], "vertical is y by the body", "AMASS has z")


def test_the_rate_of_an_archive_without_one(tmp_path: Path) -> None:
    with pytest.raises(reba.ReadError) as caught:
        read(tmp_path, library())
    says(caught, "no frame rate", "--rate 30")
    table = read(tmp_path, library(), rate=30.0)
    np.testing.assert_allclose(np.diff(table.data["time"]), 1 / 30.0)
    with pytest.raises(reba.ReadError) as caught:
        read(tmp_path, {**library(), "fps": np.array(25.0)}, rate=30.0)
    says(caught, "in fps", "leave the rate out")


def test_gaps_and_damaged_rotations_are_gaps(tmp_path: Path) -> None:
    arrays = amass()
    arrays["poses"][5, 3 * 18 : 3 * 18 + 3] = np.nan
    arrays["poses"][6, 3 * 18] = 1e6
    table = read(tmp_path, arrays)
    assert np.flatnonzero(table.data["lower_arm_flexion_left"].isna()).tolist() == [5, 6]
    assert not table.data["lower_arm_flexion_right"].isna().any()
    says(table.quality.warnings[0], "2 rotations", "gaps")


class Harmful:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return print, ("unpickled",)


@pytest.mark.parametrize(
    ("arrays", "what"),
    [
        ({"poses": np.array([Harmful()], dtype=object)}, "poses is stored as objects | pickle | as numbers"),
        ({"markers": np.zeros((4, 3))}, "no body pose | 'markers' | body_pose"),
        ({"poses": np.zeros((4, 60))}, "poses has shape (4, 60) | 66 or more"),
        ({"poses": np.zeros((3, 4, 72))}, "3 people"),
        (
            {"global_orient": np.zeros((4, 3, 3)), "body_pose": np.zeros((4, 63))},
            "rotation matrices | axis times angle",
        ),
        ({"global_orient": np.zeros((4, 1, 3, 3)), "body_pose": np.zeros((4, 23, 3, 3))}, "(4, 23, 3, 3) | axis times"),
        ({"global_orient": np.zeros((5, 3)), "body_pose": np.zeros((4, 63))}, "5 frames and body_pose 4"),
        ({"poses": np.zeros((0, 72))}, "no frame"),
    ],
)
def test_what_cannot_be_read_says_what_to_do(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], arrays: dict[str, np.ndarray], what: str
) -> None:
    with pytest.raises(reba.ReadError) as caught:
        read(tmp_path, {**arrays, "fps": np.array(30.0)})
    says(caught, *what.split(" | "))
    assert "unpickled" not in capfd.readouterr().out


def test_wrong_rates(tmp_path: Path) -> None:
    for rate in (0.0, -3.0, np.nan, np.inf):
        with pytest.raises(reba.ReadError) as caught:
            read(tmp_path, {**library(), "fps": np.array(rate)})
        says(caught, "fps is", "a rate in Hz")


def archive(folder: Path, members: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> Path:
    path = folder / "walk.npz"
    with zipfile.ZipFile(path, "w", method) as file:
        for name, data in members.items():
            file.writestr(name, data)
    return path


def test_bombs_lies_and_pickles_are_refused(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    np.save(buffer, np.zeros((20, 72)))
    data = buffer.getvalue()
    huge = data.replace(b"(20, 72)", b"(99999999999, 72)").replace(b"72), }" + b" " * 9, b"72), }")
    for members, what in (
        ({"poses.npy": data + bytes(1 << 26)}, "unpacked, which no recording"),
        ({"poses.npy": data[:-8]}, "bytes, not those of shape"),
        ({"poses.npy": huge}, "bytes, not those of shape"),
        ({"poses.npy": b"\x93NUMPY\x01\x00\x05\x00{a:1}"}, "damaged header"),
        ({"poses.npy": pickle.dumps([1])}, "damaged header"),
        ({f"{at}.npy": b"" for at in range(10_001)}, "10001 parts"),
    ):
        with pytest.raises(reba.ReadError) as caught:
            reba.read(archive(tmp_path, members), rate=30.0)
        says(caught, what, "; ")


def test_cut_anywhere(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "whole.npz", **amass())  # type: ignore[arg-type]
    data = (tmp_path / "whole.npz").read_bytes()
    for cut in range(1, len(data) - 1, 997):
        path = tmp_path / "walk.npz"
        path.write_bytes(data[:cut])
        with pytest.raises(reba.ReadError):
            reba.read(path)


def encoded(kind: str) -> np.ndarray:
    """Return the rotations (n, 24, k) of a movement in another encoding than axis times angle."""
    turns = np.concatenate([smpl_pose(moving_postures(), Z_UP), np.full((N, 6), 0.1)], axis=1).reshape(-1, 3)
    rotation = Rotation.from_rotvec(turns)
    values = {
        "rotation matrices": lambda: rotation.as_matrix(),
        "quaternions": lambda: rotation.as_quat(),
        "two columns of rotation matrices": lambda: rotation.as_matrix()[:, :, :2],
        "columns after each other": lambda: rotation.as_matrix()[:, :, :2].transpose(0, 2, 1),
        "degrees": lambda: np.degrees(turns),
        "degrees of an arm": lambda: np.degrees(turns) * (np.arange(len(turns)) % 24 == 16)[:, None],
    }[kind]()
    return values.reshape(N, 24, -1)


@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize(
    ("kind", "word"),
    [
        ("rotation matrices", "rotation matrices"),
        ("quaternions", "quaternions"),
        ("two columns of rotation matrices", "6 numbers"),
        ("columns after each other", "6 numbers"),
        ("degrees", "degrees"),
        ("degrees of an arm", "degrees"),
    ],
)
def test_other_encodings_of_rotations_are_named(tmp_path: Path, kind: str, word: str, flat: bool) -> None:
    poses = encoded(kind)
    with pytest.raises(reba.RebaError) as caught:
        read(tmp_path, {"poses": poses.reshape(N, -1) if flat else poses, "mocap_framerate": np.array(120.0)})
    says(caught, word, "axis times angle")
