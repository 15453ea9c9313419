"""Plain data -> CDR bytes by a ROS 2 message definition.

XCDR1, little endian: numbers stand at multiples of their size, counted from after the header; texts and sequences
carry their length (OMG DDS-XTypes 1.3, section 7.4.1).
"""

from __future__ import annotations

import struct
from functools import cache
from typing import Any, Final

from lgp.execution.messages import DEFINITIONS
from reba.readers.mcap.schema import Array, Number, Struct, Text, Type, parse

HEADER: Final = b"\x00\x01\x00\x00"
_CODES: Final = {
    "u1": "B", "i1": "b", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q", "f4": "f", "f8": "d",
}  # fmt: skip


def encode(kind: str, value: dict[str, Any]) -> bytes:
    """Return a message of a type in `messages.DEFINITIONS`.

    Raises:
        KeyError: the type is not there, or a field is missing.

    >>> encode("tf2_msgs/msg/TFMessage", {"transforms": []})
    b'\\x00\\x01\\x00\\x00\\x00\\x00\\x00\\x00'
    """
    body = bytearray()
    _write(_layout(kind), value, body)
    return HEADER + bytes(body)


@cache
def _layout(kind: str) -> Struct:
    return parse(DEFINITIONS[kind], kind)


def _write(kind: Type, value: Any, body: bytearray) -> None:
    if isinstance(kind, Struct):
        for name, inner in kind.fields:
            _write(inner, value[name], body)
    elif isinstance(kind, Number):
        _numbers(kind.code, [value], body)
    elif isinstance(kind, Text):
        text = value.encode() + b"\0"
        _numbers("u4", [len(text)], body)
        body += text
    else:
        _sequence(kind, value, body)


def _sequence(kind: Array, value: list[Any], body: bytearray) -> None:
    if kind.length is None:
        _numbers("u4", [len(value)], body)
    if isinstance(kind.element, Number):
        _numbers(kind.element.code, value, body)
    else:
        for item in value:
            _write(kind.element, item, body)


def _numbers(code: str, values: list[Any], body: bytearray) -> None:
    """Write numbers one after the other, the first at a multiple of their size; none need no gap."""
    if values:
        size = int(code[1])
        body += bytes(-len(body) % size)
        body += struct.pack(f"<{len(values)}{_CODES[code]}", *values)
