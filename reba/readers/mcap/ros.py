"""ROS message definitions (ros1msg and ros2msg text) as a tree of fields.

Grammar: https://design.ros2.org/articles/legacy_interface_definition.html and http://wiki.ros.org/msg; the
concatenated form with `MSG:` sections: https://mcap.dev/spec/registry#ros2msg.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

PRIMITIVES: Final[Mapping[str, str]] = {
    "bool": "u1",
    "byte": "u1",
    "char": "u1",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
"""Primitive types and their numpy codes without byte order."""

_BUILTIN: Final[Mapping[str, str]] = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
    "time": "uint32 sec\nuint32 nanosec",
    "duration": "int32 sec\nint32 nanosec",
}
"""Types whose definitions may be left out of a schema."""

_MOST_DEPTH: Final = 32
_SECTION = re.compile(r"^=+[ \t]*$", re.MULTILINE)
_FIELD = re.compile(
    r"^(?P<type>[A-Za-z][\w/]*)(?:<=\d+)?(?P<array>\[(?:<=)?\d*\])?[ \t]+(?P<name>[A-Za-z]\w*)[ \t]*(?P<rest>.*)$"
)


class BadSchema(Exception):
    """A message definition that cannot be used."""


@dataclass(frozen=True)
class Number:
    """A number; `code` is its numpy type without byte order."""

    code: str


@dataclass(frozen=True)
class Text:
    """A string."""


@dataclass(frozen=True)
class Array:
    """Elements of one type; `length` None for a sequence that carries its own count."""

    element: Type
    length: int | None


@dataclass(frozen=True)
class Struct:
    """Named fields in the order of the wire."""

    name: str
    fields: tuple[tuple[str, Type], ...]


Type: TypeAlias = Number | Text | Array | Struct


def parse(text: str, name: str, *, ros1: bool = False) -> Struct:
    """Return the tree of a message definition.

    Args:
        text: the definition, followed by those it needs.
        name: its type name, "sensor_msgs/msg/JointState" or "sensor_msgs/JointState".
        ros1: whether it is written in the older dialect.

    Raises:
        BadSchema: a line is no field, a type is unknown, recursive or has no fixed layout (wstring).

    >>> parse("int32[2] a", "x/Y").fields
    (('a', Array(element=Number(code='i4'), length=2)),)
    """
    root = _short(name)
    texts = dict(_BUILTIN)
    for index, section in enumerate(_SECTION.split(text)):
        head, _, body = section.lstrip().partition("\n")
        if index == 0:
            texts[root] = section
        elif head.startswith("MSG:"):
            texts[_short(head[4:].strip())] = body
        elif head.strip():
            raise BadSchema(f"the definition has a section {head[:40]!r} instead of 'MSG: ...'")
    return _struct(root, texts, ros1, 0)


def _short(name: str) -> str:
    return name.replace("/msg/", "/")


def _struct(name: str, texts: Mapping[str, str], ros1: bool, depth: int) -> Struct:
    if depth > _MOST_DEPTH:
        raise BadSchema(f"type {name} contains itself")
    fields = []
    for line in texts[name].splitlines():
        stripped = line.strip()
        if not stripped or stripped.startswith("#"):
            continue
        match = _FIELD.match(stripped)
        if match is None:
            raise BadSchema(f"{stripped[:60]!r} in {name} is no field")
        if match["rest"].startswith("="):
            continue
        element = _type(match["type"], name, texts, ros1, depth)
        fields.append((match["name"], _array(element, match["array"])))
    if not fields and not ros1:
        # ROS 2 fills an empty message with one byte.
        fields.append(("structure_needs_at_least_one_member", Number("u1")))
    return Struct(name, tuple(fields))


def _array(element: Type, brackets: str | None) -> Type:
    if brackets is None:
        return element
    length = brackets[1:-1]
    return Array(element, int(length) if length.isdigit() else None)


def _type(name: str, inside: str, texts: Mapping[str, str], ros1: bool, depth: int) -> Type:
    if name in PRIMITIVES:
        return Number(PRIMITIVES[name])
    if name == "string":
        return Text()
    if name == "wstring":
        raise BadSchema("wstring has no portable layout")
    package = inside.rpartition("/")[0]
    candidates = [_short(name), f"{package}/{name}", f"std_msgs/{name}"]
    candidates += [known for known in texts if "/" not in name and known.endswith(f"/{name}")]
    for candidate in candidates:
        if candidate in texts:
            return _struct(candidate, texts, ros1, depth + 1)
    raise BadSchema(f"type {name} of {inside} is not defined in the schema")
