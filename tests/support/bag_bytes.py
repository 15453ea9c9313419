"""ROS 1 bags made byte by byte as the recorder of ROS 1 lays them out: a connection stands in the chunk of its first
message and again in the index (http://wiki.ros.org/Bags/Format/2.0); header fields are in the order of their names."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

MAGIC = b"#ROSBAG V2.0\n"
SECOND = 1_000_000_000


@dataclass(frozen=True)
class Connection:
    """A topic of one publisher."""

    number: int
    topic: str
    type: str
    definition: str


Row = tuple[Connection, int, bytes]
"""Connection, time [ns] and payload of a message."""


def fields(header: Mapping[str, bytes]) -> bytes:
    """Return header fields."""
    parts = [name.encode() + b"=" + header[name] for name in sorted(header)]
    return b"".join(struct.pack("<I", len(part)) + part for part in parts)


def record(header: Mapping[str, bytes], data: bytes) -> bytes:
    """Return a record."""
    head = fields(header)
    return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data


def u32(number: int) -> bytes:
    """Return four bytes."""
    return struct.pack("<I", number)


def moment(time: int) -> bytes:
    """Return a time."""
    return struct.pack("<II", *divmod(time, SECOND))


def head(index: int = 0, connections: int = 0, chunks: int = 0, **more: bytes) -> bytes:
    """Return magic and bag header, which fill 4096 bytes after the magic."""
    header = {"op": b"\x03", "index_pos": struct.pack("<Q", index), "conn_count": u32(connections)}
    header |= {"chunk_count": u32(chunks), **more}
    return MAGIC + record(header, b" " * (4096 - 8 - len(fields(header))))


def connection(one: Connection) -> bytes:
    """Return a connection record."""
    about = {"topic": one.topic, "type": one.type, "md5sum": "*", "message_definition": one.definition}
    header = {"op": b"\x07", "conn": u32(one.number), "topic": one.topic.encode()}
    return record(header, fields({name: text.encode() for name, text in about.items()}))


def bag(
    rows: Iterable[Row],
    per_chunk: int = 50,
    compression: str = "none",
    pack: Callable[[bytes], bytes] = bytes,
    *,
    closed: bool = True,
    without: Sequence[int] = (),
) -> bytes:
    """Return a bag; `without` are chunks that are left out, though the index has them."""
    chunks = [list(rows)[at : at + per_chunk] for rows in [list(rows)] for at in range(0, len(rows), per_chunk)]
    data, infos, known = head(), b"", dict[int, Connection]()
    for number, chunk in enumerate(chunks):
        inside = b""
        entries: dict[int, bytes] = {}
        for one, time, payload in chunk:
            if one.number not in known:
                known[one.number] = one
                inside += connection(one)
            entries[one.number] = entries.get(one.number, b"") + moment(time) + u32(len(inside))
            inside += record({"op": b"\x02", "conn": u32(one.number), "time": moment(time)}, payload)
        times = [time for _, time, _ in chunk]
        about = {"op": b"\x06", "ver": u32(1), "chunk_pos": struct.pack("<Q", len(data)), "count": u32(len(entries))}
        about |= {"start_time": moment(min(times)), "end_time": moment(max(times))}
        infos += record(about, b"".join(u32(conn) + u32(len(places) // 12) for conn, places in entries.items()))
        if number not in without:
            header = {"op": b"\x05", "compression": compression.encode(), "size": u32(len(inside))}
            data += record(header, pack(inside))
            for conn, places in entries.items():
                header = {"op": b"\x04", "ver": u32(1), "conn": u32(conn), "count": u32(len(places) // 12)}
                data += record(header, places)
    if not closed:
        return data
    index = len(data)
    return (
        head(index, len(known), len(chunks)) + data[len(head()) :] + b"".join(map(connection, known.values())) + infos
    )
