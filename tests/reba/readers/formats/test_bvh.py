"""The BVH reader: kinematics against scipy, odd but legal files, damage, and the real recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reba.errors import ReadError
from reba.readers.formats.bvh import MAX_JOINTS, open_bvh, sniff
from reba.readers.recording.stream import ReadLog
from tests.support.paths import RECORDINGS
from tests.support.says import says

SMALL = """HIERARCHY
ROOT Hips
{
  OFFSET 1 2 3
  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
  JOINT Chest
  {
    OFFSET 0 10 0
    CHANNELS 2 Xrotation Yrotation
    JOINT Left Arm {
      OFFSET 5 0 0
      CHANNELS 3 Yrotation Zrotation Xrotation
      End Site
      {
        OFFSET 0 -7 0.5
      }
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.02
0 0 0 0 0 0 0 0 0 0 0
1 2 3 10 20 30 40 50 60 70 80
-1 -2 -3 -100 200 -300 15 -25 35 -45 55
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "small.bvh"
    path.write_bytes(text.encode())
    return path


def values(path: Path, names: list[str] | None = None) -> np.ndarray:
    return np.concatenate([block.values for block in open_bvh(path).streams[0].blocks(names=names)])


@pytest.mark.parametrize(("factor", "radians"), [(1.0, False), (np.pi / 180, True)])
def test_rotations_that_look_like_radians_are_told(tmp_path: Path, factor: float, radians: bool) -> None:
    rows = [
        "1 2 3 " + " ".join(f"{factor * (at * 4 + channel * 11 % 90):.6f}" for channel in range(8)) for at in range(20)
    ]
    text = SMALL[: SMALL.index("Frames: 3")] + "Frames: 20\nFrame Time: 0.02\n" + "\n".join(rows) + "\n"
    warnings = open_bvh(write(tmp_path, text)).log.warnings
    assert any("radians" in text for text in warnings) == radians


def test_poses_are_those_of_composed_rotations(tmp_path: Path) -> None:
    stream = open_bvh(write(tmp_path, SMALL)).streams[0]
    assert stream.names == ("Hips", "Chest", "Left Arm", "Left Arm_end")
    assert (stream.kind, stream.parents, stream.count, stream.up) == ("frames", ("",) * 4, 3, "")
    (block,) = stream.blocks()
    np.testing.assert_allclose(block.time, [0, 0.02, 0.04])
    for row, pose in zip(np.loadtxt(SMALL.splitlines()[-3:]), block.values, strict=True):
        hips = Rotation.from_euler("ZYX", row[3:6], degrees=True)
        chest = hips * Rotation.from_euler("XY", row[6:8], degrees=True)
        arm = chest * Rotation.from_euler("YZX", row[8:11], degrees=True)
        points = [np.array([1.0, 2, 3]) + row[:3]]
        points.append(points[0] + hips.apply([0, 10, 0]))
        points.append(points[1] + chest.apply([5, 0, 0]))
        points.append(points[2] + arm.apply([0, -7, 0.5]))
        np.testing.assert_allclose(pose[:, :3], points, atol=1e-12)
        turns = [Rotation.from_quat(q) for q in pose[:, 3:]]
        for turn, expected in zip(turns, [hips, chest, arm, arm], strict=True):
            assert (turn.inv() * expected).magnitude() < 1e-12


def test_rest_is_the_sum_of_the_offsets(tmp_path: Path) -> None:
    rest = open_bvh(write(tmp_path, SMALL)).streams[0].rest
    assert rest is not None
    np.testing.assert_array_equal(rest[:, :3], [[1, 2, 3], [1, 12, 3], [6, 12, 3], [6, 5, 3.5]])
    np.testing.assert_array_equal(rest[:, 3:], [[0, 0, 0, 1]] * 4)


def test_skeletons_that_repeat_names_are_people(tmp_path: Path) -> None:
    head, motion = SMALL.split("MOTION\n")
    lines = motion.splitlines()
    rows = [f"{row} {again}" for row, again in zip(lines[2:], reversed(lines[2:]), strict=True)]
    text = head + head.removeprefix("HIERARCHY\n") + "\n".join(["MOTION", *lines[:2], *rows]) + "\n"
    first, second = open_bvh(write(tmp_path, text)).streams
    assert (first.name, second.name, first.names) == ("Hips", "Hips_2", second.names)
    alone = values(write(tmp_path, SMALL))
    open_bvh(write(tmp_path, text))
    (one,), (other,) = first.blocks(), second.blocks()
    np.testing.assert_array_equal(one.values, alone)
    np.testing.assert_array_equal(other.values, alone[::-1])
    np.testing.assert_array_equal(second.rest, first.rest)


def test_roots_of_other_names_belong_to_one_stream(tmp_path: Path) -> None:
    head, motion = SMALL.split("MOTION\n")
    prop = "ROOT Box\n{\n OFFSET 0 0 0\n CHANNELS 3 Xposition Yposition Zposition\n}\n"
    rows = [f"{row} 1 2 3" if at > 1 else row for at, row in enumerate(motion.splitlines())]
    (stream,) = open_bvh(write(tmp_path, head + prop + "\n".join(["MOTION", *rows]) + "\n")).streams
    assert stream.names[-1] == "Box"


def test_a_frame_time_in_other_units_is_told(tmp_path: Path) -> None:
    says(open_bvh(write(tmp_path, SMALL.replace("0.02", "20"))).log.warnings[0], "20 s apart", "Frame Time")


def test_names_limit_the_signals(tmp_path: Path) -> None:
    path = write(tmp_path, SMALL)
    np.testing.assert_array_equal(values(path, ["Left Arm", "unknown"])[:, 0], values(path)[:, 2])


@pytest.mark.parametrize(("channel", "adds"), [("0 10.1 0", False), ("0 0.1 0", True)])
def test_positions_of_inner_joints_replace_or_add(tmp_path: Path, channel: str, adds: bool) -> None:
    text = (
        "HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 1 Zrotation JOINT b { OFFSET 0 10 0\n"
        f"CHANNELS 3 Xposition Yposition Zposition }} }}\nMOTION\nFrames: 1\nFrame Time: 1\n0 {channel}\n"
    )
    np.testing.assert_allclose(values(write(tmp_path, text))[0, 1, :3], [0, 10.1, 0])
    log = ReadLog()
    list(open_bvh(write(tmp_path, text)).streams[0].blocks(log))
    assert bool(log.warnings) != adds


def test_line_ends_marks_and_case_do_not_matter(tmp_path: Path) -> None:
    wanted = values(write(tmp_path, SMALL))
    for text in ("\ufeff" + SMALL.replace("\n", "\r\n"), SMALL.lower(), SMALL.replace(" ", "\t ")):
        np.testing.assert_array_equal(values(write(tmp_path, text)), wanted)


def test_a_cut_end_gives_the_whole_frames_and_a_warning(tmp_path: Path) -> None:
    path = write(tmp_path, SMALL[:-20])
    recording = open_bvh(path)
    assert recording.streams[0].count == 2
    says(recording.log.ended_abnormally or "", "line 25", "6 of 11 numbers", "rows before it")
    says(" ".join(recording.log.warnings), "3 frames", "has 2")


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("Frame Time: 0.02", "Frame Time: 0", "line 22: Frame Time is '0'"),
        ("Frame Time: 0.02", "Frame Time: nan", "line 22: Frame Time is 'nan'"),
        ("Frames: 3", "Frames: -3", "line 21: Frames is '-3'"),
        ("40 50", "40 nan", "line 24: 'nan' is not a finite number"),
        ("40 50", "inf 50", "line 24: 'inf' is not a finite number"),
        ("40 50", "40 x", "line 24: 'x' is not a number"),
        ("40 50", "40", "line 24 has 10 numbers, expected 11"),
        ("40 50", "40 50 60", "line 24 has 12 numbers, expected 11"),
        ("OFFSET 5 0 0", "OFFSET 5 0", "line 12: 'CHANNELS' is not a finite number"),
        ("OFFSET 5 0 0", "OFFSET 5 0 1e999", "line 11: '1e999' is not a finite number"),
        ("CHANNELS 2", "CHANNELS 99999999", "line 9: '99999999' channels, expected 0 to 6"),
        ("CHANNELS 2 Xrotation", "CHANNELS 2 Wrotation", "line 9: 'Wrotation' | Xposition"),
        ("CHANNELS 2 Xrotation", "CHANNELS 2 Yrotation", "line 9: joint 'Chest' has a channel twice"),
        ("JOINT Chest", "JOINT", "line 7: a joint has no name"),
        ("}\nMOTION", "MOTION", "joint 'Hips' is not closed"),
        ("MOTION", "MUTION", "line 20: 'MUTION' where ROOT or MOTION was expected"),
        ("Frames: 3\n", "", "line 22: 'Frames:' expected"),
    ],
)
def test_damage_is_told_with_its_line(tmp_path: Path, old: str, new: str, what: str) -> None:
    assert old in SMALL
    with pytest.raises(ReadError) as caught:
        open_bvh(write(tmp_path, SMALL.replace(old, new, 1)))
    says(caught, *what.split(" | "))


def test_deep_nesting_is_refused_without_recursion(tmp_path: Path) -> None:
    deep = "HIERARCHY\n" + "".join(
        f"{'JOINT' if index else 'ROOT'} j{index} {{ OFFSET 0 1 0\n" for index in range(100_000)
    )
    with pytest.raises(ReadError) as caught:
        open_bvh(write(tmp_path, deep))
    says(caught, f"more than {MAX_JOINTS} joints")


def test_equal_names_are_told_apart(tmp_path: Path) -> None:
    recording = open_bvh(write(tmp_path, SMALL.replace("Chest", "Hips")))
    assert recording.streams[0].names[:2] == ("Hips", "Hips_2")
    assert recording.log.warnings


def test_sniff_looks_at_the_content() -> None:
    assert sniff(Path("a.txt"), b"\r\n hierarchy\nROOT")
    assert not sniff(Path("a.bvh"), b"time,trunk_flexion\n")


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="the real recordings are not beside the checkout")
@pytest.mark.parametrize(
    ("name", "count", "rate", "body"),
    [
        ("box_lift_xsens_bvh/MotionBox_XSens.bvh", 1150, 60, ("Hips", "Head", "RightWrist", "LeftToe_end")),
        ("front_box_camera_bvh/ResultFrontBox_Filtered.bvh", 546, 24, ("Hips", "LeftUpLeg", "RightForeArm")),
        ("cmu_walk/cmu_12_01_walk.bvh", 524, 120, ("LHipJoint", "LeftToeBase_end", "Neck1")),
    ],
)
def test_real_files(name: str, count: int, rate: float, body: tuple[str, ...]) -> None:
    recording = open_bvh(RECORDINGS / name)
    (stream,) = recording.streams
    assert stream.count == count
    assert set(body) <= set(stream.names)
    assert recording.log.warnings == []
    block = next(stream.blocks())
    assert 1 / np.median(np.diff(block.time)) == pytest.approx(rate, rel=1e-4)
    np.testing.assert_allclose(np.linalg.norm(block.values[..., 3:], axis=-1), 1.0, atol=1e-9)
    assert stream.rest is not None
    thigh = [stream.names.index(next(n for n in stream.names if n in ("LeftUpLeg", "LeftHip")))]
    shank = [stream.names.index(next(n for n in stream.names if n in ("LeftLeg", "LeftKnee")))]
    lengths = np.linalg.norm(block.values[:, thigh, :3] - block.values[:, shank, :3], axis=-1)
    expected = np.linalg.norm(stream.rest[thigh, :3] - stream.rest[shank, :3])
    np.testing.assert_allclose(lengths, expected, rtol=1e-9)
