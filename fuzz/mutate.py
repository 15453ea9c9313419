"""Structure-aware mutations of valid inputs: bytes, words of a text, nodes of JSON, records of MCAP, packed files.

Each takes a `random.Random` and a valid input and returns a damaged one; the same generator state gives the same input.
"""

from __future__ import annotations

import gzip
import io
import json
import random
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence
from typing import Any

LONGEST = 1 << 18
"""Inputs are cut to this length [bytes], so that time and memory depend on the reader and not on the input."""

INTEGERS = (0, 1, 2, -1, 127, 255, 256, 0x7FFF, 0xFFFF, 0x7FFF_FFFF, 0xFFFF_FFFF, 1 << 45, (1 << 62) + 7, (1 << 64) - 1)
FLOATS = (float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 1e-308, 5e-324, -1.0, 0.0, 1e30)
NUMBERS = (
    *("nan", "inf", "-inf", "NaN", "1e308", "-1e308", "1e999", "1e-320", "-1", "0", "-0.0", "1", "2", "1.5", "1000000"),
    *("2147483647", "4294967296", "9223372036854775808", "99999999999999999999", "1_0", "0x10", "+5", "1e", ".", "٣"),
    "9" * 5000,
)
WORDS = (
    *("", "a", "time", "true", "false", "null", "None", "x" * 3000, "\x00", "\ufeff", "\u202e", "é", "\n", "\r", "\t"),
    *('"', "'", ",", ";", "{", "}", "[", "]", "(", ")", "<", ">", "&amp;", "&a;", "#", "\\", "\\ud800", "%s", "{0}"),
    *("../../x", "?x", "-", "and", "not", "object", "<!DOCTYPE a [<!ENTITY b 'c'>]>", "]]>", "/dev/zero"),
)
VALUES = (
    *('""', '"x"', "[]", "{}", "[[]]", "[1]", "[1, 2]", "[1, 2, 3]", '["a"]', "[nan, nan, nan]", "[1e308, -1e308]"),
    *("true", "false", "1979-05-27", "1979-05-27T07:32:00Z", "{a = 1}", "[{}]", '"\\u0000"', '"\\n"', "[0, 0, 0]"),
    '"' + "y" * 5000 + '"',
)
"""Values as TOML writes them."""

NEST = "\u0000NEST\u0000"
"""Stands for deep nesting until the text is written, which a recursive writer could not do."""
_TOKEN = re.compile(r"[-+]?\d[\w.+-]*|[^\W\d]\w*|\s+|.", re.DOTALL)
_NUMBER = re.compile(r"[-+]?\d")
_ASSIGNED = re.compile(r"^(\s*[\w.\"-]+\s*=\s*)(.+)$", re.MULTILINE)

Mutation = Callable[[random.Random, bytes, Sequence[bytes]], bytes]


def mutate_bytes(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Data after one to four changes of bytes, numbers, lengths and order.

    Args:
        rng: of all choices.
        data: a valid input.
        seeds: other valid inputs, to splice with.
    """
    changed = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        if not changed:
            break
        _BYTE_CHANGES[rng.randrange(len(_BYTE_CHANGES))](rng, changed, seeds)
    return bytes(changed[:LONGEST])


def mutate_text(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Text after one to four changes of numbers, words, lines and nesting; sometimes of its bytes."""
    if rng.random() < 0.1:
        return mutate_bytes(rng, data, seeds)
    text = data.decode("utf-8", "surrogateescape")
    for _ in range(rng.randint(1, 4)):
        text = _TEXT_CHANGES[rng.randrange(len(_TEXT_CHANGES))](rng, text)
    return text.encode("utf-8", "surrogateescape")[:LONGEST]


def mutate_json(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """JSON text after one to three changes of its tree; sometimes of its text."""
    if rng.random() < 0.15:
        return mutate_text(rng, data, seeds)
    tree = json.loads(data)
    for _ in range(rng.randint(1, 3)):
        tree = _change_node(rng, tree)
    text = json.dumps(tree)
    if rng.random() < 0.1 and text.startswith("{") and isinstance(tree, dict) and tree:
        key = rng.choice(list(tree))
        text = "{" + f"{json.dumps(key)}: {_json_value(rng)}, " + text[1:]
    depth = rng.choice([10, 500, 100_000])
    return text.replace(json.dumps(NEST), "[" * depth + "]" * depth).encode("utf-8", "surrogatepass")[:LONGEST]


def mutate_json_lines(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Text of JSON lines with one of them changed, removed, repeated or cut."""
    lines = data.splitlines(keepends=True)
    at = rng.randrange(len(lines))
    kind = rng.randrange(5)
    if kind == 0:
        lines.insert(rng.randrange(len(lines) + 1), lines[at])
    elif kind == 1:
        lines[at] = lines[at][: rng.randrange(len(lines[at]))]
    else:
        lines[at] = mutate_json(rng, lines[at], seeds) + b"\n"
    return b"".join(lines)[:LONGEST]


def mutate_mcap(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """MCAP file damaged inside its chunks, with correct checksums, or anywhere in its bytes."""
    if rng.random() < 0.4:
        return mutate_bytes(rng, data, seeds)
    records = [
        (opcode, _changed_chunk(rng, content, seeds) if opcode == _CHUNK else content)
        for opcode, content in _records(data[8:-8])
        if opcode in _KEPT
    ]
    if rng.random() < 0.2:
        at = rng.randrange(len(records))
        records[at] = records[at][0], mutate_bytes(rng, records[at][1], seeds)
    footer = _record(2, bytes(20))
    return (data[:8] + b"".join(_record(*one) for one in records) + footer + data[:8])[:LONGEST]


_CHUNK = 6
_KEPT = (1, 3, 4, 5, _CHUNK, 12, 15)
"""Records of the data section; the index after it is left out, because readers do not need it."""


def mutate_zip(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """An archive of which one file is changed and packed again with its right checksum, or whose bytes are changed."""
    if not rng.randrange(4):
        return mutate_bytes(rng, data, seeds)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice(sorted(files))
    change = mutate_text if name.endswith((".xml", ".rels")) else mutate_bytes
    files[name] = change(rng, files[name], [files[name]])
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name), content)
    return buffer.getvalue()


def mutate_gzip(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """A packed text that is changed and packed again with its right checksum, or whose packed bytes are changed."""
    if not rng.randrange(3):
        return mutate_bytes(rng, data, seeds)
    return gzip.compress(mutate_text(rng, gzip.decompress(data), [gzip.decompress(seed) for seed in seeds]), mtime=0)


def _records(data: bytes) -> list[tuple[int, bytes]]:
    records, at = [], 0
    while at + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        records.append((opcode, data[at + 9 : at + 9 + length]))
        at += 9 + length
    return records


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def _changed_chunk(rng: random.Random, content: bytes, seeds: Sequence[bytes]) -> bytes:
    """Chunk stored unpacked, with some of its records changed and a correct checksum."""
    import lz4.frame
    import zstandard

    first, last, size, _, named = struct.unpack_from("<QQQII", content)
    kind = content[32 : 32 + named].decode()
    packed = content[32 + named + 8 :]
    inner = packed
    if kind == "zstd":
        inner = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    elif kind == "lz4":
        inner = lz4.frame.decompress(packed)
    records = _records(inner)
    for _ in range(rng.randint(1, 3)):
        at = rng.randrange(len(records))
        # Definitions are few and matter most.
        few = [index for index, (opcode, _) in enumerate(records) if opcode in (3, 4)]
        if few and rng.random() < 0.4:
            at = rng.choice(few)
        opcode, old = records[at]
        records[at] = opcode, (mutate_text if opcode == 3 and rng.random() < 0.7 else mutate_bytes)(rng, old, seeds)
    inner = b"".join(_record(*one) for one in records)
    return struct.pack("<QQQII", first, last, len(inner), zlib.crc32(inner), 0) + struct.pack("<Q", len(inner)) + inner


def _place(rng: random.Random, data: bytearray) -> int:
    # Heads of files hold the counts and lengths.
    return rng.randrange(min(len(data), 600) if rng.random() < 0.4 else len(data))


def _flip(rng: random.Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    data[_place(rng, data)] ^= 1 << rng.randrange(8)


def _put_byte(rng: random.Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    data[_place(rng, data)] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)])


def _put_integer(rng: random.Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    at, width = _place(rng, data), rng.choice([1, 2, 4, 8])
    value = rng.choice(INTEGERS) if rng.random() < 0.8 else rng.randrange(1 << 8 * width)
    piece = (value % (1 << 8 * width)).to_bytes(width, rng.choice(["little", "big"]))
    data[at : at + width] = piece


def _put_float(rng: random.Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    at, kind = _place(rng, data), rng.choice(["<d", ">d", "<f", ">f"])
    try:
        piece = struct.pack(kind, rng.choice(FLOATS))
    except OverflowError:
        piece = struct.pack(kind, float("inf"))
    data[at : at + len(piece)] = piece


def _cut(rng: random.Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    del data[rng.randrange(len(data)) :]


def _delete(rng: random.Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    at = _place(rng, data)
    del data[at : at + rng.choice([1, 2, 4, 8, 16, 100, 1000])]


def _insert(rng: random.Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    at = _place(rng, data)
    data[at:at] = rng.randbytes(rng.choice([1, 2, 4, 8, 100]))


def _double(rng: random.Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    at, length = _place(rng, data), rng.choice([1, 8, 40, 400])
    data[at:at] = data[at : at + length] * rng.choice([1, 1, 1, 100])


def _splice(rng: random.Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    other = rng.choice(seeds)
    data[rng.randrange(len(data)) :] = other[rng.randrange(len(other)) :]


def _swap(rng: random.Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    length = rng.choice([1, 4, 8, 64])
    one, two = _place(rng, data), _place(rng, data)
    data[one : one + length], data[two : two + length] = data[two : two + length], data[one : one + length]


def _blank(rng: random.Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    at, length = _place(rng, data), rng.choice([2, 8, 64, 512])
    data[at : at + length] = rng.choice([b"\x00", b"\xff", b" "]) * len(data[at : at + length])


_BYTE_CHANGES = (
    *(_flip, _put_byte, _put_integer, _put_integer, _put_integer, _put_float, _cut, _delete, _insert, _double),
    *(_splice, _swap, _blank),
)


def _replace_number(rng: random.Random, text: str) -> str:
    return _replace_token(rng, text, lambda token: bool(_NUMBER.match(token)), NUMBERS)


def _replace_word(rng: random.Random, text: str) -> str:
    return _replace_token(rng, text, lambda token: not token.isspace(), WORDS)


def _replace_token(rng: random.Random, text: str, fits: Callable[[str], bool], choices: Sequence[str]) -> str:
    tokens = _TOKEN.findall(text)
    places = [at for at, token in enumerate(tokens) if fits(token)]
    if not places:
        return text + rng.choice(choices)
    tokens[rng.choice(places)] = rng.choice(choices)
    return "".join(tokens)


def _swap_words(rng: random.Random, text: str) -> str:
    tokens = _TOKEN.findall(text)
    places = [at for at, token in enumerate(tokens) if not token.isspace()]
    if len(places) > 1:
        one, two = rng.sample(places, 2)
        tokens[one], tokens[two] = tokens[two], tokens[one]
    return "".join(tokens)


def _replace_value(rng: random.Random, text: str) -> str:
    assignments = list(_ASSIGNED.finditer(text))
    if not assignments:
        return _replace_number(rng, text)
    one = rng.choice(assignments)
    return text[: one.start(2)] + rng.choice((*VALUES, *NUMBERS)) + text[one.end(2) :]


def _change_lines(rng: random.Random, text: str) -> str:
    lines = text.split("\n")
    at, to = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(5)
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines.insert(to, lines[at])
    elif kind == 2:
        lines[at], lines[to] = lines[to], lines[at]
    elif kind == 3:
        lines[at:at] = [lines[at]] * rng.choice([10, 1000])
    else:
        del lines[min(at, to) : max(at, to)]
    return rng.choice(["\n", "\n", "\n", "\r\n", "\r"]).join(lines)[:LONGEST]


def _nest(rng: random.Random, text: str) -> str:
    at = rng.choice([one.start(2) for one in _ASSIGNED.finditer(text)] or [rng.randrange(len(text) + 1)])
    opening, closing = rng.choice(
        ["[]", "()", "{}", ("<a>", "</a>"), ("{a=", "}"), ("(and ", ")"), ("{ JOINT a ", "}")]
    )
    depth = rng.choice([5, 300, 20_000])
    return text[:at] + opening * depth + rng.choice(["", closing * depth]) + text[at:]


_NESTS = ("[]", "()", "{}", ("<a>", "</a>"), ("{a=", "}"), ("(and ", ")"), ("{ JOINT a ", "}"))


def _cut_text(rng: random.Random, text: str) -> str:
    return text[: rng.randrange(len(text) + 1)]


def _lengthen(rng: random.Random, text: str) -> str:
    at = rng.randrange(len(text) + 1)
    return text[:at] + rng.choice(["1 ", "1,", "x", "a\t", " ", "=", '"']) * rng.choice([100, 50_000]) + text[at:]


_TEXT_CHANGES = (
    *(_replace_number, _replace_number, _replace_number, _replace_word, _replace_word, _swap_words, _replace_value),
    *(_replace_value, _replace_value, _change_lines, _change_lines, _nest, _cut_text, _lengthen),
)


def _json_value(rng: random.Random) -> str:
    return rng.choice(["null", "true", "-1", "1e308", "NaN", "Infinity", "[]", "{}", '"x"', "1e999", "9" * 5000])


def _change_node(rng: random.Random, tree: Any) -> Any:
    """Tree with one node replaced, removed, renamed, repeated or exchanged."""
    holders = list(_containers(tree))
    if not holders:
        return rng.choice(_NODES)
    container = rng.choice(holders) if rng.random() < 0.7 else holders[0]
    key = rng.choice(list(container)) if isinstance(container, dict) else rng.randrange(len(container))
    kind = rng.randrange(8)
    if kind == 0:
        del container[key]
    elif kind == 1 and isinstance(container, dict):
        container[rng.choice([*WORDS, f"{key}x"])] = container.pop(key)
    elif kind == 1:
        container[:] = container * rng.choice([2, 100])
    elif kind == 2:
        other = rng.choice(holders)
        container[key] = json.loads(json.dumps(other))
    elif kind == 3 and isinstance(container[key], int | float):
        container[key] = -container[key]
    elif kind == 4 and isinstance(container, dict):
        container[rng.choice([*WORDS, "extra"])] = rng.choice(_NODES)
    else:
        container[key] = rng.choice(_NODES)
    return tree


def _containers(tree: Any) -> list[Any]:
    """Non-empty objects and lists of a tree."""
    nodes, waiting = [], [tree]
    while waiting:
        node = waiting.pop(0)
        if isinstance(node, dict | list) and node:
            nodes.append(node)
            waiting += node.values() if isinstance(node, dict) else node
    return nodes


_NODES: tuple[Any, ...] = (
    *(None, True, False, 0, 1, 2, -1, 1.5, 1e308, -1e308, float("nan"), float("inf"), 1 << 63, 1 << 70, 10**400),
    *("", "x", "nan", "\x00", "\ud800", "y" * 5000, "../../x", NEST, NEST),
)
"""Replacements of a node; lists and objects are created at every use."""
