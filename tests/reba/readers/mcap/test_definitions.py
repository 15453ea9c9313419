"""Definitions in IDL, absent definitions, and types by any of their names: the numbers are those of the source."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore

import reba
from reba.posture.columns import COLUMNS
from reba.readers.info import info
from reba.readers.mcap import idl, ros
from reba.readers.mcap.definitions import standard_definitions
from reba.readers.mcap.meanings import MEANINGS
from reba.readers.mcap.ros import BadSchema, Number, RosArray, Struct, Text
from tests.support import bag_copies as copies

FRAMES = 60
LINE = "=" * 80
TIME = """module builtin_interfaces {
  module msg {
    @verbatim (language="comment", text=
      "This message communicates ROS Time defined here:" "\\n"
      "https://design.ros2.org/articles/clock_and_time.html")
    struct Time {
      @verbatim (language="comment", text=
        "The seconds component, valid over all int32 values.")
      int32 sec;
      uint32 nanosec;
    };
  };
};
"""
HEADER = """// generated from rosidl_adapter/resource/msg.idl.em
// with input from std_msgs/msg/Header.msg
#include "builtin_interfaces/msg/Time.idl"

module std_msgs { module msg { struct Header {
      builtin_interfaces::msg::Time stamp;
      @verbatim (language="comment", text= "Transform frame with which this data is associated.")
      string frame_id;
}; }; };
"""
JOINT_STATE = """#include "std_msgs/msg/Header.idl"
module sensor_msgs { module msg {
    struct JointState {
      std_msgs::msg::Header header;
      sequence<string> name;
      @unit (value="rad")
      sequence<double> position;
      sequence<double> velocity;
      sequence<double> effort;
    };
}; };
"""
GEOMETRY = """module geometry_msgs { module msg {
  /* Vectors and
     rotations */
  struct Vector3 { double x; double y; double z; };
  struct Quaternion { @default (value=0.0) double x; double y; double z; @default (value=1.0) double w; };
  struct Transform { Vector3 translation; ::geometry_msgs::msg::Quaternion rotation; };
  struct TransformStamped { std_msgs::msg::Header header; string child_frame_id; Transform transform; };
}; };
"""
TF = """module tf2_msgs { module msg {
  struct TFMessage { sequence<geometry_msgs::msg::TransformStamped> transforms; };
}; };
"""
FILES = {
    "builtin_interfaces/msg/Time": TIME,
    "std_msgs/msg/Header": HEADER,
    "sensor_msgs/msg/JointState": JOINT_STATE,
    "geometry_msgs/msg/TransformStamped": GEOMETRY,
    "tf2_msgs/msg/TFMessage": TF,
}
EVERYTHING = """
const unsigned long COUNT = 3;
const unsigned long SIZE = 9;
module a {
  const short SIZE = 2;
  enum Colour { RED, GREEN, @value(7) BLUE };
  @bit_bound(8) enum Small { ONE };
  typedef sequence<long long, 5> Longs;
  typedef double Matrix[SIZE][COUNT];
  struct Base { @key unsigned short id; };
  struct Forward;
  @final @extensibility(FINAL) struct All : Base {
    boolean flag, other; octet raw; char letter; int8 i; unsigned long long big;
    string<10> name; Colour colour; Small small; Longs longs; Matrix matrix;
    sequence<sequence<float>> nested; Base base; @optional(FALSE) string text[2];
  };
};
"""
JOINED = "".join(f"{LINE}\nIDL: {name}\n{text}\n" for name, text in FILES.items())


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copies.write_motion(tmp_path_factory.mktemp("source") / "motion.mcap", FRAMES)


def copied(source: Path, path: Path, encoding: str, text: str, name: str = "{0}") -> Path:
    """Write the messages of a recording with another encoding, text and name of their schemas."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        channels: dict[str, int] = {}
        for topic, kind, logged, data in copies.messages(source):
            if topic not in channels:
                schema = writer.register_schema(name.format(kind, *kind.split("/")), encoding, text.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], logged, data, logged)
        writer.finish()
    return path


@pytest.mark.parametrize(
    ("encoding", "text", "name"),
    [
        ("ros2idl", JOINED, "{0}"),
        ("ros2idl", JOINED.replace("\n", "\r\n"), "{0}"),
        ("omgidl", "\n".join(FILES.values()), "{1}::{2}::{3}"),
        ("omgidl", "\n".join(FILES.values()), "{1}/msg/{3}"),
        ("ros2msg", "", "{0}"),
        ("ros2idl", " \n", "{0}"),
        ("", "", "{0}"),
        ("unknown", "", "{1}::msg::dds_::{3}_"),
    ],
)
def test_every_way_to_define_gives_the_same_numbers(
    encoding: str, text: str, name: str, source: Path, tmp_path: Path
) -> None:
    path = copied(source, tmp_path / "a.mcap", encoding, text, name)
    expected, found = reba.read(source), reba.read(path)
    np.testing.assert_array_equal(found.data[list(COLUMNS)], expected.data[list(COLUMNS)])
    told = [warning for warning in info(path).warnings if "standard definition is used" in warning]
    assert len(told) == (0 if text.strip() else 2)
    assert not told or "does not define" in told[0]


def test_empty_definition_of_an_unknown_type_says_what_to_do(source: Path, tmp_path: Path) -> None:
    path = copied(source, tmp_path / "a.mcap", "ros2msg", "", "xsens_mvn_msgs/msg/LinkStateArray")
    assert "record again with the package of the type" in info(path).topics[0]["why"]


@pytest.mark.parametrize("store", ["ROS1_NOETIC", "ROS2_FOXY", "ROS2_HUMBLE", "ROS2_JAZZY"])
def test_standard_definitions_are_those_of_the_distributions(store: str) -> None:
    types, ros1 = get_typestore(Stores[store]), store.startswith("ROS1")
    for key in MEANINGS:
        candidates = standard_definitions(key, ros1=ros1)
        name = key.replace("/", "/msg/")
        if name not in types.fielddefs or not candidates:
            continue
        text = types.generate_msgdef(name, ros_version=1 if ros1 else 2)[0]
        expected = ros.parse(text, name, ros1=ros1)
        assert expected in [ros.parse(one, name, ros1=ros1) for one in candidates], name
    assert standard_definitions("sensor_msgs/JointState", ros1=ros1)


def test_idl_of_every_kind_of_member() -> None:
    root = idl.parse(EVERYTHING, "a::All")
    u1, base = Number("u1"), Struct("a::Base", (("id", Number("u2")),))
    assert dict(root.fields) == {
        "id": Number("u2"),
        **{"flag": u1, "other": u1, "raw": u1, "letter": u1, "i": Number("i1"), "big": Number("u8")},
        "name": Text(),
        "colour": Number("u4"),
        "small": u1,
        "longs": RosArray(Number("i8"), None),
        "matrix": RosArray(RosArray(Number("f8"), 3), 2),
        "nested": RosArray(RosArray(Number("f4"), None), None),
        "base": base,
        "text": RosArray(Text(), 2),
    }


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("module a { struct B { double c; };", "ends inside of module a"),
        ("module a { struct B { double c }; };", "expected ';'"),
        ("module a { struct C { double c; }; };", "does not define a/B"),
        ("module a { struct B { D c; }; };", "type D is not defined"),
        ("module a { struct B { sequence<B> c; }; };", "contains itself"),
        ("module a { struct B { @optional double c; }; };", "optional"),
        ("module a { struct B { wstring c; }; };", "wstring"),
        ("module a { struct B { double c[x]; }; };", "array of 'x'"),
        ("module a { union B switch (long) { case 1: double c; }; };", "'union'"),
        ("module a { typedef B C; typedef C B; struct D { C c; }; };", "does not define a/B"),
        ("struct B {", "ends inside"),
        ("@" * 1000, "expected a name"),
    ],
)
def test_idl_that_cannot_be_used_says_why(text: str, why: str) -> None:
    with pytest.raises(BadSchema, match=why.replace("(", ".")):
        idl.parse(text, "a/B")


@pytest.mark.parametrize("text", ["/*" * 300_000, '"' + r"\"" * 300_000, "'" * 300_001, "=" * 300_000, "::a" * 300_000])
def test_unclosed_text_takes_linear_time(text: str) -> None:
    start = time.monotonic()
    with pytest.raises(BadSchema):
        idl.parse(text, "a/B")
    assert time.monotonic() - start < 5


def test_aliases_in_a_circle_are_refused() -> None:
    with pytest.raises(BadSchema, match="contains itself"):
        idl.parse("module a { typedef B C; typedef C B; struct D { C c; }; };", "a/D")
