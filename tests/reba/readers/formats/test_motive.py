"""Exports of OptiTrack Motive: known postures as bones and as markers come back, whatever the export options."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import reba
from reba.readers.formats import open_recording
from reba.readers.formats.motive_bones import parents_of
from tests.support.motive_csv import FBX_NAMES, NAMES, motive_csv
from tests.support.says import says
from tests.support.synthetic_bodies import moving_postures
from tests.support.t_pose_bodies import PARENTS, t_pose_bodies


def poses(skeleton: str = "Bob", names: dict[str, str] = NAMES) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    bodies = t_pose_bodies(moving_postures(), heading=30.0)
    return {f"{skeleton}:{names[bone]}": pose for bone, pose in bodies.items()}


def read(folder: Path, text: str, **options: object) -> reba.PostureTable:
    path = folder / "walk.csv"
    path.write_text(text, newline="")
    return reba.read(path, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("version", ["1.21", "1.23", "1.24", "1.25"])
@pytest.mark.parametrize("unit", ["Millimeters", "Meters", "Centimeters"])
def test_bones_of_every_version_and_unit(tmp_path: Path, version: str, unit: str) -> None:
    table = read(tmp_path, motive_csv(poses(), version=version, unit=unit, timecode=version == "1.24"))
    assert (table.profile, len(table.data), table.unmeasured) == ("motive", 80, ())
    np.testing.assert_allclose(table.data["time"], np.arange(80) / 100.0)
    check(table)


def check(table: reba.PostureTable) -> None:
    """The file has six decimals: millimetres and quaternions to a millionth give a thousandth of a degree."""
    for column in reba.COLUMNS:
        expected = [posture.get(column, 0.0) for posture in moving_postures()]
        np.testing.assert_allclose(table.data[column], expected, atol=2e-3, err_msg=column)


def test_an_export_that_a_spreadsheet_saved_again(tmp_path: Path) -> None:
    text = motive_csv(poses()).split("\r\n")
    rows = [
        line.replace(",", ";").replace(".", ",") if at > 7 else line.replace(",", ";") for at, line in enumerate(text)
    ]
    check(read(tmp_path, "\r\n".join(rows)))


@pytest.mark.parametrize("order", ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"])
def test_euler_angles_of_every_order(tmp_path: Path, order: str) -> None:
    check(read(tmp_path, motive_csv(poses(), rotation=order)))


def test_euler_angles_about_fixed_axes_are_found_by_the_length_of_bones(tmp_path: Path) -> None:
    text = motive_csv(poses(), rotation="ZYX").replace("Rotation Type,ZYX", "Rotation Type,XYZ")
    table = read(tmp_path, text)
    check(table)
    assert any("about axes that stay" in warning for warning in table.quality.warnings)


def test_poses_in_the_parent_bone(tmp_path: Path) -> None:
    bodies = t_pose_bodies(moving_postures())
    local = {}
    for bone, (turn, place) in bodies.items():
        if bone in PARENTS:
            above, origin = bodies[PARENTS[bone]]
            turn, place = np.swapaxes(above, 1, 2) @ turn, np.einsum("nji,nj->ni", above, place - origin)
        local[f"Bob:{NAMES[bone]}"] = (turn, place)
    check(read(tmp_path, motive_csv(local, space="Local")))


def test_the_hip_with_the_name_of_the_skeleton_and_fbx_names(tmp_path: Path) -> None:
    named = {label.replace(":Hip", ":Bob"): pose for label, pose in poses().items()}
    check(read(tmp_path, motive_csv(named)))
    table = read(tmp_path, motive_csv(poses("Ann", FBX_NAMES)))
    assert table.profile == "bvh_motionbuilder"
    check(table)
    named = {label.replace(":Hips", ":Ann"): pose for label, pose in poses("Ann", FBX_NAMES).items()}
    check(read(tmp_path, motive_csv(named)))


def test_an_export_with_z_up(tmp_path: Path) -> None:
    z_up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    turned = {label: (z_up @ turn @ z_up.T, place @ z_up.T) for label, (turn, place) in poses().items()}
    table = read(tmp_path, motive_csv(turned))
    check(table)
    assert any("vertical is z by the body" in warning for warning in table.quality.warnings)


def test_gaps_stay_gaps(tmp_path: Path) -> None:
    gapped = poses()
    gapped["Bob:LFArm"][1][10:20] = np.nan
    lines = motive_csv(gapped).split("\r\n")
    table = read(tmp_path, "\r\n".join(lines))
    open_frames = table.data["lower_arm_flexion_left"].isna().to_numpy()
    assert open_frames[10:20].all()
    assert open_frames.sum() == 10
    assert not table.data["lower_arm_flexion_right"].isna().any()


def test_two_skeletons_are_a_question(tmp_path: Path) -> None:
    text = motive_csv({**poses("Bob"), **poses("Ann")})
    with pytest.raises(reba.ProfileError) as caught:
        read(tmp_path, text)
    says(caught, "Bob bones", "Ann bones", "--topic")
    check(read(tmp_path, text, topic="Ann bones"))


BASELINE = {
    "WaistLFront": [0.12, 1.0, 0.1], "WaistRFront": [-0.12, 1.0, 0.1],
    "WaistLBack": [0.08, 1.02, -0.1], "WaistRBack": [-0.08, 1.02, -0.1],
    "BackTop": [0.0, 1.45, -0.06], "Chest": [0.0, 1.38, 0.1], "HeadTop": [0.0, 1.8, 0.0],
    **{
        f"{'L' if out > 0 else 'R'}{name}": [out * x, y, z]
        for out in (1, -1)
        for name, (x, y, z) in {
            "ShoulderTop": (0.18, 1.45, 0.0), "ElbowOut": (0.18, 1.15, 0.0), "WristOut": (0.18, 0.9, 0.03),
            "WristIn": (0.18, 0.9, -0.03), "KneeOut": (0.1, 0.5, 0.0), "AnkleOut": (0.1, 0.08, 0.0),
            "ToeIn": (0.07, 0.03, 0.15), "ToeOut": (0.12, 0.03, 0.13), "Heel": (0.09, 0.04, -0.08),
        }.items()
    },
}  # fmt: skip
"""A standing person with markers of the set Baseline [m]: x left, y up, z forward."""


def standing(markers: dict[str, list[float]], n: int = 20) -> dict[str, np.ndarray]:
    return {f"Bob:{name}": np.tile(np.array(place, dtype=float), (n, 1)) for name, place in markers.items()}


def test_markers_of_the_set_baseline(tmp_path: Path) -> None:
    markers = standing(BASELINE)
    # The right forearm is lifted by 90 degrees, forward.
    for name, z in (("RWristOut", 0.28), ("RWristIn", 0.28)):
        markers[f"Bob:{name}"][:] = [-0.18 + (0.03 if name.endswith("In") else -0.03), 1.15, z]
    table = read(tmp_path, motive_csv(points=markers))
    assert table.profile == "markers_motive"
    assert table.topic == "walk"
    np.testing.assert_allclose(table.data["lower_arm_flexion_right"], 90.0, atol=0.1)
    np.testing.assert_allclose(table.data["lower_arm_flexion_left"], 0.0, atol=0.1)
    np.testing.assert_allclose(table.data["knee_flexion_left"], 0.0, atol=8.0)
    np.testing.assert_allclose(table.data["trunk_flexion"], 0.0, atol=5.0)


def test_measured_markers_before_solved_ones_and_unlabelled_ones_are_listed(tmp_path: Path) -> None:
    measured = standing(BASELINE)
    solved = {label: place + 0.5 for label, place in measured.items()}
    text = motive_csv(points=solved, point_type="Bone Marker")
    other = motive_csv(points={**measured, "Unlabeled 1000": np.zeros((20, 3))})
    both = [
        f"{a},{b.split(',', 2)[2]}" if at > 1 else b
        for at, (a, b) in enumerate(zip(text.split("\r\n")[:-1], other.split("\r\n")[:-1], strict=True))
    ]
    (tmp_path / "walk.csv").write_text("\r\n".join(both) + "\r\n", newline="")
    recording = open_recording(tmp_path / "walk.csv")
    (block,) = recording.streams[0].blocks()
    np.testing.assert_allclose(block.values[0, block.names.index("HeadTop")], BASELINE["HeadTop"])
    listed = {topic.name: topic.why for topic in recording.topics}
    says(listed["unlabeled markers"], "1 without a label")
    says(listed["solved markers"], len(BASELINE), "also measured")
    # Alone, the solved ones are read.
    (tmp_path / "walk.csv").write_text(text, newline="")
    assert open_recording(tmp_path / "walk.csv").streams[0].names == block.names


def test_rigid_bodies_are_frames_for_a_profile_of_the_user(tmp_path: Path) -> None:
    bodies = t_pose_bodies(moving_postures())
    (tmp_path / "walk.csv").write_text(
        motive_csv({"Back": bodies["thorax"], "Hips": bodies["pelvis"]}, pose_type="Rigid Body")
    )
    (stream,) = open_recording(tmp_path / "walk.csv").streams
    assert (stream.name, stream.kind, stream.names) == ("walk rigid bodies", "frames", ("Back", "Hips"))


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("Millimeters", "Pixels", "line 1, Length Units: unit 'Pixels' is unknown"),
        ("Frame,Time (Seconds)", "Index,When", "no line with 'Frame' and 'Time' | with its header"),
        ("Bone", "Device", "neither skeleton bones | Markers and Skeleton Bones"),
        ("\r\n3,0.030000,", "\r\n3,0.030000,x", "is not a number"),
    ],
)
def test_damage_is_told(tmp_path: Path, old: str, new: str, what: str) -> None:
    text = motive_csv(poses())
    assert old in text
    with pytest.raises(reba.ReadError) as caught:
        read(tmp_path, text.replace(old, new))
    says(caught, *what.split(" | "))


def test_an_unknown_rotation_type_is_told(tmp_path: Path) -> None:
    with pytest.raises(reba.ReadError) as caught:
        read(tmp_path, motive_csv(poses(), rotation="XYZ").replace("Type,XYZ", "Type,Matrix"))
    says(caught, "Rotation Type is 'Matrix'", "with quaternions")


def test_truncated_and_frames_that_are_missing(tmp_path: Path) -> None:
    text = motive_csv(poses())
    table = read(tmp_path, text[:-300])
    assert len(table.data) == 79
    assert table.quality.ended_abnormally is not None
    assert any("states 80 frames and the file has 79" in warning for warning in table.quality.warnings)


def test_bones_without_places_are_refused(tmp_path: Path) -> None:
    with pytest.raises(reba.ProfileError) as caught:
        read(tmp_path, motive_csv({label: (turn, place * 0.0) for label, (turn, place) in poses().items()}))
    says(caught, "at one place in the rest pose", "places of the bones")


def test_bones_above() -> None:
    assert parents_of(["Hip", "Ab", "Chest", "Neck", "Neck2", "Head"])["Head"] == "Neck2"
    assert parents_of(["Hips", "Spine", "Spine1", "LeftShoulder"])["LeftShoulder"] == "Spine1"
    assert parents_of(["Chest", "LUArm"]) == {}


def test_markers_of_the_set_biomech(tmp_path: Path) -> None:
    markers = {
        "SJN": [0.0, 1.42, 0.08], "SXS": [0.0, 1.22, 0.1], "CV7": [0.0, 1.48, -0.06], "TV7": [0.0, 1.28, -0.1],
        **{
            f"{'L' if out > 0 else 'R'}{name}": [out * x, y, z]
            for out in (1, -1)
            for name, (x, y, z) in {
                "IAS": (0.12, 1.0, 0.1), "IPS": (0.04, 1.02, -0.1), "CAJ": (0.18, 1.45, 0.0), "HLE": (0.18, 1.15, 0.0),
                "RSP": (0.18, 0.9, 0.03), "USP": (0.18, 0.9, -0.03), "HM2": (0.18, 0.82, 0.0), "FLE": (0.1, 0.5, 0.0),
                "FAL": (0.1, 0.08, 0.0), "AH": (0.07, 1.7, 0.1), "PH": (0.07, 1.7, -0.08), "FM1": (0.07, 0.03, 0.15),
                "FM5": (0.12, 0.03, 0.13), "FCC": (0.09, 0.04, -0.08),
            }.items()
        },
    }  # fmt: skip
    table = read(tmp_path, motive_csv(points=standing(markers)), neutral="first:0.1s")
    assert table.profile == "markers_motive_biomech"
    for column in ("trunk_flexion", "neck_flexion", "upper_arm_flexion_left", "wrist_flexion_right"):
        np.testing.assert_allclose(table.data[column], 0.0, atol=1e-6, err_msg=column)
    assert set(table.unmeasured) == {"wrist_twist_left", "wrist_twist_right"}
