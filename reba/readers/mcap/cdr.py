"""Walking one message in CDR (ROS 2) or in the ROS 1 serialization by its schema.

CDR: OMG DDS-XTypes 1.3, section 7.4.3; alignment counts from behind the four-byte encapsulation header; an empty
sequence is not padded behind its count. ROS 1: http://wiki.ros.org/roscpp/Overview/MessagesSerializationAndAdaptingTypes,
little endian, nothing aligned, strings without a closing zero.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from reba.readers.mcap.layout import Span, Tree, Undecodable, Walked
from reba.readers.mcap.schema import Array, Number, Struct, Text, Type

_ENCAPSULATIONS: Final = {0: (">", 8), 1: ("<", 8), 6: (">", 4), 7: ("<", 4)}
"""Byte order and largest alignment of plain CDR by encapsulation kind (XTypes 1.3, table 60): XCDR1 and XCDR2."""
_HEADER: Final = 4
_SLACK: Final = 7
"""Writers may pad a message; more bytes than this behind the last field mean that the schema does not fit."""


def walk(root: Struct, message: bytes, names: Collection[str], *, ros1: bool) -> Walked:
    """Find the fields of a message.

    Args:
        root: its schema.
        message: its bytes.
        names: fields whose text belongs to the layout; other text may differ between messages of one layout.
        ros1: the serialization of ROS 1 instead of CDR.

    Raises:
        Undecodable: the message does not fit the schema.
    """
    walker = _Walker(message, names)
    if ros1:
        walker.align_most = walker.base = 0
    else:
        if len(message) < _HEADER or message[0] != 0 or message[1] not in _ENCAPSULATIONS:
            raise Undecodable(f"CDR header {message[:_HEADER].hex()} is not plain CDR")
        walker.order, walker.align_most = _ENCAPSULATIONS[message[1]]
        walker.at = _HEADER
        walker.walked.fixed.append((0, 2))
    walker.walked.tree = walker.struct(root)
    left = len(message) - walker.at
    if left > _SLACK:
        raise Undecodable(f"byte {walker.at}: {left} bytes are left behind the last field")
    return walker.walked


class _Walker:
    def __init__(self, message: bytes, names: Collection[str]) -> None:
        self.message = message
        self.names = names
        self.walked = Walked()
        self.order = "<"
        self.align_most = 8
        self.base = _HEADER
        self.at = 0

    def struct(self, struct: Struct) -> Tree:
        return {name: self.value(kind, name) for name, kind in struct.fields}

    def value(self, kind: Type, name: str) -> Tree:
        if isinstance(kind, Number):
            return self.numbers(kind.code, 1, scalar=True)
        if isinstance(kind, Text):
            return self.text(name)
        if isinstance(kind, Struct):
            return self.struct(kind)
        return self.array(kind, name)

    def array(self, kind: Array, name: str) -> Tree:
        count = self.count() if kind.length is None else kind.length
        if isinstance(kind.element, Number):
            return self.numbers(kind.element.code, count, scalar=False)
        # Every element takes at least one byte, so a count that cannot be is found before anything is made.
        if count > len(self.message) - self.at:
            raise Undecodable(f"byte {self.at}: array of {count} elements exceeds the message")
        return [self.value(kind.element, name) for _ in range(count)]

    def numbers(self, code: str, count: int, *, scalar: bool) -> Span:
        size = int(code[1])
        if count:
            self.align(size)
        start, stop = self.at, self.at + count * size
        if stop > len(self.message):
            raise Undecodable(
                f"byte {start}: {count} numbers of {size} bytes exceed the message of {len(self.message)}"
            )
        self.at = stop
        return Span(start, self.order + code, count, scalar)

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
            # CDR counts a closing zero, which some writers leave out.
            return self.message[start:stop].removesuffix(b"\0").decode()
        except UnicodeDecodeError as error:
            raise Undecodable(f"byte {start}: {name} is not UTF-8 text") from error

    def align(self, size: int) -> None:
        size = min(size, self.align_most)
        if size > 1:
            self.at += -(self.at - self.base) % size
