"""rosbag2 recordings in SQLite (`.db3`), the default of ROS 2 up to Humble.

Tables: https://github.com/ros2/rosbag2/blob/rolling/rosbag2_storage_sqlite3/src/rosbag2_storage_sqlite3/. Messages are
read by id, which is the order of recording: by time, the passes of a restarted clock would be mixed. Before schema
version 4 (Iron) a file has no definitions; those of well-known types are known, see `definitions`.

A file is opened read-only, and a copy of one whose recorder left a journal beside it, which SQLite needs to write.
"""

from __future__ import annotations

import copy
import shutil
import tempfile
import weakref
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final

import numpy as np

from reba.errors import ReadError
from reba.readers.mcap.bytes import ZSTD_MAGIC, opened, unpack_file
from reba.readers.mcap.meanings import meaning_of
from reba.readers.mcap.packed_messages import MessageUnpacker
from reba.readers.mcap.records import LATEST, BadRecord, Channel, Scan, Schema
from reba.readers.mcap.store import ChunkRef, Loaded

if TYPE_CHECKING:
    import sqlite3

__all__ = ["SQLITE_MAGIC", "Database"]
SQLITE_MAGIC: Final = b"SQLite format 3\0"
"""First bytes of an SQLite file, https://www.sqlite.org/fileformat.html."""
SEGMENT_ROWS: Final = 8192
"""Messages of a segment."""
SEGMENT_BYTES: Final = 1 << 24
"""[bytes] Of a segment, unless one message is larger."""
STEPS_PER_BYTE: Final = 64
"""Instructions of SQLite that a query may take for each byte of the file, beyond `FREE_STEPS`: the pages of a hostile
file may refer to each other without end. A choice; a message takes about 20, and is longer than a byte."""
FREE_STEPS: Final = 1 << 24
_STEP: Final = 1 << 16
_MOST_TOPICS: Final = 10_000
_JOURNALS: Final = ("-wal", "-journal")
_AGAIN: Final = "copy the file again from its source, or repair it with `sqlite3 FILE .recover`"
_HEADER: Final = 100
"""[bytes] Header of an SQLite file, https://www.sqlite.org/fileformat.html#the_database_header."""
_NEEDED: Final = {"messages": ("id", "topic_id", "timestamp", "data"), "topics": ("id", "name", "type")}


class Rows(Loaded):
    """Messages of one segment; a payload is placed by the id of its row."""

    def __init__(self, segment: ChunkRef, data: bytes, scan: Scan, ids: Sequence[int]) -> None:
        super().__init__(segment, data, scan, head=0)
        self._ids = ids

    def where(self, payload: int) -> str:
        """Return the row of the message with this payload, for messages."""
        return f"row {self._ids[int(np.searchsorted(self.scan.payloads, payload))]} of the table messages"


class Database:
    """One rosbag2 database, opened; attributes as of `Container`.

    Only messages of types with postures are loaded; `store_of` loads those of another topic.

    Raises:
        ReadError: the file is not such a database, or damaged.
    """

    format = "db3"

    def __init__(self, path: Path, *, limit_bytes: int) -> None:
        self.path = path
        self.limit_bytes = limit_bytes
        self.segments: list[ChunkRef] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.counts: Counter[int] = Counter()
        self.ended_abnormally: str | None = None
        self.lost: str | None = None
        self.warnings: list[str] = []
        self._last: Loaded | None = None
        self._origin: Database | None = None
        self._cut = ""
        with self._reported():
            place = self._readable_place()
            files = [place] if place == self.path else place.parent.iterdir()
            self._size = sum(file.stat().st_size for file in files)
            self._unpacker = MessageUnpacker(limit_bytes, self._size)
            self._steps = FREE_STEPS + STEPS_PER_BYTE * self._size
            self._connection = self._connect(place)
            weakref.finalize(self, self._connection.close)
            self._define()
            self._index({n for n in self.channels if meaning_of(self.schemas[n].name) is not None})

    def store_of(self, channel: int) -> Database:
        """Return a store of the messages of one topic, of any type.

        Raises:
            ReadError: the file is damaged.
        """
        one = copy.copy(self)
        one._origin = self  # as long as that is there the file is open
        one.segments, one.counts, one.warnings, one._last = [], Counter(), [], None
        with one._reported():
            one._index({channel})
        return one

    def load(self, segment: ChunkRef) -> Loaded:
        """Return the messages of a segment; the last segment stays loaded.

        Raises:
            ReadError: the file is damaged.
        """
        if self._last is None or self._last.segment is not segment:
            self._last = None
            with self._reported():
                self._last = self._loaded(segment)
        return self._last

    def release(self) -> None:
        """Free the memory of the loaded segment."""
        self._last = None

    @contextmanager
    def _reported(self) -> Iterator[None]:
        """Turn the errors of SQLite into those of readers."""
        try:
            import sqlite3
        except ImportError as error:
            hint = "use another Python, or convert the recording with `ros2 bag convert`"
            raise ReadError(self.path, "this Python was built without SQLite", hint=hint) from error
        try:
            yield
        except (sqlite3.Error, BadRecord, OverflowError, UnicodeDecodeError) as error:
            text = str(error)
            if text == "interrupted":
                text = "a query takes longer than a file of this size can need"
            raise ReadError(self.path, f"is a damaged or foreign database ({text})", hint=_AGAIN) from error
        except MemoryError as error:
            raise ReadError(self.path, "a message exceeds the memory", hint=_AGAIN) from error

    def _readable_place(self) -> Path:
        """Return the file itself, or a temporary copy: unpacked, or with the journals that complete it."""
        with opened(self.path) as file:
            packed = file.read(len(ZSTD_MAGIC)) == ZSTD_MAGIC
            journals = [Path(f"{self.path}{ending}") for ending in _JOURNALS]
            journals = [journal for journal in journals if journal.is_file() and journal.stat().st_size]
            if not packed and not journals and not _truncation(file)[0]:
                return self.path
            folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
            weakref.finalize(self, folder.cleanup)
            place = Path(folder.name) / "recording.db3"
            with place.open("w+b") as target:
                if packed:
                    unpack_file(self.path, file, target, self.limit_bytes)
                else:
                    file.seek(0)
                    shutil.copyfileobj(file, target)
                if not journals:
                    # The rest of a page that is there in part would be read as zeros.
                    self._cut, whole = _truncation(target)
                    target.truncate(whole)
        for journal in journals:
            beside = place.with_name(place.name + journal.name[len(self.path.name) :])
            with opened(journal) as file, beside.open("wb") as target:
                shutil.copyfileobj(file, target)
        if journals:
            self.ended_abnormally = f"the recorder did not close the file; {journals[0].name} was read with it"
        return place

    def _connect(self, place: Path) -> sqlite3.Connection:
        """Open a database so that it cannot run code of its own, write or take memory without bounds."""
        import sqlite3

        address = place.absolute().as_uri() + ("?mode=ro&immutable=1" if place == self.path else "")
        connection = sqlite3.connect(address, uri=True, isolation_level=None, check_same_thread=False)
        connection.text_factory = lambda data: data.decode(errors="replace")
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(self.limit_bytes, self._size + _HEADER, (1 << 31) - 1))
        connection.execute("PRAGMA trusted_schema = OFF")
        if self._cut:
            # Otherwise SQLite refuses a file that is shorter than its header states.
            connection.execute("PRAGMA writable_schema = ON")
        connection.execute("PRAGMA query_only = ON")
        return connection

    def _rows(self, query: str, *values: int) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of a query that ends within the allowed steps and gives no more bytes than the file has."""
        left = [1 + self._steps // _STEP]
        size = 0

        def exhausted() -> bool:
            left[0] -= 1
            return left[0] < 0

        self._connection.set_progress_handler(exhausted, _STEP)
        for row in self._connection.execute(query, values):
            # The pages of a long value may refer to each other in a circle.
            size += sum(len(value) for value in row if isinstance(value, bytes | str))
            self._check_size(size)
            yield row

    def _check_size(self, size: int) -> None:
        if size > self._size:
            raise BadRecord(0, f"values of {size} bytes in a file of {self._size}")

    def _whole_rows(self, query: str, *values: int) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of a query, of a truncated file up to the first that is not there."""
        import sqlite3

        try:
            yield from self._rows(query, *values)
        except sqlite3.DatabaseError:
            if not self._cut:
                raise

    def _columns(self, table: str) -> set[str]:
        """Return the stored columns of a table; views, virtual tables and computed columns have none."""
        stored = self._rows("SELECT name, sql FROM sqlite_master WHERE type = 'table'")
        if not any(name == table and str(sql).upper().startswith("CREATE TABLE") for name, sql in stored):
            return set()
        return {str(row[1]) for row in self._rows(f"PRAGMA table_info({table})")}

    def _define(self) -> None:
        """Read the topics, with the definitions of their types where the file has them."""
        columns = {table: self._columns(table) for table in _NEEDED}
        missing = [
            f"{table}.{name}" for table, names in _NEEDED.items() for name in names if name not in columns[table]
        ]
        if missing and self._cut:
            raise BadRecord(0, f"{self._cut}, before its tables")
        if missing:
            what = f"is an SQLite file without {missing[0]}, so no rosbag2 recording"
            raise ReadError(self.path, what, hint="give a recording")
        texts: dict[str, tuple[str, bytes]] = {}
        if {"topic_type", "encoding", "encoded_message_definition"} <= self._columns("message_definitions"):
            query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            for name, encoding, text in self._rows(query):
                texts[str(name)] = str(encoding), text if isinstance(text, bytes) else str(text or "").encode()
        serialized = "serialization_format" if "serialization_format" in columns["topics"] else "'cdr'"
        for number, topic, name, encoding in self._rows(
            f"SELECT CAST(id AS INTEGER), name, type, {serialized} FROM topics WHERE id IS NOT NULL"
        ):
            self.schemas[number] = Schema(number, str(name), *texts.get(str(name), ("", b"")))
            self.channels[number] = Channel(number, number, str(topic), str(encoding))
            if len(self.channels) > _MOST_TOPICS:
                raise BadRecord(0, f"more than {_MOST_TOPICS} topics")

    def _index(self, wanted: set[int]) -> None:
        """Divide the messages of the wanted topics into segments, in the order of recording."""
        self._wanted = ",".join(map(str, sorted(wanted)))
        rows, size, start, first, total = 0, 0, LATEST, 0, 0
        query = "SELECT rowid, topic_id, CAST(timestamp AS INTEGER), length(data) FROM messages ORDER BY rowid"
        unknown = 0
        for number, topic, time, length in self._whole_rows(query):
            total += length or 0
            self._check_size(total)
            if topic not in self.channels:
                unknown += 1
                continue
            self.counts[topic] += 1
            if topic not in wanted:
                continue
            if rows and (rows >= SEGMENT_ROWS or size + (length or 0) > SEGMENT_BYTES):
                self.segments.append(ChunkRef(first, rows, None, start))
                rows, size, start = 0, 0, LATEST
            first = number if rows == 0 else first
            rows, size, start = rows + 1, size + (length or 0), min(start, _bounded(time))
        if rows:
            self.segments.append(ChunkRef(first, rows, None, start))
        if unknown:
            self.warnings.append(f"{unknown} messages name a topic that the file does not define")
        if self._cut:
            self.ended_abnormally = f"{self._cut}; {self.counts.total()} messages read"

    def _loaded(self, segment: ChunkRef) -> Loaded:
        query = (
            "SELECT rowid, topic_id, CAST(timestamp AS INTEGER), CAST(data AS BLOB) FROM messages "
            f"WHERE rowid >= ? AND topic_id IN ({self._wanted}) ORDER BY rowid LIMIT ?"
        )
        rows = list(self._whole_rows(query, segment.offset, segment.size))
        payloads = [row[3] or b"" for row in rows]
        data = b"".join(payloads)
        lengths = np.array([len(payload) for payload in payloads], np.int64)
        channels = np.array([row[1] for row in rows], np.int64)
        times = np.array([_bounded(row[2]) for row in rows], np.int64)
        scan = Scan(np.cumsum(lengths) - lengths, lengths, channels, times, (), len(data), len(rows))
        data, scan = self._unpacker.unpacked(segment, data, scan, self.channels, 0)
        return Rows(segment, data, scan, [row[0] for row in rows])


def _truncation(file: IO[bytes]) -> tuple[str, int]:
    """Return where a file ends before the last page that its header states, "" if it does not; and its whole pages."""
    file.seek(0)
    header = file.read(_HEADER)
    end = file.seek(0, 2)
    page, pages = int.from_bytes(header[16:18], "big"), int.from_bytes(header[28:32], "big")
    page = 1 << 16 if page == 1 else page
    if len(header) < _HEADER or end >= page * pages:
        return "", end
    return f"truncated at byte {end} of {page * pages}", end // page * page


def _bounded(time: int | None) -> int:
    return min(max(time or 0, 0), LATEST)
