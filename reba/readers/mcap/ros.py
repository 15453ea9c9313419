"""ROS messages: definitions (ros1msg and ros2msg text) as a tree of fields; walking one CDR or ROS 1 message by it.

Grammar: https://design.ros2.org/articles/legacy_interface_definition.html and http://wiki.ros.org/msg; the
concatenated form with `MSG:` sections: https://mcap.dev/spec/registry#ros2msg.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from reba.readers.mcap.bytes import ZSTD_MAGIC
from reba.readers.mcap.layout import FieldSpan, Tree, Undecodable, Walked

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
_MOST_DIGITS: Final = 12
"""Of the length of an array."""
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
class RosArray:
    """Elements of one type; `length` None for a sequence that carries its own count."""

    element: Type
    length: int | None


@dataclass(frozen=True)
class Struct:
    """Named fields in the order of the wire."""

    name: str
    fields: tuple[tuple[str, Type], ...]


Type: TypeAlias = Number | Text | RosArray | Struct


def parse(text: str, name: str, *, ros1: bool = False) -> Struct:
    """Return the tree of a message definition.

    Args:
        text: the definition, followed by those it needs.
        name: its type name, "sensor_msgs/msg/JointState" or "sensor_msgs/JointState".
        ros1: whether it is a ROS 1 definition.

    Raises:
        BadSchema: a line is not a field, a type is unknown, recursive or without portable layout (wstring).

    >>> parse("int32[2] a", "x/Y").fields
    (('a', RosArray(element=Number(code='i4'), length=2)),)
    """
    root = _short(name)
    texts = dict(_BUILTIN)
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    for index, section in enumerate(_SECTION.split(text)):
        head, _, body = section.lstrip().partition("\n")
        if index == 0:
            texts[root] = section
        elif head.startswith("MSG:"):
            texts[_short(head[4:].strip())] = body
        elif head.strip():
            raise BadSchema(f"the definition has a section {head[:40]!r} instead of 'MSG: ...'")
    return _struct(root, texts, ros1, 0, {})


def _short(name: str) -> str:
    return name.replace("/msg/", "/")


def _struct(name: str, texts: Mapping[str, str], ros1: bool, depth: int, known: dict[str, Struct]) -> Struct:
    """Return a type; each is parsed once, however often others contain it (`known`)."""
    if name in known:
        return known[name]
    if depth > _MOST_DEPTH:
        raise BadSchema(f"type {name} contains itself")
    fields = []
    for line in texts[name].splitlines():
        stripped = line.strip()
        if not stripped or stripped.startswith("#"):
            continue
        match = _FIELD.match(stripped)
        if match is None:
            raise BadSchema(f"{stripped[:60]!r} in {name} is not a field")
        if match["rest"].startswith("="):
            continue
        element = _type(match["type"], name, texts, ros1, depth, known)
        fields.append((match["name"], _array(element, match["array"])))
    if not fields and not ros1:
        # ROS 2 fills an empty message with one byte.
        fields.append(("structure_needs_at_least_one_member", Number("u1")))
    known[name] = Struct(name, tuple(fields))
    return known[name]


def _array(element: Type, brackets: str | None) -> Type:
    if brackets is None:
        return element
    length = brackets[1:-1]
    if len(length) > _MOST_DIGITS:
        raise BadSchema(f"an array of {length[:20]}... elements")
    return RosArray(element, int(length) if length.isdecimal() else None)


def _type(name: str, inside: str, texts: Mapping[str, str], ros1: bool, depth: int, known: dict[str, Struct]) -> Type:
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
            return _struct(candidate, texts, ros1, depth + 1, known)
    raise BadSchema(f"type {name} of {inside} is not defined in the schema")


_CDR: Final = ((False, False),)
_CDR2: Final = ((True, False), (False, False))
_D_CDR2: Final = ((True, True), (False, True))
_ENCAPSULATIONS: Final = {
    0: (">", 8, _CDR),
    1: ("<", 8, _CDR),
    6: (">", 4, _CDR2),
    7: ("<", 4, _CDR2),
    8: (">", 4, _D_CDR2),
    9: ("<", 4, _D_CDR2),
}
"""Byte order, largest alignment, and whether collections and structures have a delimiter header, by encapsulation kind
(XTypes 1.3, table 60 and rules 12 to 30). Collections should in XCDR2, but some writers leave theirs out."""
_HEADER: Final = 4
_FREE_STRUCTS: Final = 1000
_DEEP: Final = 8
"""Elements that a message may hold for each of its bytes, beyond `_FREE_STRUCTS`: nested ones share their bytes."""
_SLACK: Final = 7
"""[bytes] Writers may pad a message; more than this after the last field mean that the schema does not fit."""


def walk(root: Struct, message: bytes, names: Collection[str], *, ros1: bool) -> Walked:
    """Return the fields of a message and the bytes that determine its layout.

    Args:
        root: its schema.
        message: its bytes.
        names: fields whose value belongs to the layout; other text may differ between messages of one layout.
        ros1: the serialization of ROS 1 instead of CDR.

    Raises:
        Undecodable: the message does not fit the schema.
    """
    if ros1:
        walker = _Walker(message, names)
        walker.align_most = walker.base = 0
        return _walk(walker, root)
    if message.startswith(ZSTD_MAGIC):
        raise Undecodable("its zstd data are damaged or state no size")
    if len(message) < _HEADER or message[0] != 0 or message[1] not in _ENCAPSULATIONS:
        raise Undecodable(f"CDR header {message[:_HEADER].hex()} is not plain CDR")
    order, align_most, ways = _ENCAPSULATIONS[message[1]]

    def walked(way: tuple[bool, bool]) -> Walked:
        walker = _Walker(message, names)
        walker.order, walker.align_most = order, align_most
        walker.delimited_collections, walker.delimited_structs = way
        walker.at = _HEADER
        walker.walked.fixed.append((0, 2))
        return _walk(walker, root)

    for way in ways[:-1]:
        with suppress(Undecodable):
            return walked(way)
    return walked(ways[-1])


def _walk(walker: _Walker, root: Struct) -> Walked:
    try:
        walker.walked.tree = walker.struct(root)
    except RecursionError as error:
        raise Undecodable(f"byte {walker.at}: its types nest too deep") from error
    left = len(walker.message) - walker.at
    if left > _SLACK:
        raise Undecodable(f"byte {walker.at}: {left} bytes are left after the last field")
    return walker.walked


class _Walker:
    def __init__(self, message: bytes, names: Collection[str]) -> None:
        self.message = message
        self.names = names
        self.walked = Walked()
        self.order = "<"
        self.align_most = 8
        self.delimited_collections = self.delimited_structs = False
        self.base = _HEADER
        self.at = 0
        self.left = _FREE_STRUCTS + _DEEP * len(message)

    def struct(self, struct: Struct) -> Tree:
        # Types without bytes could nest and repeat without end.
        self.left -= 1
        if self.left < 0:
            raise Undecodable(f"byte {self.at}: more elements than the message of {len(self.message)} bytes can hold")
        end = self.delimiter() if self.delimited_structs else None
        tree: dict[str, Tree] = {name: self.value(kind, name) for name, kind in struct.fields}
        if end is not None:
            if self.at > end:
                raise Undecodable(f"byte {self.at}: {struct.name} is longer than its delimiter header states")
            self.at = end  # fields of a later version
        return tree

    def delimiter(self) -> int:
        """Return where what follows its delimiter header ends."""
        size = self.count()
        if size > len(self.message) - self.at:
            raise Undecodable(f"byte {self.at}: {size} bytes by a delimiter header exceed the message")
        return self.at + size

    def value(self, kind: Type, name: str) -> Tree:
        if isinstance(kind, Number):
            span = self.numbers(kind.code, 1, scalar=True)
            return self.fixed_number(span) if name in self.names else span
        if isinstance(kind, Text):
            return self.text(name)
        if isinstance(kind, Struct):
            return self.struct(kind)
        return self.array(kind, name)

    def array(self, kind: RosArray, name: str) -> Tree:
        """Return the elements; those that are no numbers have at least one byte, or are counted by `left`."""
        delimited = self.delimited_collections and not isinstance(kind.element, Number)
        end = self.delimiter() if delimited else None
        count = self.count() if kind.length is None else kind.length
        if isinstance(kind.element, Number):
            return self.numbers(kind.element.code, count, scalar=False)
        if count > len(self.message) - self.at:
            raise Undecodable(f"byte {self.at}: array of {count} elements exceeds the message")
        elements = [self.value(kind.element, name) for _ in range(count)]
        if end not in (None, self.at):
            raise Undecodable(f"byte {self.at}: an array ends elsewhere than its delimiter header states")
        return elements

    def numbers(self, code: str, count: int, *, scalar: bool) -> FieldSpan:
        size = int(code[1])
        if count:
            self.align(size)
        start, stop = self.at, self.at + count * size
        if stop > len(self.message):
            raise Undecodable(
                f"byte {start}: {count} numbers of {size} bytes exceed the message of {len(self.message)}"
            )
        self.at = stop
        return FieldSpan(start, self.order + code, count, scalar)

    def fixed_number(self, span: FieldSpan) -> float:
        self.walked.fixed.append((span.start, self.at))
        value: float = np.frombuffer(self.message, span.code, 1, span.start)[0].item()
        return value

    def count(self) -> int:
        span = self.numbers("u4", 1, scalar=True)
        self.walked.fixed.append((span.start, self.at))
        order = "little" if self.order == "<" else "big"
        return int.from_bytes(self.message[span.start : self.at], order)  # type: ignore[arg-type]

    def text(self, name: str) -> str:
        length = self.count()
        start, stop = self.at, self.at + length
        if stop > len(self.message):
            raise Undecodable(f"byte {start}: string length {length} exceeds the message of {len(self.message)}")
        self.at = stop
        if name not in self.names:
            return ""
        self.walked.fixed.append((start, stop))
        try:
            # CDR counts a terminating zero, which some writers omit.
            return self.message[start:stop].removesuffix(b"\0").decode()
        except UnicodeDecodeError as error:
            raise Undecodable(f"byte {start}: {name} is not UTF-8 text") from error

    def align(self, size: int) -> None:
        size = min(size, self.align_most)
        if size > 1:
            self.at += -(self.at - self.base) % size
