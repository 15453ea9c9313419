"""What viewers accept as the JSON schema of an MCAP channel, written down from their own parsers.

Foxglove Studio and Lichtblick (`parseJsonSchema.ts` in mcap-support, the same in both) turn a schema into data types.
Anything that they do not know is an error, after which the topic has no messages at all:

- the root, and every nested object, has the type "object" and a mapping `properties` (which may be empty);
- a property has one type: "boolean", "string", "number", "integer", "object" or "array". No list of types, no "null",
  no property without a type, and no `$ref`, `oneOf` or `anyOf` instead of one;
- a string has no `contentEncoding` or "base64";
- an array has `items` of one type that is not "array"; strings in it have no `contentEncoding`.

Properties of a message that the schema does not name are shown as text and never plotted.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

SCALARS: Mapping[str, tuple[type, ...]] = {
    "boolean": (bool,),
    "string": (str,),
    "number": (int, float),
    "integer": (int,),
}


def problems_of_schema(schema: Any, name: str = "root") -> list[str]:
    """Return why a viewer would refuse a schema, nothing if it would not."""
    if not isinstance(schema, Mapping) or schema.get("type") != "object":
        return [f"{name}: expected an object with the type object, got {schema!r}"]
    if not isinstance(schema.get("properties"), Mapping):
        return [f"{name}: an object without properties"]
    return [
        problem for key, value in schema["properties"].items() for problem in _problems(value, f"{name}.{key}", "array")
    ]


def _problems(schema: Any, name: str, nested: str) -> list[str]:
    kind = schema.get("type") if isinstance(schema, Mapping) else None
    if not isinstance(kind, str) or kind not in (*SCALARS, "object", nested):
        return [f"{name}: unsupported type {kind!r}"]
    if kind == "object":
        return problems_of_schema(schema, name)
    if kind == "array":
        return _problems(schema.get("items"), f"{name}[]", "object")
    allowed = (None, "base64") if nested == "array" else (None,)
    if kind == "string" and schema.get("contentEncoding") not in allowed:
        return [f"{name}: unsupported contentEncoding {schema['contentEncoding']!r}"]
    return []


def problems_of_message(schema: Mapping[str, Any], message: Any, name: str = "root") -> list[str]:
    """Return what of a message is not of the type that its schema states, absent properties aside."""
    kind = schema["type"]
    if kind in SCALARS:
        right = isinstance(message, SCALARS[kind]) and (kind == "boolean" or not isinstance(message, bool))
        return [] if right else [f"{name}: expected {kind}, got {message!r}"]
    if kind == "array":
        if not isinstance(message, list):
            return [f"{name}: expected an array, got {message!r}"]
        return [
            p for at, item in enumerate(message) for p in problems_of_message(schema["items"], item, f"{name}[{at}]")
        ]
    if not isinstance(message, dict):
        return [f"{name}: expected an object, got {message!r}"]
    known = schema["properties"]
    return [p for key in message.keys() & known for p in problems_of_message(known[key], message[key], f"{name}.{key}")]


def unnamed(schema: Mapping[str, Any], message: Mapping[str, Any]) -> set[str]:
    """Return the properties of a message that its schema does not name, which a viewer cannot plot."""
    return set(message) - set(schema["properties"])


def problems_of_texts(schema: bytes, messages: list[bytes]) -> list[str]:
    """Return what a viewer would refuse in a channel with this schema and these messages."""
    parsed = json.loads(schema)
    return problems_of_schema(parsed) or [p for text in messages for p in problems_of_message(parsed, json.loads(text))]
