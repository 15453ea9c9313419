"""The data sets: same bytes again, a possible body, and every message readable by two other readers."""

from __future__ import annotations

import hashlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from numpy.testing import assert_allclose, assert_array_equal
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

import reba
from reba.posture.columns import COLUMNS
from tests.support.paths import DATASETS
from tests.support.urdf_chain import forward, human_urdf, read_joints

sys.path.insert(0, str(DATASETS))
import assembly
import balancing
import make_datasets
import palletising
import ros2_messages
from smooth_motion import minimum_jerk, quantise, tremor

FOLDER = Path(make_datasets.__file__).parent
MCAP = FOLDER / "simulated_palletising.mcap"
CSV = FOLDER / "simulated_assembly.csv"
REAL = FOLDER / balancing.FILE
POSE2SIM = FOLDER.parents[1] / "shared" / "recordings" / "balancing_pose2sim"


@pytest.fixture(scope="module")
def motion() -> palletising.Motion:
    return palletising.simulate(np.random.default_rng(make_datasets.SEED))


def metadata(path: Path) -> dict[str, str]:
    with path.open("rb") as stream:
        return {k: v for record in make_reader(stream).iter_metadata() for k, v in record.metadata.items()}


def test_making_them_again_gives_the_same_bytes(tmp_path: Path) -> None:
    make_datasets.make(tmp_path)
    assert (tmp_path / CSV.name).read_bytes() == CSV.read_bytes()
    if metadata(MCAP)["zstandard"] != zstandard.__version__:
        pytest.skip(f"the stored MCAP was compressed by zstandard {metadata(MCAP)['zstandard']}")
    assert (tmp_path / MCAP.name).read_bytes() == MCAP.read_bytes()
    assert (tmp_path / "README.md").read_text() == (FOLDER / "README.md").read_text()


def test_the_catalogue_names_every_file_with_its_checksum() -> None:
    catalogue = (FOLDER / "README.md").read_text()
    named = dict(re.findall(r"^## (\S+)$.*?^\| sha256 \| `(\w+)` \|$", catalogue, flags=re.M | re.S))
    stored = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in [*FOLDER.glob("simulated_*"), REAL]}
    assert named == stored
    assert sum(p.stat().st_size for p in FOLDER.glob("simulated_*")) < 2_000_000


def test_the_recording_says_that_it_is_simulated() -> None:
    assert metadata(MCAP)["source"] == "simulated, no person was measured"
    assert MCAP.name.startswith("simulated_")


def test_messages_decode_with_the_official_reader(motion: palletising.Motion) -> None:
    with MCAP.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        joints, frames = [], []
        for _, channel, record, message in reader.iter_decoded_messages():
            (joints if channel.topic == "/joint_states" else frames).append((record.log_time, message))
    assert len(joints) == len(frames) == len(motion.time)
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for _, m in joints]
    assert stamps == [log for log, _ in joints]
    assert_array_equal([m.position for _, m in joints], motion.position)
    assert_array_equal([m.velocity for _, m in joints], motion.velocity)
    assert all(tuple(m.name) == palletising.JOINTS and not m.effort for _, m in joints)
    _, last = frames[-1]
    assert last.transforms[0].header.frame_id == "map"
    assert last.transforms[0].child_frame_id == "middle_pelvis"
    turn = last.transforms[0].transform.rotation
    assert_array_equal([turn.x, turn.y, turn.z, turn.w], motion.root[-1, 3:])


def test_a_second_reader_opens_the_file() -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(MCAP) as reader:
        assert {c.topic: c.msgtype for c in reader.connections} == {
            "/joint_states": ros2_messages.JOINT_STATE_NAME,
            "/tf": ros2_messages.TF_MESSAGE_NAME,
        }
        connection, _, data = next(iter(reader.messages()))
    assert list(store.deserialize_cdr(data, connection.msgtype).name) == list(palletising.JOINTS)


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_bytes_are_those_of_a_second_serialiser(count: int) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    values = np.linspace(-1.0, 1.0, count)
    names = [f"joint{'x' * index}" for index in range(count)]
    data = ros2_messages.joint_state(1_500_000_007, names, values, values * 2, frame="base")
    message = store.deserialize_cdr(data, ros2_messages.JOINT_STATE_NAME)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1, 500_000_007)
    assert_array_equal(message.velocity, values * 2)
    assert bytes(store.serialize_cdr(message, ros2_messages.JOINT_STATE_NAME)) == data
    poses = [ros2_messages.Transform("map", name, np.arange(7.0)) for name in names]
    data = ros2_messages.tf_message(-1, poses)
    message = store.deserialize_cdr(data, ros2_messages.TF_MESSAGE_NAME)
    assert [t.child_frame_id for t in message.transforms] == names
    assert bytes(store.serialize_cdr(message, ros2_messages.TF_MESSAGE_NAME)) == data


def test_the_simulated_body_is_possible(motion: palletising.Motion) -> None:
    urdf = human_urdf()
    if urdf is None:
        pytest.skip("example-robot-data is not installed")
    joints = read_joints(urdf)
    assert tuple(joint.name for joint in joints) == palletising.JOINTS
    for joint, values in zip(joints, motion.position.T, strict=True):
        assert joint.lower <= values.min(), joint.name
        assert values.max() <= joint.upper, joint.name
    angles = dict(zip(palletising.JOINTS, motion.position.T, strict=True))
    turn = Rotation.from_quat(motion.root[:, 3:]).as_matrix()
    links = forward(joints, angles, "middle_pelvis", turn, motion.root[:, :3])
    ankles = np.minimum(links["left_foot"][1][:, 2], links["right_foot"][1][:, 2])
    assert_allclose(ankles, palletising.SOLE, atol=0.01)  # the leg that carries stands on the floor
    head = links["middle_head"][1]
    assert (head[:, 2] > links["middle_pelvis"][1][:, 2]).all()
    trunk = np.degrees(np.arccos(links["middle_thorax"][0][:, 2, 1]))
    assert trunk.min() < 5 < 70 < trunk.max() < 90
    hands = links["left_hand"][1][:, 2]
    assert hands.min() < 0.5 < 1.7 < hands.max()


def test_the_table_has_contract_columns_and_no_wrists() -> None:
    header, *rows = CSV.read_text().splitlines()
    columns = header.split(",")
    assert set(columns) - {"time", "load"} == {name for name in COLUMNS if not name.startswith("wrist")}
    assert columns[1:-1] == list(assembly.COLUMNS)
    values = np.array([row.split(",") for row in rows], dtype=float)
    assert_allclose(np.diff(values[:, 0]), 1 / assembly.RATE)
    assert set(values[:, -1]) == {0.0, 0.4, 1.8, 2.6}
    assert values[:, columns.index("upper_arm_flexion_right")].max() > 120


def test_movement_starts_and_ends_at_rest() -> None:
    path = minimum_jerk(np.array([[0.0], [10.0], [10.0]]), np.array([1.0, 1.0]), 1000.0)
    speed = np.gradient(path[:, 0], 0.001)
    assert_allclose(speed[[0, 1000, 2000]], 0.0, atol=1e-3)
    assert speed.max() == pytest.approx(18.75, abs=0.01)  # 15/8 of the mean speed


def test_noise_has_its_size_and_its_grid() -> None:
    noise = tremor(np.random.default_rng(0), (20_000, 2), 0.5)
    assert noise.std() == pytest.approx(0.5, rel=0.03)
    assert_array_equal(quantise(noise, 4) * 16 % 1, 0.0)


def test_the_recording_runs_through_all_action_levels(motion: palletising.Motion) -> None:
    postures = reba.read(MCAP)
    assert postures.profile == "human_description"
    assert not postures.unmeasured
    assert len(postures.data) == len(motion.time)
    assert postures.data["trunk_flexion"].max() > 70
    levels = reba.score(postures, load=make_datasets.BOX_KG).data["action_level"]
    assert set(levels) == {0, 1, 2, 3, 4}


def test_the_table_is_scored_with_a_range_for_the_wrists() -> None:
    postures = reba.read(CSV)
    assert set(postures.unmeasured) == {name for name in COLUMNS if name.startswith("wrist")}
    scores = reba.score(postures).data
    assert (scores["reba_high"] - scores["reba_low"]).between(0, 3).all()
    assert scores["reba_high"].max() >= 10


def test_the_recorded_person_is_possible_and_scored_with_what_keypoints_show() -> None:
    postures = reba.read(REAL)
    assert postures.profile == "keypoints_coco"
    hidden = ("wrist", "shoulder_elevation")
    assert set(postures.unmeasured) == {name for name in COLUMNS if name.startswith(hidden)}
    assert postures.data["knee_flexion_right"].between(0, 80).all()
    assert postures.data["trunk_side_bend"].min() < -30
    scores = reba.score(postures).data
    assert (scores["reba_low"] < scores["reba_high"]).any()


@pytest.mark.skipif(not POSE2SIM.is_dir(), reason="no ../shared/recordings beside the checkout")
@pytest.mark.parametrize("column", ["trunk_side_bend", "upper_arm_abduction_left", "knee_flexion_right"])
def test_another_estimate_of_the_recorded_trial_moves_the_same_way(column: str) -> None:
    mine = reba.read(REAL).data[column].to_numpy()
    other = reba.read(next(POSE2SIM.glob("*_0-100.trc"))).data[column].to_numpy()[: len(mine)]
    assert np.corrcoef(mine, other)[0, 1] > 0.8
    assert np.median(np.abs(mine - other)) < 10.0


def test_the_calibration_puts_cameras_around_the_person() -> None:
    lens = " ".join(f'{name}="{64 * value}"' for name, value in (
        ("focalLengthU", 1000), ("focalLengthV", 1000), ("centerPointU", 500), ("centerPointV", 400),
        ("radialDistortion1", 0), ("radialDistortion2", 0), ("radialDistortion3", 0),
        ("tangentalDistortion1", 0), ("tangentalDistortion2", 0),
    ))  # fmt: skip
    # Two cameras 2 m above the floor, 1 m apart, looking down: their z axes point up.
    places = [f'x="{x}" y="0" z="2000"' for x in (-500, 500)]
    turn = 'r11="1" r12="0" r13="0" r21="0" r22="1" r23="0" r31="0" r32="0" r33="1"'
    text = "".join(f"<camera><transform {turn} {place}/><intrinsic {lens}/></camera>" for place in places)
    cameras = balancing.read_cameras(f"<cameras>{text}</cameras>")
    point = np.array([0.2, -0.3, 0.5])
    seen = []
    for camera in cameras:
        there = camera.rotation @ point + camera.shift
        assert there[2] == pytest.approx(1.5)
        seen.append((there[:2] / there[2])[None, None])
    found, away = balancing.triangulate(seen, [np.ones((1, 1))] * 2, cameras)
    assert_allclose(found[0, 0], point, atol=1e-9)
    assert away.max() < 1e-6
