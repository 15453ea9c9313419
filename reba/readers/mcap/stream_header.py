"""Header of a stream: the names, parents and clock that all messages of its channels give."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from reba.readers.mcap.channels import DecodableChannel
from reba.readers.mcap.clock import RecordingClock
from reba.readers.mcap.contents import Contents, clock_name
from reba.readers.mcap.decode import Piece
from reba.readers.mcap.merge import MOST_SIGNALS
from reba.readers.mcap.presence import TOGETHER, Interval, Presence, Presences, Signal, at_once, united
from reba.readers.recording.stream import Kind


@dataclass(frozen=True)
class StreamHeader:
    """What all messages of a stream name, and when.

    Attributes:
        signals: names and parents that are read.
        clock: of the stream.
        source: where its times come from.
        zero: time of the recording [ns] at time 0 of the stream; `epoch`: its Unix time [ns].
        intervals: name -> log times [ns] between which it is there.
        messages: name -> messages that have it.
        warnings: for the user.
    """

    signals: tuple[Signal, ...]
    clock: RecordingClock
    source: str
    zero: int
    epoch: int
    intervals: Mapping[str, list[Interval]]
    messages: Mapping[str, int]
    warnings: tuple[str, ...]


def stream_header(parts: Sequence[DecodableChannel], kind: Kind, contents: Contents) -> StreamHeader | None:
    """Return the header of the stream of some channels, None if none of its messages is usable."""
    groups = dict.fromkeys((kind, part.group) for part in parts)
    present: dict[Signal, Presence] = {}
    for of in groups:
        for signals, one in contents.presence.get(of, Presences()).sets.items():
            for signal in signals:
                total = present.setdefault(signal, Presence())
                total.messages += one.messages
                total.intervals += one.intervals
    clocks = [track.clock for part in parts if (track := contents.tracks.get(id(part))) and track.clock]
    if not present or not clocks:
        return None
    for piece in (piece for of in groups for piece in contents.static.get(of, [])):
        for signal in zip(piece.names, piece.parents, strict=True):
            present.setdefault(signal, Presence())
    spans = {signal: united(one.intervals) for signal, one in present.items()}
    spans |= _in_turn([piece for of in groups for piece in contents.static.get(of, [])], spans)
    signals, warnings = _chosen(spans, present)
    spans_by_name: dict[str, list[Interval]] = {}
    for name, parent in signals:
        spans_by_name.setdefault(name, []).extend(spans[name, parent])
    intervals = {name: united(all_spans) for name, all_spans in spans_by_name.items()}
    messages: Counter[str] = Counter()
    for name, parent in signals:
        messages[name] += present[name, parent].messages
    clock = contents.clocks[clock_name(kind, parts[0].group)]
    first, logged = min(clock_.first for clock_ in clocks), min(clock_.first_log for clock_ in clocks)
    if kind == "angles" and clock.source == "header.stamp":
        # Rows of a posture table keep their time; the log time gives the epoch.
        return StreamHeader(signals, clock, "time", 0, logged - first, intervals, messages, warnings)
    return StreamHeader(signals, clock, clock.source, first, first, intervals, messages, warnings)


def _chosen(
    spans: Mapping[Signal, list[Interval]], present: Mapping[Signal, Presence]
) -> tuple[tuple[Signal, ...], tuple[str, ...]]:
    """Return the signals that are read, and warnings: at most `MOST_SIGNALS`, and one parent of a frame at a time."""
    chosen: dict[str, list[str]] = {}
    warnings = []
    named = list(spans)
    if len(named) > MOST_SIGNALS:
        frequent = {*sorted(named, key=lambda signal: -present[signal].messages)[:MOST_SIGNALS]}
        named = [signal for signal in named if signal in frequent]
        warnings.append(f"more than {MOST_SIGNALS} signals; the others are left out")
    for name, parent in named:
        others = chosen.setdefault(name, [])
        mine = _known_in(name, parent, spans)
        rival = next((other for other in others if _meet(mine, _known_in(name, other, spans))), None)
        if rival is None and not (others and not mine):
            others.append(parent)
        else:
            first = others[0] if rival is None else rival
            warnings.append(f"frame {name!r} has the parents {first!r} and {parent!r} at once; the first is used")
    return tuple((name, parent) for name, parents in chosen.items() for parent in parents), tuple(warnings)


def _in_turn(static: Sequence[Piece], spans: Mapping[Signal, list[Interval]]) -> dict[Signal, list[Interval]]:
    """Return when static frames are in a parent that have several one after the other: until the next one is sent."""
    sent: dict[str, list[tuple[int, str]]] = {}
    for piece in static:
        for name, parent in zip(piece.names, piece.parents, strict=True):
            sent.setdefault(name, []).extend((log, parent) for log in piece.log.tolist())
    newest = max((interval[1] for intervals in spans.values() for interval in intervals), default=0)
    result: dict[Signal, list[Interval]] = {}
    for name, parents in sent.items():
        parents.sort(key=lambda one: one[0])
        turns = [one for at, one in enumerate(parents) if not at or parents[at - 1][1] != one[1]]
        ends = [log for log, _ in turns[1:]] + [max(newest, turns[-1][0])]
        lasting = all(end - log > TOGETHER for (log, _), end in zip(turns[:-1], ends, strict=False))
        if len(turns) > 1 and lasting and not any(spans[name, parent] for _, parent in turns):
            for (log, parent), end in zip(turns, ends, strict=True):
                result.setdefault((name, parent), []).append([log, end])
    return result


def _known_in(name: str, parent: str, spans: Mapping[Signal, list[Interval]]) -> list[Interval]:
    """Return when a frame is there in a parent: a static one as long as that is, empty for one that always is."""
    seen = {name}
    while not spans[name, parent]:
        above = [signal for signal in spans if signal[0] == parent]
        moving = [interval for signal in above for interval in spans[signal]]
        if moving or not above or parent in seen:
            return united(moving)
        seen.add(parent)
        name, parent = above[0]
    return spans[name, parent]


def _meet(one: Sequence[Interval], other: Sequence[Interval]) -> bool:
    """Return whether two parents of a frame are there at once for longer than a hand-over takes."""
    separate = not one or not other or one[-1][1] <= other[0][0] or other[-1][1] <= one[0][0]
    return not separate and at_once(one, other) > TOGETHER
