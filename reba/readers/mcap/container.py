"""Structure of an MCAP file: its chunks, its channels, its end.

Opening reads the head of each top-level record, one small read per chunk, so neither the summary nor an index has to be
correct. The summary serves only to list channels and count messages without unpacking all chunks, and only if its CRC
and counts are correct; all else comes from the data section.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from mcap.opcode import Opcode

from reba.errors import ReadError
from reba.open_file import SETTINGS_BYTES
from reba.readers.mcap import records
from reba.readers.mcap.bytes import MAGIC, MOST_RATIO, NOT_MCAP, BadChunk, ByteSource, crc32, unpack
from reba.readers.mcap.message_index import indexed_scan
from reba.readers.mcap.packed_messages import MessageUnpacker
from reba.readers.mcap.records import BadRecord, Channel, ChunkHead, Scan, Schema
from reba.readers.mcap.store import ChunkRef, Loaded
from reba.readers.mcap.summary import FOOTER, Summary
from reba.readers.recording.stream import MOST_WARNINGS

_READ_AHEAD: Final = 1 << 14
"""[bytes] Read at once for heads of records."""
_WINDOW: Final = 1 << 20
"""[bytes] Read at once for messages outside chunks."""
_RECORD_AGAIN: Final = "copy the file again from its source, or record it again"
FREE_RECORDS: Final = 1000
"""Records that a file may hold beyond one for each of its (packed) bytes, which bounds the time that a file can take; a
choice. A message has a time of its own, so even well packed it takes several bytes."""
KEPT_SCANS: Final = 1 << 24
"""[bytes] Of positions of messages that a file keeps: about half a million messages; a choice."""
OWN: Final = "reba"
"""Name of the metadata record that is written with scores."""
PRIVATE: Final = 0x80
"""First opcode for records of applications, https://mcap.dev/spec#records."""
_OTHERS: Final = (Opcode.HEADER, Opcode.ATTACHMENT, Opcode.METADATA)


class Container:
    """One MCAP file, opened.

    Attributes:
        format: as of `Recording`; `magic` are the first bytes of the format.
        segments: chunks and runs of bare records, by start time.
        schemas, channels: definitions by id.
        counts: messages of each channel.
        ended_abnormally: None, or where the file is truncated.
        lost: None, or what the file states to have and does not.
        others: (opcode, offset of the content, length) of the header, attachments, metadata and private records.
        records: name -> metadata record, of those named "reba".
        publish_time: whether messages are loaded with their publish times in the place of log times.

    Raises:
        ReadError: the file is not an MCAP recording, or damaged so that its data would be wrong.
    """

    format = "mcap"
    magic, foreign = MAGIC, NOT_MCAP
    message_head = records.HEAD + records.MESSAGE_HEAD
    """[bytes] Before the payload of a message."""

    def __init__(self, path: Path, *, check_crc: bool, limit_bytes: int) -> None:
        self.path = path
        self.source = ByteSource(path, limit_bytes, self.magic, self.foreign)
        self._unpacker = MessageUnpacker(limit_bytes, self.source.packed_size)
        self.check_crc = check_crc
        self.publish_time = False
        self._scans: dict[tuple[int, bool], Scan] = {}
        self._scans_left = KEPT_SCANS
        self.limit_bytes = limit_bytes
        self.segments: list[ChunkRef] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.counts: Counter[int] = Counter()
        self.ended_abnormally: str | None = None
        self.lost: str | None = None
        self.others: list[tuple[int, int, int]] = []
        self.warnings: list[str] = []
        self.records: dict[str, dict[str, str]] = {}
        self.span: tuple[int, int] | None = None
        self._last: Loaded | None = None
        self._ahead = (0, b"")
        self._at = len(self.magic)
        self._records = self._chunks = self._unpacked = 0
        self._index()

    def header(self) -> tuple[str, str]:
        """Return profile and library, the program that wrote the file; empty where the header is damaged."""
        for opcode, at, length in self.others:
            if opcode == Opcode.HEADER:
                fields = records.Fields(self.source.read_at(at, min(length, _WINDOW)))
                try:
                    return fields.text(), fields.text()
                except BadRecord:
                    break
        return "", ""

    def load(self, segment: ChunkRef) -> Loaded:
        """Return the records of a segment, checked; the last segment stays loaded.

        Raises:
            ReadError: its bytes are damaged, or its definitions contradict others.
        """
        if self._last is None or self._last.segment is not segment:
            self._last = None
            data = self._bytes(segment)
            try:
                scan = self._known_scan(segment, data)
                data, scan = self._unpacker.unpacked(segment, data, scan, self.channels, self.message_head)
                loaded = Loaded(segment, data, scan, head=self.message_head)
            except BadRecord as error:
                place = segment.offset + (0 if segment.chunk else error.offset)
                inside = f"byte {error.offset} of the unpacked chunk: " if segment.chunk else ""
                raise ReadError(
                    self.path, f"damaged record ({inside}{error.what})", hint=_RECORD_AGAIN, offset=place
                ) from error
            self._last = loaded
        return self._last

    def _known_scan(self, segment: ChunkRef, data: bytes) -> Scan:
        """Return the messages of a segment, which each stream asks for: found once, and kept if they fit."""
        key = segment.offset, self.publish_time
        if key in self._scans:
            return self._scans[key]
        most = 1 << 62 if segment.scanned else self._most_records - self._records
        scan = self._scan(segment, data, most)
        self._records += 0 if segment.scanned else scan.records
        segment.scanned = True
        self._define(data, scan)
        size = sum(part.nbytes for part in (scan.payloads, scan.lengths, scan.channels, scan.times))
        if size <= self._scans_left:
            self._scans_left -= size
            self._scans[key] = scan
        return scan

    def store_of(self, channel: int) -> Container:
        """Return the store that loads the messages of a channel: this one, which loads those of all."""
        return self

    def release(self) -> None:
        """Free the memory of the loaded segment."""
        self._last = None

    def _scan(self, segment: ChunkRef, data: bytes, most: int) -> Scan:
        """Return the messages of a segment of at most `most` records."""
        start, stop = segment.indexes
        if 0 < stop - start <= len(data):
            index = self.source.read_at(start, stop - start)
            if (scan := indexed_scan(data, index, most, publish_time=self.publish_time)) is not None:
                return scan
        return records.scan(data, most=most, publish_time=self.publish_time)

    @property
    def _most_records(self) -> int:
        return FREE_RECORDS + self.source.packed_size

    def _bytes(self, segment: ChunkRef) -> bytes:
        packed = self.source.read_at(segment.offset, segment.size)
        head = segment.chunk
        if len(packed) != segment.size:
            raise ReadError(
                self.path,
                "the file became shorter while it was read",
                hint="wait until it is recorded or copied",
                offset=segment.offset,
            )
        if head is None:
            return packed
        try:
            data = unpack(packed, head.compression, head.size)
        except BadChunk as error:
            raise ReadError(self.path, str(error), hint=_RECORD_AGAIN, offset=segment.offset) from error
        if self.check_crc and head.crc and not segment.checked and crc32(data) != head.crc:
            raise ReadError(
                self.path,
                "the CRC of the chunk differs from that of its bytes: its numbers are damaged",
                hint=_RECORD_AGAIN + "; check_crc=False ignores it",
                offset=segment.offset,
            )
        segment.checked = True
        return data

    def _define(self, data: bytes, scan: Scan) -> None:
        for opcode, start, stop in scan.definitions:
            self._add(opcode, data[start:stop])

    def _add(self, opcode: int, content: bytes) -> None:
        """Add a schema or channel; an id may be repeated, but not with another definition."""
        known: dict[int, Schema] | dict[int, Channel]
        new: Schema | Channel
        if opcode == Opcode.SCHEMA:
            new, known = records.schema(content), self.schemas
        else:
            new, known = records.channel(content), self.channels
        if known.setdefault(new.id, new) != new:  # type: ignore[arg-type]
            raise BadRecord(0, f"{Opcode(opcode).name.lower()} {new.id} is defined twice, differently")

    def _index(self) -> None:
        summary = Summary()
        closed = self._ends_with_magic()
        try:
            for at, opcode, length in self._walk(closed):
                self._note(summary, at, opcode, length)
        except BadRecord as error:
            raise self._damaged(error) from error
        if self.source.size == len(MAGIC):
            raise ReadError(
                self.path, "the recording has no records", hint="record it again; the recorder wrote no data"
            )
        if summary.footer is not None and not closed:
            self.warnings.append("the magic bytes at the end of the file are wrong; all records before them were read")
        complete = self.ended_abnormally is None
        indexed = {number for segment in self.segments for number in segment.channels or ()}
        stated = summary.counts if complete and summary.undamaged(self.source, self.limit_bytes) else None
        if stated is not None and summary.holds(self.channels, indexed):
            self.schemas |= summary.schemas
            self.channels |= summary.channels
            self.counts = Counter(stated)
        else:
            self._count()
        if stated is not None:
            self.lost = summary.missing(self._chunks, self.counts)
        if self.ended_abnormally is None and summary.footer is None:
            self.ended_abnormally = f"no footer at byte {self.source.size}, the recorder did not close the file"
        if self.ended_abnormally is not None:
            self.ended_abnormally += f"; {sum(self.counts.values())} messages read{self._time_span()}"
        starts = [segment.start for segment in self.segments]
        if starts != sorted(starts):
            self.warnings.append("chunks are not in the order of time; they are read by start time")
            self.segments.sort(key=lambda segment: segment.start)

    def _damaged(self, error: BadRecord) -> ReadError:
        return ReadError(self.path, error.what, hint=_RECORD_AGAIN, offset=error.offset)

    def _ends_with_magic(self) -> bool:
        size = self.source.size
        return size >= 2 * len(MAGIC) and self.source.read_at(size - len(MAGIC), len(MAGIC)) == MAGIC

    def _walk(self, closed: bool) -> Iterator[tuple[int, int, int]]:
        """Yield (content offset, opcode, length) of top-level records, message runs as one; note a truncated end."""
        end = self.source.size
        opcode = -1
        while self._at < end and opcode != Opcode.FOOTER:
            at = self._at
            head = self._window(at, records.HEAD)
            opcode, length = (head[0], int.from_bytes(head[1:9], "little")) if len(head) >= 9 else (-1, 0)
            stop = at + records.HEAD + length
            if opcode <= 0 or stop > end:
                what = self._truncation(at, opcode, length, end)
                if closed:
                    raise BadRecord(at, f"{what}, although the file was closed properly")
                self.ended_abnormally = what
                return
            self._records += 1
            if self._records > self._most_records:
                raise BadRecord(at, f"more than {self._most_records} records, more than a file of this size can hold")
            self._at = self._bare(at) if opcode == Opcode.MESSAGE else stop
            yield at + records.HEAD, opcode, length

    @staticmethod
    def _truncation(at: int, opcode: int, length: int, end: int) -> str:
        if opcode == 0:
            return f"zeros instead of a record at byte {at}"
        kind = "a chunk" if opcode == Opcode.CHUNK else "a record"
        if opcode < 0:
            return f"truncated inside the head of a record at byte {at} of {end}"
        return f"truncated inside {kind} at byte {at} of {end} ({length} bytes declared)"

    def _window(self, at: int, count: int) -> bytes:
        """Return bytes of the file from a small read-ahead buffer."""
        start, data = self._ahead
        if not start <= at or at + count > start + len(data):
            start, data = at, self.source.read_at(at, max(_READ_AHEAD, count))
            self._ahead = (start, data)
        return bytes(data[at - start : at - start + count])

    def _bare(self, at: int) -> int:
        """Note a run of messages outside chunks that starts at `at`, return where it ends."""
        length = int.from_bytes(self._window(at, records.HEAD)[1:], "little")
        self._check_size(at, length)
        data = self.source.read_at(at, max(_WINDOW, records.HEAD + length))
        try:
            scan = records.scan(data, complete=False)
            self._define(data, scan)
        except BadRecord as error:
            raise BadRecord(at + error.offset, error.what) from error
        self._tally(scan)
        self._records += scan.records
        self.segments.append(ChunkRef(at, scan.end, None, int(scan.times.min()), scanned=True))
        return at + scan.end

    def _tally(self, scan: Scan) -> None:
        if len(scan.times):
            self.counts.update(Counter(scan.channels.tolist()))
            first, last = int(scan.times.min()), int(scan.times.max())
            self.span = (first, last) if self.span is None else (min(first, self.span[0]), max(last, self.span[1]))

    def _note(self, summary: Summary, at: int, opcode: int, length: int) -> None:
        """Update segments, definitions and summary from one top-level record."""
        after_data = summary.start > 0
        if opcode == Opcode.CHUNK:
            self._note_chunk(at, length)
        elif opcode == Opcode.MESSAGE_INDEX and self.segments and length >= records.INDEX_HEAD:
            number, count = records.message_index(self._window(at, records.INDEX_HEAD))
            segment = self.segments[-1]
            segment.channels = segment.channels or {}
            segment.channels[number] = segment.channels.get(number, 0) + count
            start, stop = segment.indexes
            if stop in (0, at - records.HEAD):
                segment.indexes = (start or at - records.HEAD, at + length)
        elif opcode == Opcode.DATA_END:
            summary.start = at + length
        elif opcode == Opcode.CHUNK_INDEX:
            summary.indexes += 1
        elif opcode in _OTHERS or opcode >= PRIVATE:
            self.others.append((opcode, at, length))
            if opcode == Opcode.METADATA and length <= SETTINGS_BYTES:
                name, record = records.metadata(self._window(at, length))
                if name == OWN:
                    self.records[name] = record
        elif opcode > Opcode.DATA_END:
            self._warn(f"the record at byte {at - records.HEAD} has the unknown type {opcode:#x} and was not read")
        elif opcode == Opcode.FOOTER:
            self._note_footer(summary, at, length)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS):
            self._check_size(at, length)
            self._note_definition(summary if after_data else None, opcode, self._window(at, length), at)

    def _note_chunk(self, at: int, length: int) -> None:
        try:
            head = records.chunk_head(self._window(at, min(length, 128)), length)
        except BadRecord as error:
            raise BadRecord(at, error.what) from error
        self._add_chunk(at, at + head.records_at, head)

    def _add_chunk(self, at: int, records_at: int, head: ChunkHead) -> None:
        """Add a chunk whose content starts at `at` and whose records at `records_at`."""
        size = max(head.size, head.records_size)
        if size > self.limit_bytes:
            raise BadRecord(at, f"a chunk declares {size} bytes, the limit is {self.limit_bytes} (limit_bytes)")
        self._chunks += 1
        self._unpacked += head.size
        if self._unpacked > self.limit_bytes + MOST_RATIO * self.source.packed_size:
            raise BadRecord(at, f"the chunks declare {self._unpacked} bytes, more than a file of this size can hold")
        if head.size:
            self.segments.append(ChunkRef(records_at, head.records_size, head, head.start))

    def _check_size(self, at: int, length: int) -> None:
        if length > self.limit_bytes:
            raise BadRecord(at, f"a record of {length} bytes exceeds the limit of {self.limit_bytes} (limit_bytes)")

    def _note_footer(self, summary: Summary, at: int, length: int) -> None:
        if length == FOOTER:
            fields = records.Fields(self._window(at, length))
            summary.footer = (fields.u64(), fields.u64(), fields.u32())
            summary.footer_at = at - records.HEAD

    def _note_definition(self, summary: Summary | None, opcode: int, content: bytes, at: int) -> None:
        """Add a definition of the data section, or one of the summary; an error in the summary only disables it."""
        try:
            if summary is None:
                if opcode != Opcode.STATISTICS:
                    self._add(opcode, content)
            else:
                summary.add(opcode, content)
        except BadRecord as error:
            if summary is None:
                raise BadRecord(at, error.what) from error
            summary.counts = None

    def _warn(self, text: str) -> None:
        if len(self.warnings) < MOST_WARNINGS:
            self.warnings.append(text)

    def _count(self) -> None:
        """Unpack every chunk once for channels and counts, where no valid summary states them."""
        for segment in self.segments:
            self._count_one(segment)

    def _count_one(self, segment: ChunkRef) -> None:
        """Count the messages of a chunk; those outside chunks are counted in `_bare`."""
        if segment.chunk is not None:
            scan = self.load(segment).scan
            self._tally(scan)
            segment.channels = dict(Counter(scan.channels.tolist()))

    def _time_span(self) -> str:
        return f", the last {(self.span[1] - self.span[0]) / 1e9:.3f} s after the first" if self.span else ""
