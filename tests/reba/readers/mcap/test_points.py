"""3D keypoints in MCAP: markers, poses and scenes give the angles of the same points in a TRC file."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foxglove import messages as foxglove
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore

import reba
from reba.errors import ProfileError
from reba.posture.columns import COLUMNS
from reba.readers.formats import open_recording
from reba.readers.info import info
from reba.readers.mcap import open_mcap
from reba.readers.recording.stream import ReadLog
from tests.support.bag_copies import EPOCH_NS
from tests.support.paths import DATASETS
from tests.support.says import says

TRC = DATASETS / "balancing_keypoints.trc"
SPHERE, CYLINDER, SPHERE_LIST, TEXT, DELETEALL = 2, 3, 7, 9, 3
FOXY, HUMBLE, NOETIC = (get_typestore(Stores[name]) for name in ("ROS2_FOXY", "ROS2_HUMBLE", "ROS1_NOETIC"))
Frame = tuple[int, list[str], np.ndarray]
"""Time [ns], k names and (k, 3) points [m]."""


def frames() -> Iterator[Frame]:
    """Yield the frames of a real recording of keypoints."""
    (stream,) = open_recording(TRC).streams
    for block in stream.blocks():
        for time, values in zip(block.time, block.values, strict=True):
            there = ~np.isnan(values).any(axis=1)
            names = [name for name, one in zip(block.names, there, strict=True) if one]
            yield EPOCH_NS + round(float(time) * 1e9), names, values[there]


def write(path: Path, name: str, encoding: str, schema: tuple[str, bytes], make: Callable[[Frame], bytes]) -> Path:
    """Write a message for each frame on one topic."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel("/keypoints", encoding, writer.register_schema(name, *schema))
        for frame in frames():
            writer.add_message(channel, frame[0], make(frame), frame[0])
        writer.finish()
    return path


def markers(store: Any, frame: Frame, **named: Callable[[int, str], Any]) -> Any:
    """Return a MarkerArray: all old ones deleted, bones as cylinders, and a sphere for each point."""
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](*divmod(frame[0], 10**9))
    numbered = {"seq": 1} if store is NOETIC else {}
    header = types["std_msgs/msg/Header"](**numbered, stamp=stamp, frame_id="world")
    one, turn = types["geometry_msgs/msg/Vector3"](1, 1, 1), types["geometry_msgs/msg/Quaternion"](0, 0, 0, 1)
    colour = types["std_msgs/msg/ColorRGBA"](1, 0, 0, 1)
    ever = types["builtin_interfaces/msg/Duration"](0, 0)

    def marker(kind: int, action: int, ns: str, number: int, text: str, place: np.ndarray) -> Any:
        pose = types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](*place.tolist()), turn)
        fields = {"header": header, "ns": ns, "id": number, "type": kind, "action": action, "pose": pose, "scale": one}
        fields |= {"color": colour, "lifetime": ever, "frame_locked": False, "points": [], "colors": [], "text": text}
        fields |= {"mesh_resource": "", "mesh_use_embedded_materials": False}
        if store is HUMBLE:
            image = types["sensor_msgs/msg/CompressedImage"](header, "", np.zeros(0, np.uint8))
            mesh = types["visualization_msgs/msg/MeshFile"]("", np.zeros(0, np.uint8))
            fields |= {"texture_resource": "", "texture": image, "uv_coordinates": [], "mesh_file": mesh}
        return types["visualization_msgs/msg/Marker"](**fields)

    rows = [marker(0, DELETEALL, "", 0, "", np.zeros(3)), marker(CYLINDER, 0, "bones", 0, "", np.ones(3))]
    for index, (name, place) in enumerate(zip(frame[1], frame[2], strict=True)):
        values = {key: value(index, name) for key, value in named.items()}
        rows.append(marker(SPHERE, 0, values.get("ns", ""), values.get("id", index), values.get("text", ""), place))
    return types["visualization_msgs/msg/MarkerArray"](rows)


NAMES = "visualization_msgs/msg/MarkerArray"
WAYS: dict[str, dict[str, Callable[[int, str], Any]]] = {
    "namespace": {"ns": lambda index, name: name},
    "namespace_and_id": {"ns": lambda index, name: name, "id": lambda index, name: 0},
    "text": {"ns": lambda index, name: "body", "text": lambda index, name: name},
}


def same_as_trc(path: Path, **options: Any) -> None:
    expected, found = reba.read(TRC), reba.read(path, **options)
    assert len(found.data) == len(expected.data)
    np.testing.assert_allclose(found.data[list(COLUMNS)], expected.data[list(COLUMNS)], atol=1e-9)
    np.testing.assert_allclose(found.data["time"], expected.data["time"], atol=1e-6)
    scores = [reba.score(table, load=3.0).data["reba"].to_numpy() for table in (expected, found)]
    np.testing.assert_array_equal(*scores)
    assert found.quality.accounts[0]["used"] == len(expected.data)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("defined", [True, False])
@pytest.mark.parametrize("store", [FOXY, HUMBLE, NOETIC], ids=["foxy", "humble", "noetic"])
def test_marker_array(way: str, defined: bool, store: Any, tmp_path: Path) -> None:
    ros1 = store is NOETIC
    text = store.generate_msgdef(NAMES, ros_version=1 if ros1 else 2)[0] if defined else ""

    def make(frame: Frame) -> bytes:
        message = markers(store, frame, **WAYS[way])
        return bytes(store.serialize_ros1(message, NAMES) if ros1 else store.serialize_cdr(message, NAMES))

    encoding, schema = ("ros1", "ros1msg") if ros1 else ("cdr", "ros2msg")
    name = NAMES.replace("/msg", "") if ros1 else NAMES
    path = write(tmp_path / "a.mcap", name, encoding, (schema, text.encode()), make)
    same_as_trc(path)


def own_profile(path: Path, name: Callable[[int, str], str]) -> Path:
    """Write a profile that says which point is which, from the shipped one."""
    names = next(frames())[1]
    lines = ['name = "mine"', 'title = "mine"', 'source = "notes"', 'kind = "points"']
    lines += ['required = ["hip_{side}"]', "[points]"]
    known = {"hip": "hip", "shoulder": "shoulder", "elbow": "elbow", "wrist": "wrist", "knee": "knee", "ankle": "ankle"}
    known |= {"toe": "foot_index", "heel": "heel", "ear": "ear"}
    for point, word in known.items():
        for side in ("left", "right"):
            at = names.index(f"{side}_{word}")
            lines.append(f'{point}_{side} = "{name(at, names[at])}"')
    lines.append(f'nose = "{name(names.index("nose"), "nose")}"')
    lines += ["[cannot]", 'shoulder_elevation = "no point"', 'wrists = "no points"']
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_markers_by_number_need_a_profile(tmp_path: Path) -> None:
    def make(frame: Frame) -> bytes:
        return bytes(HUMBLE.serialize_cdr(markers(HUMBLE, frame, id=lambda index, name: 100 + index), NAMES))

    text = HUMBLE.generate_msgdef(NAMES, ros_version=2)[0].encode()
    path = write(tmp_path / "a.mcap", NAMES, "cdr", ("ros2msg", text), make)
    with pytest.raises(ProfileError) as caught:
        reba.read(path)
    says(caught, "marker_100", "--profile")
    same_as_trc(path, profile=own_profile(tmp_path / "mine.toml", lambda index, name: f"marker_{100 + index}"))


def test_pose_array_by_order_needs_a_profile(tmp_path: Path) -> None:
    name = "geometry_msgs/msg/PoseArray"
    types = HUMBLE.types

    def make(frame: Frame) -> bytes:
        stamp = types["builtin_interfaces/msg/Time"](*divmod(frame[0], 10**9))
        turn = types["geometry_msgs/msg/Quaternion"](0, 0, 0, 1)
        point = types["geometry_msgs/msg/Point"]
        poses = [types["geometry_msgs/msg/Pose"](point(*place.tolist()), turn) for place in frame[2]]
        return bytes(HUMBLE.serialize_cdr(types[name](types["std_msgs/msg/Header"](stamp, "world"), poses), name))

    text = HUMBLE.generate_msgdef(name, ros_version=2)[0].encode()
    path = write(tmp_path / "a.mcap", name, "cdr", ("ros2msg", text), make)
    assert info(path).topics[0]["why"] == "positions of points"
    with pytest.raises(ProfileError) as caught:
        reba.read(path)
    says(caught, "pose_0", "--profile")
    same_as_trc(path, profile=own_profile(tmp_path / "mine.toml", lambda index, name: f"pose_{index}"))


def scene(frame: Frame) -> foxglove.SceneUpdate:
    stamp = foxglove.Timestamp(*divmod(frame[0], 10**9))
    turn = foxglove.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
    entities = []
    for name, place in zip(frame[1], frame[2], strict=True):
        pose = foxglove.Pose(
            position=foxglove.Vector3(**dict(zip("xyz", place.tolist(), strict=True))), orientation=turn
        )
        ball = foxglove.SpherePrimitive(pose=pose, size=foxglove.Vector3(x=0.1, y=0.1, z=0.1))
        entities.append(foxglove.SceneEntity(timestamp=stamp, frame_id="world", id=name, spheres=[ball]))
    return foxglove.SceneUpdate(entities=entities)


def test_foxglove_scene(tmp_path: Path) -> None:
    schema = foxglove.SceneUpdate.get_schema()
    packed = (schema.encoding, bytes(schema.data))
    path = write(tmp_path / "a.mcap", schema.name, "protobuf", packed, lambda frame: bytes(scene(frame).encode()))
    same_as_trc(path)


def test_foxglove_poses(tmp_path: Path) -> None:
    schema = foxglove.PosesInFrame.get_schema()

    def make(frame: Frame) -> bytes:
        poses = [foxglove.Pose(position=foxglove.Vector3(x=x, y=y, z=z)) for x, y, z in frame[2].tolist()]
        stamp = foxglove.Timestamp(*divmod(frame[0], 10**9))
        return bytes(foxglove.PosesInFrame(timestamp=stamp, frame_id="world", poses=poses).encode())

    path = write(tmp_path / "a.mcap", schema.name, "protobuf", (schema.encoding, bytes(schema.data)), make)
    same_as_trc(path, profile=own_profile(tmp_path / "mine.toml", lambda index, name: f"pose_{index}"))


def test_foxglove_poses_in_json(tmp_path: Path) -> None:
    def make(frame: Frame) -> bytes:
        seconds, nanos = divmod(frame[0], 10**9)
        poses = [{"position": dict(zip("xyz", place.tolist(), strict=True))} for place in frame[2]]
        return json.dumps({"timestamp": {"sec": seconds, "nsec": nanos}, "frame_id": "w", "poses": poses}).encode()

    path = write(tmp_path / "a.mcap", "foxglove.PosesInFrame", "json", ("jsonschema", b"{}"), make)
    same_as_trc(path, profile=own_profile(tmp_path / "mine.toml", lambda index, name: f"pose_{index}"))


def test_labels_that_change_with_every_message_end_early(tmp_path: Path) -> None:
    """Texts such as "0.31 m/s" would be new names, and walking all of them would take minutes."""
    numbers = iter(range(1_000_000))
    rows = markers(FOXY, (EPOCH_NS, [str(index) for index in range(30)], np.ones((30, 3))))

    def make(frame: Frame) -> bytes:
        for one in rows.markers:
            one.text = str(next(numbers))
        return bytes(FOXY.serialize_cdr(rows, NAMES))

    text = FOXY.generate_msgdef(NAMES, ros_version=2)[0].encode()
    path = write(tmp_path / "a.mcap", NAMES, "cdr", ("ros2msg", text), make)
    log = ReadLog()
    for stream in open_mcap(path).streams:
        list(stream.blocks(log))
    says(log.first_skipped or "", "more than 2000 names")


def two_people(frame: Frame, space: Callable[[int], str]) -> Any:
    """Return the markers of a person, and of another one who stands two metres beside, named by text."""
    names = [*frame[1], *frame[1]]
    places = np.concatenate([frame[2], frame[2] + [2.0, 0.0, 0.0]])
    both = (frame[0], names, places)
    count = len(frame[1])
    return markers(FOXY, both, ns=lambda index, name: space(1 + index // count), text=lambda index, name: name)


def test_two_people_are_a_question(tmp_path: Path) -> None:
    text = FOXY.generate_msgdef(NAMES, ros_version=2)[0].encode()

    def make(frame: Frame) -> bytes:
        return bytes(FOXY.serialize_cdr(two_people(frame, lambda number: f"person_{number}"), NAMES))

    path = write(tmp_path / "a.mcap", NAMES, "cdr", ("ros2msg", text), make)
    with pytest.raises(ProfileError) as caught:
        reba.read(path)
    says(caught, "person_1", "person_2", "--topic")
    same_as_trc(path, topic="person_2")

    def nameless(frame: Frame) -> bytes:
        return bytes(FOXY.serialize_cdr(two_people(frame, lambda number: ""), NAMES))

    path = write(tmp_path / "b.mcap", NAMES, "cdr", ("ros2msg", text), nameless)
    says(open_mcap(path).topics[0].why, "2 of its points are named", "namespace of its own")


def test_lists_of_markers_and_clouds_are_told(tmp_path: Path) -> None:
    def lists(frame: Frame) -> bytes:
        message = markers(FOXY, frame)
        message.markers = [one for one in message.markers if one.type == CYLINDER]
        message.markers[0].type = SPHERE_LIST
        return bytes(FOXY.serialize_cdr(message, NAMES))

    text = FOXY.generate_msgdef(NAMES, ros_version=2)[0].encode()
    path = write(tmp_path / "a.mcap", NAMES, "cdr", ("ros2msg", text), lists)
    assert "draw a sphere per point" in open_mcap(path).topics[0].why

    names = [str(index) for index in range(1000)]
    cloud = bytes(FOXY.serialize_cdr(markers(FOXY, (EPOCH_NS, names, np.ones((1000, 3)))), NAMES))
    path = write(tmp_path / "b.mcap", NAMES, "cdr", ("ros2msg", text), lambda frame: cloud)
    assert "more points than bodies have" in open_mcap(path).topics[0].why
