"""Message definitions in OMG IDL 4.2 (`ros2idl`, `omgidl`) as the tree of fields of `ros`, which walks the messages.

The part of the language that describes data is read: modules, structures, enumerations, type definitions, constants and
annotations. Grammar: https://www.omg.org/spec/IDL/4.2, section 7.4.1; how the files of ROS 2 are joined:
https://mcap.dev/spec/registry#ros2idl-data-format.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from reba.readers.mcap.ros import BadSchema, Number, RosArray, Struct, Text, Type

_TOKEN: Final = re.compile(
    r"(?P<gap>\s+|//[^\n]*|/\*.*?(?:\*/|\Z)|^\#[^\n]*|^=+[ \t]*$|^IDL:[^\n]*)"
    r"""|(?P<text>L?"(?:\\.|[^"\\\n])*"?|'(?:\\.|[^'\\\n])*'?)"""
    r"|(?P<word>(?:::)?[A-Za-z_]\w*(?:::[A-Za-z_]\w*)*)|(?P<number>\.?\d[\w.]*)|(?P<sign>.)",
    re.DOTALL | re.MULTILINE,
)
_NUMBERS: Final[Mapping[str, str]] = {
    "boolean": "u1",
    "octet": "u1",
    "char": "u1",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "short": "i2",
    "uint16": "u2",
    "unsigned short": "u2",
    "int32": "i4",
    "long": "i4",
    "uint32": "u4",
    "unsigned long": "u4",
    "int64": "i8",
    "long long": "i8",
    "uint64": "u8",
    "unsigned long long": "u8",
    "float": "f4",
    "double": "f8",
}
_WORDS: Final = ("unsigned", "long", "short", "double")
_ENUM_CODES: Final = ((8, "u1"), (16, "u2"), (32, "u4"))
_MOST_TOKENS: Final = 1 << 20
_MOST_DEPTH: Final = 32
_MOST_LENGTH: Final = 1 << 40
_REFUSED: Final = ("wchar", "wstring", "map", "any", "fixed", "bitset", "long double")


@dataclass
class _Member:
    """A declared name: its type as written, the lengths of its array."""

    name: str
    type: _Written
    lengths: list[str]
    optional: bool = False


@dataclass
class _Written:
    """A type as it is written: a name, or a sequence of an element."""

    name: str
    element: _Written | None = None


@dataclass
class _Definitions:
    """What a text defines, by scoped name."""

    structs: dict[str, tuple[str, list[_Member]]] = field(default_factory=dict)
    aliases: dict[str, _Member] = field(default_factory=dict)
    enums: dict[str, str] = field(default_factory=dict)
    constants: dict[str, str] = field(default_factory=dict)


def parse(text: str, name: str) -> Struct:
    """Return the tree of a definition.

    Args:
        text: one or more IDL files.
        name: of the type: "sensor_msgs/msg/JointState", "sensor_msgs::msg::JointState" or "foxglove.JointStates".

    Raises:
        BadSchema: it is no IDL, lacks a type, or uses one without a layout that is known (unions, maps, wide text).

    >>> parse("module a { struct B { sequence<double> c; long d[2]; }; };", "a/B").fields[1]
    ('d', RosArray(element=Number(code='i4'), length=2))
    """
    known = _Parser(text).definitions()
    parts = [part for part in re.split(r"/|::|\.", name) if part]
    bare = [part.removesuffix("_") for part in parts if part not in ("msg", "dds_")]
    for candidate in known.structs:
        if candidate.split("::") == parts or [part for part in candidate.split("::") if part != "msg"] == bare:
            return _Resolver(known).struct(candidate, 0)
    raise BadSchema(f"the IDL does not define {name}")


class _Parser:
    """Reads definitions from a text."""

    def __init__(self, text: str) -> None:
        self._tokens: list[tuple[str, str]] = []
        for match in _TOKEN.finditer(text.replace("\r\n", "\n").replace("\r", "\n")):
            if match.lastgroup != "gap":
                self._tokens.append((match.lastgroup or "", match.group()))
            if len(self._tokens) > _MOST_TOKENS:
                raise BadSchema(f"the IDL has more than {_MOST_TOKENS} words")
        self._at = 0
        self._known = _Definitions()

    def definitions(self) -> _Definitions:
        """Return what the text defines."""
        scope: list[str] = []
        while self._at < len(self._tokens):
            notes = self._annotations()
            word = self._next()
            if word == "module":
                scope.append(self._name())
                self._expect("{")
            elif word == "}" and scope:
                scope.pop()
                self._skip(";")
            elif word == "struct":
                self._struct(scope)
            elif word == "typedef":
                for member in self._members(notes):
                    self._known.aliases[_scoped(scope, member.name)] = member
            elif word == "enum":
                self._enum(scope, notes)
            elif word == "const":
                self._constant(scope)
            elif word != ";":
                raise BadSchema(
                    f"{word[:40]!r} in an IDL is not read: expected a module, struct, enum, typedef or const"
                )
        if scope:
            raise BadSchema(f"the IDL ends inside of module {'::'.join(scope)}")
        return self._known

    def _peek(self) -> str:
        return self._tokens[self._at][1] if self._at < len(self._tokens) else ""

    def _next(self) -> str:
        if self._at >= len(self._tokens):
            raise BadSchema("the IDL ends inside of a definition")
        self._at += 1
        return self._tokens[self._at - 1][1]

    def _name(self) -> str:
        if self._at >= len(self._tokens) or self._tokens[self._at][0] == "word":
            return self._next()
        raise BadSchema(f"{self._peek()[:40]!r} in an IDL, expected a name")

    def _expect(self, sign: str) -> None:
        if (word := self._next()) != sign:
            raise BadSchema(f"{word[:40]!r} in an IDL, expected {sign!r}")

    def _skip(self, sign: str) -> bool:
        """Return whether the next word is `sign`, and go beyond it."""
        next_is = self._peek() == sign
        self._at += next_is
        return next_is

    def _annotations(self) -> dict[str, str]:
        """Return the annotations of what follows: name -> what is in the brackets."""
        notes: dict[str, str] = {}
        while self._skip("@"):
            name, inside = self._name(), []
            if self._skip("("):
                depth = 1
                while depth:
                    word = self._next()
                    depth += (word == "(") - (word == ")")
                    inside.append(word)
            notes[name.lower()] = "".join(inside[:-1])
        return notes

    def _struct(self, scope: list[str]) -> None:
        name = _scoped(scope, self._name())
        if self._skip(";"):
            return
        base = self._name() if self._skip(":") else ""
        self._expect("{")
        members: list[_Member] = []
        while not self._skip("}"):
            members += self._members(self._annotations())
        self._known.structs[name] = (base, members)
        self._skip(";")

    def _members(self, notes: Mapping[str, str]) -> list[_Member]:
        """Return the members of one declaration: `type name[3], other;`."""
        written = self._type(0)
        members = []
        while True:
            name, lengths = self._name(), []
            while self._skip("["):
                lengths.append(self._next())
                self._expect("]")
            members.append(
                _Member(name, written, lengths, "optional" in notes and notes["optional"].lower() != "false")
            )
            if not self._skip(","):
                self._expect(";")
                return members

    def _type(self, depth: int) -> _Written:
        self._annotations()
        words = [self._name()]
        if words[0] == "sequence":
            if depth > _MOST_DEPTH:
                raise BadSchema("the sequences of an IDL nest too deep")
            self._expect("<")
            element = self._type(depth + 1)
            self._bound()
            self._expect(">")
            return _Written("sequence", element)
        while words[0] in _WORDS and self._peek() in _WORDS:
            words.append(self._next())
        if words[0] == "string" and self._skip("<"):
            self._next()
            self._expect(">")
        return _Written(" ".join(words))

    def _bound(self) -> None:
        if self._skip(","):
            self._annotations()
            self._next()

    def _enum(self, scope: list[str], notes: Mapping[str, str]) -> None:
        name = _scoped(scope, self._name())
        bits = notes.get("bit_bound", "32")
        self._known.enums[name] = next(
            (code for most, code in _ENUM_CODES if bits.isdecimal() and int(bits[:4]) <= most), "u4"
        )
        while self._next() != "}":
            pass
        self._skip(";")

    def _constant(self, scope: list[str]) -> None:
        self._type(0)
        name = _scoped(scope, self._name())
        self._expect("=")
        self._known.constants[name] = self._next()
        while self._next() != ";":
            pass


class _Resolver:
    """Turns written types into those of `ros`; each structure once, however often others contain it."""

    def __init__(self, known: _Definitions) -> None:
        self._known = known
        self._structs: dict[str, Struct] = {}

    def struct(self, name: str, depth: int) -> Struct:
        """Return a structure with the fields of those it is derived from."""
        if name in self._structs:
            return self._structs[name]
        if depth > _MOST_DEPTH:
            raise BadSchema(f"type {name} contains itself")
        base, members = self._known.structs[name]
        scope = name.split("::")[:-1]
        fields: list[tuple[str, Type]] = []
        if base:
            fields += self.struct(self._defined(base, scope, self._known.structs), depth + 1).fields
        for member in members:
            if member.optional:
                raise BadSchema(f"{member.name} of {name} is optional, which has no fixed layout")
            fields.append((member.name, self._declared(member, scope, depth)))
        # As for messages: an empty structure has one byte.
        self._structs[name] = Struct(name, tuple(fields or [("structure_needs_at_least_one_member", Number("u1"))]))
        return self._structs[name]

    def _declared(self, member: _Member, scope: list[str], depth: int) -> Type:
        kind = self._type(member.type, scope, depth)
        for length in reversed(member.lengths):
            kind = RosArray(kind, self._length(length, scope))
        return kind

    def _type(self, written: _Written, scope: list[str], depth: int) -> Type:
        if depth > _MOST_DEPTH:
            raise BadSchema(f"type {written.name} contains itself")
        if written.element is not None:
            return RosArray(self._type(written.element, scope, depth + 1), None)
        if written.name in _NUMBERS:
            return Number(_NUMBERS[written.name])
        if written.name == "string":
            return Text()
        if written.name in _REFUSED:
            raise BadSchema(f"{written.name} has no portable layout")
        for candidate in _candidates(written.name, scope):
            if candidate in self._known.structs:
                return self.struct(candidate, depth + 1)
            if candidate in self._known.aliases:
                return self._declared(self._known.aliases[candidate], candidate.split("::")[:-1], depth + 1)
            if candidate in self._known.enums:
                return Number(self._known.enums[candidate])
        raise BadSchema(f"type {written.name} is not defined in the IDL")

    def _length(self, text: str, scope: list[str]) -> int:
        """Return the length of an array, a number or the name of a constant."""
        constants = self._known.constants
        text = next((constants[one] for one in _candidates(text, scope) if one in constants), text)
        if not text.isdecimal() or len(text) > len(str(_MOST_LENGTH)):
            raise BadSchema(f"an array of {text[:20]!r} elements")
        return int(text)

    @staticmethod
    def _defined(name: str, scope: list[str], known: Mapping[str, object]) -> str:
        for candidate in _candidates(name, scope):
            if candidate in known:
                return candidate
        raise BadSchema(f"type {name} is not defined in the IDL")


def _scoped(scope: list[str], name: str) -> str:
    return "::".join([*scope, name])


def _candidates(name: str, scope: list[str]) -> list[str]:
    """Return the names that a name in a scope may stand for, the innermost first."""
    if name.startswith("::"):
        return [name[2:]]
    return [_scoped(scope[:depth], name) for depth in range(len(scope), -1, -1)]
