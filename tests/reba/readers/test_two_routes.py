"""Two routes to one angle in one recording, column by column: joint angles and segments, coordinates and markers.

Every column is compared, or it stands in a list with the reason why one route lacks it.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from reba.posture.columns import COLUMNS
from reba.posture.table import PostureTable
from reba.readers import read
from tests.support.body_motion import PARENTS, SEGMENTS, BodyMotion
from tests.support.joint_angles import STAND_UP, human_urdf_angles
from tests.support.mvn_angles import driver_joint_states, made_up_motion, mvn_joint_angles, mvn_orientations
from tests.support.mvnx_text import JOINTS, mvnx_text
from tests.support.paths import DATASETS, RECORDINGS
from tests.support.urdf_chain import human_urdf, read_joints

sys.path.insert(0, str(DATASETS))
from ros2_bag import Ros2Bag
from ros2_messages import NANOSECONDS, Transform

Array = NDArray[np.float64]
FINE = 0.01
"""[deg] Agreement of two routes that state the same: what the digits of a file leave."""


def columns_of(*parts: str) -> list[str]:
    """Return the columns that begin with one of the parts."""
    return [column for column in COLUMNS if column.startswith(parts)]


def check_agreement(
    first: PostureTable, second: PostureTable, lacking: Mapping[str, str], differing: Sequence[str] = ()
) -> None:
    """Assert that two tables agree to `FINE` in every column.

    Args:
        lacking: column that not both have -> what one that lacks it says of it.
        differing: columns that the two define otherwise; they must differ.
    """
    assert len(first.data) == len(second.data) > 50
    for column in COLUMNS:
        without = [table for table in (first, second) if column in table.unmeasured]
        if column in lacking:
            assert without, f"{column} is measured by both"
            reasons = [table.why_unmeasured[column] for table in without]
            assert any(lacking[column] in reason for reason in reasons), (column, reasons)
            continue
        assert not without, (column, [table.why_unmeasured[column] for table in without])
        if column in differing:
            assert np.max(np.abs(first.data[column] - second.data[column])) > FINE, column
            continue
        np.testing.assert_allclose(first.data[column], second.data[column], atol=FINE, err_msg=column)


@pytest.fixture(scope="module")
def motion() -> BodyMotion:
    return made_up_motion()


def _mvnx(folder: Path, motion: BodyMotion) -> tuple[PostureTable, PostureTable]:
    """Return the postures of a MVNX file by its segments and by its joint angles."""
    angles = mvn_joint_angles(motion)
    path = folder / "lift.mvnx"
    triples = np.stack([angles[joint] for joint in JOINTS], axis=1)
    path.write_text(mvnx_text(mvn_orientations(motion), motion.position, triples, np.zeros((len(triples), 6, 3))))
    segments, joints = read(path, topic="segments"), read(path, topic="jointAngle")
    assert (segments.profile, joints.profile) == ("mvnx", "mvnx_joints")
    return segments, joints


def test_mvnx_joint_angles_and_segments(motion: BodyMotion, tmp_path: Path) -> None:
    segments, joints = _mvnx(tmp_path, motion)
    assert segments.unmeasured == joints.unmeasured == ()
    check_agreement(segments, joints, {})


def test_mvnx_of_a_rounded_back_differs_in_the_trunk_alone(tmp_path: Path) -> None:
    segments, joints = _mvnx(tmp_path, made_up_motion(ahead=0.1))
    # Segments know the line from the hips to the shoulders, joint angles the chest: the trunk and the arms against it.
    assert "trunk by the lines between hips and shoulders, not by the chest" in segments.assumed
    check_agreement(segments, joints, {}, columns_of("trunk", "upper_arm_flexion"))


def test_mcap_joint_states_and_transforms_of_the_xsens_driver(motion: BodyMotion, tmp_path: Path) -> None:
    states = driver_joint_states(mvn_joint_angles(motion))
    path = tmp_path / "lift.mcap"
    with Ros2Bag(path, "test") as bag:
        for index, stamp in enumerate(_stamps(motion)):
            names = [f"skeleton_{name}" for name in states]
            bag.joints("/joint_states", stamp, names, [values[index] for values in states.values()])
            for name in SEGMENTS.values():
                turn, place = (
                    motion.relative(name, PARENTS[name]) if name in PARENTS else (motion.of(name), motion.at(name))
                )
                parent = f"skeleton_{PARENTS[name]}" if name in PARENTS else "world"
                bag.transforms("/tf", stamp, [Transform(parent, f"skeleton_{name}", _pose(turn[index], place[index]))])
    frames, joints = read(path, topic="/tf"), read(path, topic="/joint_states")
    assert (frames.profile, joints.profile) == ("xsens_frames", "xsens_joints")
    check_agreement(frames, joints, {})


def test_mcap_joint_states_and_transforms_of_human_urdf(motion: BodyMotion, tmp_path: Path) -> None:
    urdf = human_urdf()
    if urdf is None:
        pytest.skip("example-robot-data with human.urdf is not installed")
    states = human_urdf_angles(motion)
    path = tmp_path / "lift.mcap"
    pelvis = motion.of("pelvis") @ STAND_UP
    with Ros2Bag(path, "test") as bag:
        for index, stamp in enumerate(_stamps(motion)):
            bag.joints("/joint_states", stamp, list(states), [values[index] for values in states.values()])
            transforms = [Transform("map", "middle_pelvis", _pose(pelvis[index], motion.at("pelvis")[index]))]
            for joint in read_joints(urdf):
                turn = Rotation.from_rotvec(joint.axis * states[joint.name][index]).as_matrix()
                transforms.append(Transform(joint.parent, joint.child, _pose(turn, joint.origin)))
            bag.transforms("/tf", stamp, transforms)
    frames, joints = read(path, topic="/tf"), read(path, topic="/joint_states")
    assert (frames.profile, joints.profile) == ("human_frames", "human_description")
    check_agreement(frames, joints, {})


def _stamps(motion: BodyMotion) -> list[int]:
    return [1_700_000_000 * NANOSECONDS + round(float(time) * NANOSECONDS) for time in motion.time]


def _pose(turn: Array, place: Array) -> Array:
    return np.concatenate([place, Rotation.from_matrix(turn).as_quat()])


POINTS = {
    "r.ASIS_study": ("pelvis", (0.08, 0.09, 0.12)), "L.ASIS_study": ("pelvis", (0.08, 0.09, -0.12)),
    "r.PSIS_study": ("pelvis", (-0.12, 0.09, 0.05)), "L.PSIS_study": ("pelvis", (-0.12, 0.09, -0.05)),
    "RHJC_study": ("pelvis", (0.0, 0.0, 0.08)), "LHJC_study": ("pelvis", (0.0, 0.0, -0.08)),
    "C7_study": ("torso", (-0.06, 0.52, 0.0)),
    "r_shoulder_study": ("torso", (0.0, 0.5, 0.18)), "L_shoulder_study": ("torso", (0.0, 0.5, -0.18)),
    **{f"{side}_{a}elbow_study": (f"humerus_{side}", (0.0, -0.3, z * out)) for side, out in (("r", 1.0), ("L", -1.0))
       for a, z in (("l", 0.03), ("m", -0.03))},
    **{f"{side}_{a}wrist_study": (f"radius_{side}", (0.0, -0.26, z * out)) for side, out in (("r", 1.0), ("L", -1.0))
       for a, z in (("l", 0.03), ("m", -0.03))},
    **{f"{side}_{a}knee_study": (f"femur_{side}", (0.0, -0.42, z * out)) for side, out in (("r", 1.0), ("L", -1.0))
       for a, z in (("", 0.05), ("m", -0.05))},
    **{f"{side}_{a}ankle_study": (f"tibia_{side}", (0.0, -0.41, z * out)) for side, out in (("r", 1.0), ("L", -1.0))
       for a, z in (("", 0.03), ("m", -0.03))},
    **{f"{side}_calc_study": (f"tibia_{side}", (-0.05, -0.46, 0.0)) for side in ("r", "L")},
    **{f"{side}_toe_study": (f"tibia_{side}", (0.15, -0.46, 0.0)) for side in ("r", "L")},
}  # fmt: skip
"""Marker -> its body and its place there [m], as OpenCap names them on the model of Rajagopal et al. 2016."""


def _coordinates(time: Array) -> dict[str, Array]:
    """Return coordinate -> (n,) [deg], each at its own pace."""
    middle = {"pelvis_tilt": (-10, 8), "pelvis_list": (2, 6), "pelvis_rotation": (30, 15)}
    middle |= {"lumbar_extension": (-20, 18), "lumbar_bending": (3, 9), "lumbar_rotation": (-4, 12)}
    sided = {"hip_flexion": (20, 15), "hip_adduction": (-4, 5), "hip_rotation": (3, 6), "knee_angle": (40, 30)}
    sided |= {"arm_flex": (35, 30), "arm_add": (-20, 12), "arm_rot": (5, 15), "elbow_flex": (60, 40)}
    sided |= {"pro_sup": (80, 40)}
    ranges = middle | {f"{name}_{side}": size for name, size in sided.items() for side in "rl"}
    return {
        name: centre + half * np.sin((1.0 + 0.17 * number) * time + number)
        for number, (name, (centre, half)) in enumerate(ranges.items())
    }


def _bodies(q: dict[str, Array]) -> dict[str, tuple[Array, Array]]:
    """Return body -> (n, 3, 3) orientation and (n, 3) origin [m] of the model: x forward, y up, z right."""

    def turned(axes: str, *angles: Array) -> Array:
        return Rotation.from_euler(axes, np.stack(angles, axis=1), degrees=True).as_matrix()

    pelvis = turned("ZXY", *(q[f"pelvis_{name}"] for name in ("tilt", "list", "rotation")))
    origin = np.tile([0.2, 0.95, -0.1], (len(pelvis), 1))
    torso = pelvis @ turned("ZXY", *(q[f"lumbar_{name}"] for name in ("extension", "bending", "rotation")))
    bodies = {"pelvis": (pelvis, origin), "torso": (torso, origin)}
    for side, key, out in (("r", "r", 1.0), ("L", "l", -1.0)):  # axes x and y of the left side are negated
        arm = torso @ turned("ZXY", q[f"arm_flex_{key}"], out * q[f"arm_add_{key}"], out * q[f"arm_rot_{key}"])
        forearm = arm @ turned("Z", q[f"elbow_flex_{key}"]) @ turned("Y", out * q[f"pro_sup_{key}"])
        shoulder = origin + torso @ [0.0, 0.5, 0.18 * out]
        hip = origin + pelvis @ [0.0, 0.0, 0.08 * out]
        turns = (q[f"hip_flexion_{key}"], out * q[f"hip_adduction_{key}"], out * q[f"hip_rotation_{key}"])
        thigh = pelvis @ turned("ZXY", *turns)
        bodies |= {
            f"humerus_{side}": (arm, shoulder),
            f"radius_{side}": (forearm, shoulder + arm @ [0.0, -0.3, 0.0]),
            f"femur_{side}": (thigh, hip),
            f"tibia_{side}": (thigh @ turned("Z", -q[f"knee_angle_{key}"]), hip + thigh @ [0.0, -0.42, 0.0]),
        }
    return bodies


def _write_motion(path: Path, time: Array, columns: Mapping[str, Array]) -> None:
    """Write coordinates [deg] as OpenSim does."""
    rows = np.column_stack([time, *columns.values()])
    header = f"lift\nversion=1\nnRows={len(rows)}\nnColumns={rows.shape[1]}\ninDegrees=yes\nendheader\n"
    lines = ["\t".join(["time", *columns]), *("\t".join(f"{value:.8f}" for value in row) for row in rows)]
    path.write_text(header + "\n".join(lines) + "\n")


def _write_markers(path: Path, time: Array, places: Mapping[str, Array]) -> None:
    """Write positions [m] in mm as OpenSim does."""
    keys = "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames"
    axes = "\t".join(f"{axis}{number + 1}" for number in range(len(places)) for axis in "XYZ")
    lines = [f"PathFileType\t4\t(X/Y/Z)\t{path.name}", keys]
    lines += [f"50\t50\t{len(time)}\t{len(places)}\tmm\t50\t1\t{len(time)}"]
    lines += ["Frame#\tTime\t" + "\t\t\t".join(places) + "\t\t", f"\t\t{axes}", ""]
    rows = 1000.0 * np.stack(list(places.values()), axis=1).reshape(len(time), -1)
    lines += [
        f"{number + 1}\t{time[number]:.5f}\t" + "\t".join(f"{value:.5f}" for value in row)
        for number, row in enumerate(rows)
    ]
    path.write_text("\n".join(lines) + "\n")


def test_opensim_coordinates_and_markers_of_one_motion(tmp_path: Path) -> None:
    time = np.arange(100) / 50.0
    q = _coordinates(time)
    bodies = _bodies(q)
    places = {name: bodies[body][1] + bodies[body][0] @ place for name, (body, place) in POINTS.items()}
    motion, markers = tmp_path / "lift.mot", tmp_path / "lift.trc"
    still = {f"wrist_{name}_{side}": np.zeros(100) for name in ("flex", "dev") for side in "rl"}
    _write_motion(motion, time, q | still)
    _write_markers(markers, time, places)
    by_coordinates, by_markers = read(motion), read(markers)
    assert (by_coordinates.profile, by_markers.profile) == ("opensim", "markers_opencap")
    check_agreement(
        by_coordinates,
        by_markers,
        {
            **dict.fromkeys(columns_of("neck"), "the model has no neck"),
            **dict.fromkeys(columns_of("shoulder_elevation"), "the model has no clavicle joint"),
            **dict.fromkeys(columns_of("wrist_flexion", "wrist_deviation"), "no points on the hand"),
        },
    )


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="the real recordings are not beside the checkout")
def test_inverse_kinematics_and_markers_of_a_real_trial() -> None:
    folder = RECORDINGS / "balancing_pose2sim"
    solved = read(folder / "balancing_LSTM.mot")
    markers = read(folder / "S00_P00_T01_BalancingTrial_0-100_filt_butterworth_LSTM.trc")
    # Medians of the differences [deg]. Inverse kinematics fits a scaled model to the markers: its lumbar joint is above
    # the hips, its shoulder below the acromion, its elbow between the epicondyles of the model.
    known = {
        **dict.fromkeys(columns_of("trunk"), 6.0),
        **dict.fromkeys(columns_of("knee"), 6.0),
        **dict.fromkeys(columns_of("upper_arm"), 10.0),
        **dict.fromkeys(columns_of("lower_arm"), 12.0),
    }
    for column in COLUMNS:
        if column in known:
            apart = float(np.median(np.abs(solved.data[column] - markers.data[column])))
            assert apart < known[column], (column, apart)
        else:
            # No markers on head and hands drove the model, and the girdle has no zero in either.
            assert column in solved.unmeasured, column


def test_pose2sim_coordinates_and_markers_of_one_motion(tmp_path: Path) -> None:
    time = np.arange(100) / 50.0
    q = _coordinates(time)
    bodies = _bodies(q)
    wave = {
        "neck_flexion": -15.0 + 10.0 * np.sin(time),
        "neck_bending": 8.0 * np.cos(time),
        "neck_rotation": 20.0 * np.sin(2 * time),
    }
    head = (
        bodies["torso"][0] @ Rotation.from_euler("ZXY", np.stack(list(wave.values()), axis=1), degrees=True).as_matrix()
    )
    neck = bodies["torso"][1] + bodies["torso"][0] @ [0.0, 0.5, 0.0]
    places = {name: bodies[body][1] + bodies[body][0] @ place for name, (body, place) in POINTS.items()}
    named = {
        "Hip": "HJC_study",
        "Shoulder": "shoulder_study",
        "Ankle": "ankle_study",
        "BigToe": "toe_study",
        "Heel": "calc_study",
    }
    points = {"Neck": neck}
    for side, key in (("R", "r"), ("L", "L")):
        for name, marker in named.items():
            points[side + name] = places.get(f"{side}{marker}", places.get(f"{key}_{marker}"))
        for name, marker in (("Elbow", "elbow"), ("Wrist", "wrist")):
            points[side + name] = (places[f"{key}_l{marker}_study"] + places[f"{key}_m{marker}_study"]) / 2.0
        points[side + "Knee"] = (places[f"{key}_knee_study"] + places[f"{key}_mknee_study"]) / 2.0
        points[side + "Ankle"] = (places[f"{key}_ankle_study"] + places[f"{key}_mankle_study"]) / 2.0
        points[side + "Ear"] = neck + head @ [0.0, 0.2, 0.08 if side == "R" else -0.08]
    renamed = {
        "lumbar_extension": "L5_S1_Flex_Ext",
        "lumbar_bending": "L5_S1_Lat_Bending",
        "lumbar_rotation": "L5_S1_axial_rotation",
    }
    motion, markers = tmp_path / "lift.mot", tmp_path / "lift.trc"
    _write_motion(motion, time, {renamed.get(name, name): values for name, values in (q | wave).items()})
    _write_markers(markers, time, points)
    by_coordinates, by_markers = read(motion), read(markers)
    assert (by_coordinates.profile, by_markers.profile) == ("opensim_pose2sim", "keypoints_openpose")
    check_agreement(
        by_coordinates,
        by_markers,
        {
            **dict.fromkeys(columns_of("shoulder_elevation"), "the shoulder"),
            **dict.fromkeys(columns_of("wrist"), "no two points across the wrist"),
        },
    )
