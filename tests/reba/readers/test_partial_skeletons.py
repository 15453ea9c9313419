"""Skeletons as pose estimators and marker sets name them, whole and in part: what is absent is unmeasured, no more."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from numpy.typing import NDArray

from reba.errors import ProfileError
from reba.posture.columns import COLUMNS, SIDES
from reba.posture.table import PostureTable
from reba.readers.mapping.segments import AXES
from reba.readers.recognise import choose
from reba.readers.recording.profile import find_profile, parse_profile, profiles
from reba.readers.signal_names import bodies
from tests.support.says import says
from tests.support.synthetic_bodies import (
    check_movement,
    moving_postures,
    read_stream,
    recording_of,
    segment_poses,
    stream_of,
)

Array = NDArray[np.float64]
Points = dict[str, Array]


def _person() -> Points:
    """Return the points of a moving person (n, 3) [m], z up, named as in COCO, and markers on trunk and pelvis."""
    names, poses = segment_poses(moving_postures(), AXES["ros"])
    at = {name: poses[:, index, :3] for index, name in enumerate(names)}
    pelvis, thorax, head = (_axes(poses[:, names.index(name), 3:]) for name in ("pelvis", "thorax", "head"))
    points: Points = {}
    for side, out in zip(SIDES, (-1.0, 1.0), strict=True):
        for name, joint in (("shoulder", "upper_arm"), ("elbow", "forearm"), ("wrist", "hand"), ("hip", "thigh")):
            points[f"{side}_{name}"] = at[f"{joint}_{side}"]
        points[f"{side}_knee"], points[f"{side}_ankle"] = at[f"shank_{side}"], at[f"foot_{side}"]
        points[f"{side}_heel"] = at[f"foot_{side}"] + [-0.05, 0.0, -0.05]
        points[f"{side}_toe"] = at[f"foot_{side}"] + [0.15, 0.0, -0.05]
        for name, place in (("asis", (0.08, 0.09, 0.12)), ("psis", (-0.12, 0.09, 0.05))):
            points[f"{side}_{name}"] = at["pelvis"] + pelvis @ [place[0], place[1], place[2] * out]
    middle = (points["left_shoulder"] + points["right_shoulder"]) / 2.0
    for side, out in zip(SIDES, (-1.0, 1.0), strict=True):
        points[f"{side}_ear"] = middle + head @ [0.0, 0.2, 0.08 * out]
        points[f"{side}_front"] = middle + head @ [0.1, 0.25, 0.07 * out]
        points[f"{side}_back"] = middle + head @ [-0.1, 0.25, 0.07 * out]
    points["nose"] = middle + head @ [0.1, 0.2, 0.0]
    points["neck"] = middle + thorax @ [0.0, 0.03, 0.0]
    for name, place in {
        "c7": (-0.06, 0.04),
        "notch": (0.06, 0.0),
        "t8": (-0.06, -0.25),
        "xiphoid": (0.06, -0.2),
    }.items():
        points[name] = middle + thorax @ [*place, 0.0]
    # Points without noise would look unmeasured.
    noise = np.random.default_rng(1)
    return {name: at + noise.normal(scale=3e-9, size=at.shape) for name, at in points.items()}


def _axes(quaternions: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(quaternions).as_matrix() @ AXES["ros"]


PERSON = _person()
JOINTS = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
POSE2SIM = {f"{side}_{part}": f"{side[0].upper()}{part.title()}" for side in SIDES for part in JOINTS}
FEET = {
    f"{side}_{part}": f"{side[0].upper()}{name}"
    for side in SIDES
    for part, name in (("toe", "BigToe"), ("heel", "Heel"))
}
EARS = {f"{side}_ear": f"{side[0].upper()}Ear" for side in SIDES}
COCO = {f"{side}_{part}": f"{side}_{part}" for side in SIDES for part in (*JOINTS, "ear")} | {"nose": "nose"}
SHORT = {f"{side}_{part}": f"{side[0].upper()}{part[:3].title()}" for side in SIDES for part in (*JOINTS, "ear")}
# skeleton -> profile, point of the person -> its name; Pose2Sim computes Hip and Neck where the model has none.
SKELETONS: dict[str, tuple[str, dict[str, str]]] = {
    "Pose2Sim HALPE_26": ("keypoints_openpose", POSE2SIM | FEET | EARS | {"neck": "Neck", "nose": "Nose"}),
    "Pose2Sim COCO_17": ("keypoints_openpose", POSE2SIM | {"nose": "Nose"}),
    "Pose2Sim COCO_133": ("keypoints_openpose", POSE2SIM | FEET | EARS | {"nose": "Nose"}),
    "Pose2Sim BLAZEPOSE": ("keypoints_openpose", POSE2SIM | FEET | {"left_knee": "Lknee", "nose": "Nose"}),
    "BODY_25": ("keypoints_body25", SHORT | FEET | {"neck": "Neck", "nose": "Nose"}),
    "COCO-17": ("keypoints_coco", COCO),
    "MediaPipe": ("keypoints_coco", COCO | {f"{side}_toe": f"{side}_foot_index" for side in SIDES}),
    "MediaPipe, names of the enumeration": ("keypoints_coco", {name: word.upper() for name, word in COCO.items()}),
    "MoveNet": ("keypoints_coco", {name: word.title().replace("_", "") for name, word in COCO.items()}),
    "YOLO": ("keypoints_coco", {name: word.replace("_", " ") for name, word in COCO.items()}),
    "FreeMoCap 1": ("keypoints_coco", {name: f"body_{word}" for name, word in COCO.items()}),
    "FreeMoCap 2": ("keypoints_coco", COCO | {f"{side}_toe": f"{side}_big_toe" for side in SIDES}),
}  # fmt: skip
PLUG_IN_GAIT = {
    **{f"{side}_{part}": f"{side[0].upper()}{word}" for side in SIDES for part, word in (
        ("asis", "ASI"), ("psis", "PSI"), ("shoulder", "SHO"), ("elbow", "ELB"), ("wrist", "WRA"), ("knee", "KNE"),
        ("ankle", "ANK"), ("toe", "TOE"), ("heel", "HEE"), ("front", "FHD"), ("back", "BHD"))},
    "c7": "C7", "t8": "T10", "notch": "CLAV", "xiphoid": "STRN",
}  # fmt: skip


def _read(names: dict[str, str], leave: Iterable[str] = ()) -> PostureTable:
    chosen = {word: PERSON[name] for name, word in names.items() if name not in set(leave)}
    return read_stream(stream_of("s", "points", tuple(chosen), np.stack(list(chosen.values()), axis=1)))


def _measured(table: PostureTable) -> set[str]:
    return set(COLUMNS) - set(table.unmeasured)


def _of(*parts: str) -> set[str]:
    return {column for column in COLUMNS if column.startswith(parts)}


UPPER = _of("trunk", "neck", "upper_arm", "lower_arm")
BODY = (UPPER | _of("knee")) - _of("neck")


@pytest.mark.parametrize("skeleton", SKELETONS)
def test_skeletons_are_known_by_the_names_of_their_tools(skeleton: str) -> None:
    profile, names = SKELETONS[skeleton]
    table = _read(names)
    assert table.profile == profile
    head = _of("neck") if "left_ear" in names else set()
    assert _measured(table) == BODY | head
    check_movement(table, leave=("neck_flexion", "neck_side_bend", "neck_twist"))


@pytest.mark.parametrize("skeleton", SKELETONS)
@pytest.mark.parametrize(
    ("leave", "lost"),
    [
        (("left_elbow", "right_elbow"), _of("upper_arm", "lower_arm")),
        (("left_wrist", "right_wrist"), _of("lower_arm")),
        (("neck", "left_ear", "right_ear", "nose"), _of("neck")),
        (("left_knee", "right_knee", "left_ankle", "right_ankle", "left_toe", "right_toe"), _of("knee")),
        (("left_elbow",), {column for column in _of("upper_arm", "lower_arm") if column.endswith("left")}),
        (("right_knee",), {"knee_flexion_right"}),
        (("left_shoulder", "right_shoulder"), UPPER),
        (("left_hip", "right_hip"), _of("trunk", "neck", "knee", "upper_arm")),
        ([name for name in PERSON if name.startswith("left")], UPPER | _of("knee_flexion_left")),
        ([name for name in PERSON if name.startswith("right")], UPPER | _of("knee_flexion_right")),
    ],
)
def test_absent_keypoints_leave_only_their_own_columns_unmeasured(
    skeleton: str, leave: Iterable[str], lost: set[str]
) -> None:
    profile, names = SKELETONS[skeleton]
    whole, part = _read(names), _read(names, leave)
    assert part.profile == profile
    elbows = {
        f"lower_arm_flexion_{side}" for side in SIDES if not {f"{side}_{name}" for name in JOINTS[3:]} & set(leave)
    }
    left_over = _measured(whole) - (lost - elbows)
    assert _measured(part) == left_over
    for column in left_over:
        np.testing.assert_allclose(part.data[column], whole.data[column], atol=1e-9, err_msg=column)


@pytest.mark.parametrize(
    ("leave", "lost"),
    [
        (("left_front", "right_front", "left_back", "right_back"), _of("neck")),
        (("left_elbow", "right_elbow", "left_wrist", "right_wrist"), _of("upper_arm", "lower_arm")),
        (("left_elbow", "left_wrist"), {column for column in _of("upper_arm", "lower_arm") if column.endswith("left")}),
        (("right_knee", "right_ankle"), {"knee_flexion_right"}),
        (("c7", "t8", "notch", "xiphoid", *(f"{side}_{name}" for side in SIDES for name in ("front", "back"))),
         _of("neck")),
        (("c7", "t8", "notch", "xiphoid", *(f"{side}_{name}" for side in SIDES for name in ("shoulder", "front"))),
         _of("trunk", "neck", "upper_arm", "lower_arm")),
    ],
)  # fmt: skip
def test_plug_in_gait_without_some_markers(leave: Iterable[str], lost: set[str]) -> None:
    whole, part = _read(PLUG_IN_GAIT), _read(PLUG_IN_GAIT, leave)
    assert whole.profile == part.profile == "markers_plug_in_gait"
    assert _measured(part) == _measured(whole) - lost
    for column in _measured(part):
        np.testing.assert_allclose(part.data[column], whole.data[column], atol=1e-9, err_msg=column)


def test_a_second_person_seen_in_part_is_a_question() -> None:
    whole = {f"P1_{word}": PERSON[name] for name, word in COCO.items()}
    part = {f"P2_{word}": PERSON[name] + [0.0, 2.0, 0.0] for name, word in list(COCO.items())[:8]}
    both = whole | part
    with pytest.raises(ProfileError) as caught:
        read_stream(stream_of("s", "points", tuple(both), np.stack(list(both.values()), axis=1)))
    says(caught, "2 bodies", "P1, P2", "--topic P1")


def test_absent_points_are_named() -> None:
    table = _read(
        PLUG_IN_GAIT, ("left_elbow", "left_wrist", *(f"{side}_{name}" for side in SIDES for name in ("front", "back")))
    )
    says(table.why_unmeasured["lower_arm_flexion_left"], "no point elbow_left and wrist_left")
    says(table.why_unmeasured["neck_flexion"], "no point on the head")
    says(_read(POSE2SIM).why_unmeasured["shoulder_elevation_right"], "no point on the neck")
    says(_read(POSE2SIM, ("right_knee",)).why_unmeasured["knee_flexion_right"], "no point knee_right")


def test_one_marker_on_the_sacrum_stands_for_two() -> None:
    sacrum = (PERSON["left_psis"] + PERSON["right_psis"]) / 2.0
    chosen = {word: PERSON[name] for name, word in PLUG_IN_GAIT.items() if "psis" not in name} | {"SACR": sacrum}
    table = read_stream(stream_of("s", "points", tuple(chosen), np.stack(list(chosen.values()), axis=1)))
    np.testing.assert_allclose(table.data[list(COLUMNS)], _read(PLUG_IN_GAIT).data[list(COLUMNS)], atol=1e-9)


def test_of_two_sets_of_points_the_one_that_explains_most_is_taken_and_said() -> None:
    video = POSE2SIM | FEET
    both = {word: PERSON[name] for name, word in PLUG_IN_GAIT.items()} | {
        word: PERSON[name] for name, word in video.items()
    }
    table = read_stream(stream_of("s", "points", tuple(both), np.stack(list(both.values()), axis=1)))
    assert table.profile == "markers_plug_in_gait"
    says(
        next(text for text in table.assumed if "both fit" in text),
        *("markers_plug_in_gait", "keypoints_openpose", f"{len(PLUG_IN_GAIT)} of {len(both)} points", len(video)),
    )
    few = {word: both[word] for word in both if word not in ("C7", "T10", "CLAV", "STRN") and not word.endswith("HD")}
    few = {word: at for word, at in few.items() if word not in ("LELB", "RELB", "LWRA", "RWRA", "LTOE", "RTOE")}
    table = read_stream(stream_of("s", "points", tuple(few), np.stack(list(few.values()), axis=1)))
    assert table.profile == "keypoints_openpose"


@pytest.mark.parametrize(
    "names",
    [
        ("Probe1", "Probe2", "Probe3", "Probe4"),
        ("Neck", "Nose", "LHip", "RHip", "LEar"),
        ("left_hip", "nose", "right_ear", "left_wrist", "trolley"),
        ("C7", "T10", "LFHD", "RFHD", "BOX1"),
    ],
)
def test_points_that_give_no_angle_are_no_skeleton(names: tuple[str, ...]) -> None:
    stream = stream_of("s", "points", names, np.random.default_rng(0).normal(size=(5, len(names), 3)))
    with pytest.raises(ProfileError) as caught:
        choose(recording_of(stream), profiles())
    says(caught, "no profile fits", names[0])


def test_names_of_a_profile_that_differ_in_case_stay_apart() -> None:
    mine = parse_profile(
        {"name": "a", "title": "b", "source": "c", "kind": "points", "points": {"neck": "n", "head": "N"}}, "mine.toml"
    )
    assert bodies(mine, stream_of("s", "points", ("N", "n"), np.zeros((1, 2, 3))))[""] == {"N": "N", "n": "n"}


def test_the_exact_spelling_comes_first() -> None:
    stream = stream_of("s", "points", ("LEFT_HIP", "left_hip", "leftHip"), np.zeros((1, 3, 3)))
    assert bodies(find_profile("keypoints_coco"), stream)[""]["left_hip"] == "left_hip"
    folded = [[name.lower().replace("_", "") for name in known.names] for known in profiles() if known.kind == "points"]
    assert all(len(set(names)) == len(names) for names in folded)
