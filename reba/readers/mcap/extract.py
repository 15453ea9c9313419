"""Extraction from a message tree: joint positions, poses or angles.

The numbers of a tree are spans (CDR, ROS 1, protobuf) or numbers (JSON); the same functions extract both.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import pandas as pd

from reba.posture.columns import COLUMNS, on_both_sides
from reba.posture.factors import FACTORS
from reba.readers.mcap.layout import FieldSpan, Undecodable
from reba.readers.mcap.trace import NO_STAMP

Value = FieldSpan | float | None
Stamp = tuple[Value, Value]
"""Seconds and nanoseconds."""
TEXTS: Final = frozenset({"name", "child_frame_id", "parent_frame_id", "frame_id"})
"""Text fields that determine the meaning of numbers; other text may differ between messages of one layout."""
POSE: Final = 7
"""Numbers of a pose: x y z [m], qx qy qz qw."""
LATEST: Final = 1e10
"""[s] Largest time stamp in seconds, the year 2286; larger numbers have another unit."""
_ISO_8601: Final = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(\.\d{1,9})?(Z|[+-]\d\d:?\d\d)?")
_XYZ, _XYZW = ("x", "y", "z"), ("x", "y", "z", "w")


@dataclass(frozen=True)
class SignalGroup:
    """k signals of a message with one time `stamp`, None if the message has none.

    Attributes:
        parents: frames only: k parent frames.
        values: k numbers, or 7 k of poses.
    """

    stamp: Stamp | None
    names: tuple[str, ...]
    parents: tuple[str, ...]
    values: tuple[Value, ...]

    def select(self, wanted: frozenset[str] | None) -> SignalGroup:
        """Return the group with the wanted names, each once (of several the last)."""
        if wanted is None and len(set(self.names)) == len(self.names):
            return self
        width = len(self.values) // max(len(self.names), 1)
        index = {name: at for at, name in enumerate(self.names) if wanted is None or name in wanted}
        if len(index) == len(self.names):
            return self
        positions = tuple(index.values())
        return SignalGroup(
            self.stamp,
            tuple(self.names[at] for at in positions),
            tuple(self.parents[at] for at in positions) if self.parents else (),
            tuple(value for at in positions for value in self.values[at * width : (at + 1) * width]),
        )


Extractor = Callable[[Any], list[SignalGroup]]


def fields_of(tree: Any) -> Mapping[str, Any]:
    """Return the fields of an object of a tree.

    Raises:
        Undecodable: it is none.
    """
    if not isinstance(tree, dict):
        raise Undecodable("an object was expected")
    return tree


def number(value: Any) -> Value:
    """Return a number of a tree; None for other values."""
    if isinstance(value, FieldSpan):
        return value if value.scalar else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if abs(value) < 1e300 or isinstance(value, float) else math.nan


def _numbers(values: list[Any]) -> list[Value]:
    """Return the numbers of a list; a list of floats, as of JSON, is returned unchanged."""
    return values if set(map(type, values)) == {float} else [number(value) for value in values]


def stamp_of(tree: Mapping[str, Any]) -> Stamp | None:
    """Return the time of a message: ROS `header.stamp`, Foxglove `timestamp`, a bare `stamp`, or `time`.

    In JSON it may be a number of seconds, or text as protobuf writes a `Timestamp` in JSON (ISO 8601; UTC without an
    offset).
    """
    header = tree.get("header")
    bare = next((tree[key] for key in ("timestamp", "stamp", "time") if key in tree), None)
    stamp = header.get("stamp") if isinstance(header, dict) else bare
    if isinstance(stamp, int | float) and not isinstance(stamp, bool) and abs(stamp) < LATEST:
        return 0, round(stamp * 1e9)
    if isinstance(stamp, str) and _ISO_8601.fullmatch(stamp):
        return 0, _nanoseconds_of(stamp)
    if not isinstance(stamp, dict):
        return None
    seconds = next((stamp[key] for key in ("sec", "secs", "seconds") if key in stamp), None)
    nanos = next((stamp[key] for key in ("nanosec", "nsec", "nsecs", "nanos") if key in stamp), 0)
    # Protobuf omits numbers that are zero.
    return _whole(seconds or 0), _whole(nanos or 0)


def _nanoseconds_of(text: str) -> int:
    try:
        return int(pd.Timestamp(text).as_unit("ns").value)
    except ValueError as error:
        raise Undecodable(f"the time stamp {text} is no date and time from 1678 to 2261") from error


def _whole(value: Any) -> Value:
    if isinstance(value, FieldSpan) and value.scalar and value.code[-2] != "f":
        return value
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 33:
        raise Undecodable("the time stamp is not in whole seconds and nanoseconds")
    return value


def _name(value: Any, what: str) -> str:
    if not isinstance(value, str):
        raise Undecodable(f"{what} is not text")
    return value


def extract_joints(tree: Any) -> list[SignalGroup]:
    """Return names and positions of a joint state, parallel arrays or a list of {name, position}.

    Raises:
        Undecodable: it has no joints, or not one position for each name.
    """
    joints = tree if isinstance(tree, list) else fields_of(tree).get("joints")
    if joints is None and isinstance(tree.get("name"), str):
        joints = [tree]  # foxglove.JointState: one joint
    stamp = stamp_of(tree) if isinstance(tree, dict) else None
    if isinstance(joints, list):
        items: list[Any] = joints if set(map(type, joints)) == {dict} else [fields_of(joint) for joint in joints]
        names: Any = [item.get("name", "") for item in items]
        positions = _numbers([item.get("position") for item in items])
    else:
        fields = fields_of(tree)
        names, values = fields.get("name"), fields.get("position")
        if isinstance(values, FieldSpan):
            positions = list(values.items())
        else:
            positions = _numbers(values) if isinstance(values, list) else []
    if not isinstance(names, list) or not names:
        raise Undecodable("it names no joints")
    if len(positions) != len(names):
        raise Undecodable(f"{len(positions)} positions for {len(names)} names")
    if set(map(type, names)) != {str}:
        raise Undecodable("a joint name is not text")
    return [SignalGroup(stamp, tuple(names), (), tuple(positions))]


def extract_transforms(tree: Any) -> list[SignalGroup]:
    """Return the transforms of a TFMessage, FrameTransforms or a single transform, one group for each.

    Raises:
        Undecodable: it has none, or one without frames.
    """
    fields = fields_of(tree)
    transforms = fields.get("transforms", [fields])
    if not isinstance(transforms, list) or not transforms:
        raise Undecodable("it has no transforms")
    return [_transform(fields_of(transform)) for transform in transforms]


def _transform(item: Mapping[str, Any]) -> SignalGroup:
    header = item.get("header")
    parent = header.get("frame_id") if isinstance(header, dict) else item.get("parent_frame_id", "")
    child = _name(item.get("child_frame_id", ""), "a frame name").strip("/")
    if not child:
        raise Undecodable("a transform names no child frame")
    inner = item.get("transform", item)
    values = _pose(fields_of(inner).get("translation", {}), fields_of(inner).get("rotation", {}))
    return SignalGroup(stamp_of(item), (child,), (_name(parent, "a frame name").strip("/"),), values)


def _pose(position: Any, rotation: Any) -> tuple[Value, ...]:
    # Protobuf omits numbers that are zero.
    return tuple(number(fields_of(position).get(axis, 0.0)) for axis in _XYZ) + tuple(
        number(fields_of(rotation).get(axis, 0.0)) for axis in _XYZW
    )


def extract_links(tree: Any) -> list[SignalGroup]:
    """Return the absolute segment poses of a LinkStateArray; a segment's name is the frame of its header.

    Raises:
        Undecodable: it has none, or one without a name or pose.
    """
    fields = fields_of(tree)
    states = fields.get("states")
    if not isinstance(states, list) or not states:
        raise Undecodable("it has no segments")
    names: list[str] = []
    values: list[Value] = []
    for state in map(fields_of, states):
        name = _name(fields_of(state.get("header")).get("frame_id"), "a segment name").strip("/")
        pose = fields_of(state.get("pose"))
        names.append(name)
        values.extend(_pose(pose.get("position"), pose.get("orientation")))
    # In some drivers the stamps of one message differ by microseconds; its segments are one frame.
    return [SignalGroup(stamp_of(fields) or stamp_of(states[0]), tuple(names), ("",) * len(names), tuple(values))]


def extract_angles(tree: Any) -> list[SignalGroup]:
    """Return the columns of one row of a posture table, which may have a time alone; `time` [s] becomes the stamp.

    Raises:
        Undecodable: it has neither a time nor one of the columns.
    """
    fields = on_both_sides(fields_of(tree))
    names = tuple(name for name in TABLE_COLUMNS if name in fields)
    if not names and "time" not in fields:
        raise Undecodable("it has none of the posture columns")
    time = fields.get("time")
    nanos = row_stamp(fields)
    stamp: Stamp | None = (time, 0) if isinstance(time, FieldSpan) else None if nanos == NO_STAMP else (0, nanos)
    values = tuple(float(v) if isinstance(v := fields[name], bool) else number(v) for name in names)
    return [SignalGroup(stamp, names, (), values)]


def extract_numbers(tree: Any) -> list[SignalGroup]:
    """Return every field of a row that is a number, by its name."""
    values = {name: value for name, field in fields_of(tree).items() if (value := number(field)) is not None}
    return [SignalGroup(None, tuple(values), (), tuple(values.values()))]


def row_stamp(row: Mapping[str, Any]) -> int:
    """Return the time [ns] of a row of a posture table, `NO_STAMP` without one."""
    time = number(row.get("time"))
    return round(time * 1e9) if isinstance(time, float) and abs(time) < 1e9 else NO_STAMP


TABLE_COLUMNS: Final = (*COLUMNS, "shoulder_raised_left", "shoulder_raised_right", *FACTORS)
"""Columns that a row of a posture table may have."""
