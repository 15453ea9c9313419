"""Walking one protobuf message by the FileDescriptorSet of its MCAP schema.

Wire format: https://protobuf.dev/programming-guides/encoding. Of descriptor.proto only the fields of `_DESCRIPTOR` are
read.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Final

from reba.readers.mcap.layout import VARINT, FieldSpan, Tree, Undecodable, Walked
from reba.readers.mcap.ros import BadSchema

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_DOUBLE, _FLOAT, _STRING, _MESSAGE, _DATA = 1, 2, 9, 11, 12
_REPEATED: Final = 3
_NUMBERS: Final = {_DOUBLE: ("<f8", _FIXED64), _FLOAT: ("<f4", _FIXED32)}
_DESCRIPTOR: Final = {
    "set.file": 1,
    "file.package": 2,
    "file.message": 4,
    "file.syntax": 12,
    "message.name": 1,
    "message.field": 2,
    "message.nested": 3,
    "field.name": 1,
    "field.number": 3,
    "field.label": 4,
    "field.type": 5,
    "field.type_name": 6,
    "field.oneof_index": 9,
}
"""Field numbers of google/protobuf/descriptor.proto."""
_MOST_DEPTH: Final = 32


@dataclass(frozen=True)
class Field:
    """One field of a message type; `implicit`: a number that is not written while it is zero."""

    name: str
    type: int
    type_name: str
    repeated: bool
    implicit: bool


Types = dict[str, dict[int, Field]]
"""Message types by full name with a leading dot, their fields by number."""


@dataclass(frozen=True)
class _WireField:
    """One field on the wire: `start` of its tag, `at` to `stop` its value (after the length of bytes)."""

    number: int
    wire: int
    start: int
    at: int
    stop: int
    value: int


def _varint(data: bytes, at: int, end: int) -> tuple[int, int]:
    value = 0
    for index in range(10):
        if at + index >= end:
            break
        byte = data[at + index]
        value |= (byte & 0x7F) << (7 * index)
        if byte < 0x80:
            return value, at + index + 1
    raise Undecodable(f"byte {at}: a varint does not end")


def _wire_fields(data: bytes, at: int, end: int) -> Iterator[_WireField]:
    while at < end:
        tag, value_at = _varint(data, at, end)
        wire, value = tag & 7, 0
        if wire == _VARINT:
            value, stop = _varint(data, value_at, end)
        elif wire == _BYTES:
            length, value_at = _varint(data, value_at, end)
            stop = value_at + length
        elif wire in (_FIXED64, _FIXED32):
            stop = value_at + (8 if wire == _FIXED64 else 4)
        else:
            raise Undecodable(f"byte {at}: wire type {wire} is not in use")
        if stop > end:
            raise Undecodable(f"byte {at}: a field of {stop - value_at} bytes exceeds the {end - value_at} left")
        yield _WireField(tag >> 3, wire, at, value_at, stop, value)
        at = stop


def parse(descriptor_set: bytes) -> Types:
    """Return the message types of a serialized FileDescriptorSet.

    Raises:
        BadSchema: the descriptor is damaged.
    """
    types: Types = {}
    try:
        for file in _wire_fields(descriptor_set, 0, len(descriptor_set)):
            if file.number == _DESCRIPTOR["set.file"]:
                package = _text(descriptor_set, file, "file.package")
                proto3 = _text(descriptor_set, file, "file.syntax") == "proto3"
                for message in _members(descriptor_set, file, "file.message"):
                    _add_type(types, descriptor_set, message, f".{package}" if package else "", proto3, 0)
    except (Undecodable, UnicodeDecodeError) as error:
        raise BadSchema(f"the protobuf descriptor is damaged ({error})") from error
    return types


def _members(data: bytes, piece: _WireField, what: str) -> list[_WireField]:
    if piece.wire != _BYTES:
        raise BadSchema("the protobuf descriptor is damaged")
    return [member for member in _wire_fields(data, piece.at, piece.stop) if member.number == _DESCRIPTOR[what]]


def _text(data: bytes, piece: _WireField, what: str) -> str:
    members = _members(data, piece, what)
    return data[members[-1].at : members[-1].stop].decode() if members else ""


def _value(data: bytes, piece: _WireField, what: str) -> int:
    members = _members(data, piece, what)
    return members[-1].value if members else 0


def _field(data: bytes, field: _WireField, proto3: bool) -> Field:
    kind, repeated = _value(data, field, "field.type"), _value(data, field, "field.label") == _REPEATED
    name, type_name = _text(data, field, "field.name"), _text(data, field, "field.type_name")
    # An `optional` one, as in every oneof, is absent where it has no value.
    alone = proto3 and not repeated and not _members(data, field, "field.oneof_index")
    return Field(name, kind, type_name, repeated, alone and kind in _NUMBERS)


def _add_type(types: Types, data: bytes, message: _WireField, prefix: str, proto3: bool, depth: int) -> None:
    if depth > _MOST_DEPTH:
        raise BadSchema("the protobuf descriptor nests too deep")
    name = f"{prefix}.{_text(data, message, 'message.name')}"
    types[name] = {
        _value(data, field, "field.number"): _field(data, field, proto3)
        for field in _members(data, message, "message.field")
    }
    for nested in _members(data, message, "message.nested"):
        _add_type(types, data, nested, name, proto3, depth + 1)


def walk(types: Types, name: str, message: bytes, texts: Collection[str]) -> Walked:
    """Return the fields of a message of the type `name` ("foxglove.JointStates"); `texts` as `names` in `ros.walk`.

    Absent fields are absent from the tree, but for numbers that are not written while they are zero.

    Raises:
        Undecodable: the bytes are not such a message.
    """
    walked = Walked()
    walked.tree = _struct(types, f".{name}", message, 0, len(message), texts, walked, 0)
    return walked


def _struct(
    types: Types,
    name: str,
    message: bytes,
    at: int,
    end: int,
    texts: Collection[str],
    walked: Walked,
    depth: int,
) -> Tree:
    if depth > _MOST_DEPTH or name not in types:
        raise Undecodable(f"type {name} is not in the descriptor or nests too deep")
    tree: dict[str, Tree] = {}
    for piece in _wire_fields(message, at, end):
        # Tag and length determine the places of all fields after them.
        walked.fixed.append((piece.start, piece.at))
        if piece.wire == _VARINT:
            walked.varints.append((piece.at, piece.stop))
        field = types[name].get(piece.number)
        if field is None:
            continue
        value: Tree
        if field.type == _MESSAGE and piece.wire == _BYTES:
            value = _struct(types, field.type_name, message, piece.at, piece.stop, texts, walked, depth + 1)
        else:
            value = _leaf(field, piece, message, texts, walked)
        if field.repeated:
            elements = tree.setdefault(field.name, [])
            if isinstance(elements, list):
                elements.extend(value if isinstance(value, list) else [value])
        else:
            tree[field.name] = value
    for field in types[name].values():
        if field.implicit:
            tree.setdefault(field.name, 0.0)
    return tree


def _leaf(field: Field, piece: _WireField, message: bytes, texts: Collection[str], walked: Walked) -> Tree:
    if field.type == _STRING and piece.wire == _BYTES:
        if field.name not in texts:
            return ""
        walked.fixed.append((piece.at, piece.stop))
        try:
            return message[piece.at : piece.stop].decode()
        except UnicodeDecodeError as error:
            raise Undecodable(f"byte {piece.at}: {field.name} is not UTF-8 text") from error
    if field.type == _DATA and piece.wire == _BYTES:
        return FieldSpan(piece.at, "<u1", piece.stop - piece.at, False)
    code, wire = _NUMBERS.get(field.type, (VARINT, _VARINT))
    if piece.wire == wire:
        return FieldSpan(piece.at, code, piece.stop - piece.at if wire == _VARINT else 1)
    if piece.wire == _BYTES and field.repeated and wire != _VARINT:
        size = int(code[-1])
        return list(FieldSpan(piece.at, code, (piece.stop - piece.at) // size, False).items())
    return None
