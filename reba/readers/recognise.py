"""Which stream of a recording, by which profile: every pair is tried, the best is taken, a tie is refused."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache

from reba.errors import ProfileError, did_you_mean
from reba.readers.mapping import obtainable
from reba.readers.recording.profile import Profile
from reba.readers.recording.stream import Recording, Stream

PREFERENCE = {"joints": 0, "points": 1, "frames": 2}
"""Frames carry the world and full orientations, so they win where joints give no more columns."""
ENOUGH = 0.5
"""Share of a joints profile that is enough without all of its required joints; what lacks is not measured."""


@dataclass(frozen=True)
class Match:
    """A profile in a stream.

    Attributes:
        stream: where.
        profile: what the names mean; None for a posture table, which needs none.
        body: the body's id in the names, "" if they carry none.
        names: joint, segment or point of the profile -> its signals, as far as present.
        columns: the angle columns to be had.
        missing: joints, segments or points not found.
        fits: whether that is enough to read it.
    """

    stream: Stream
    profile: Profile | None
    body: str = ""
    names: Mapping[str, tuple[str, ...]] | None = None
    columns: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    fits: bool = True

    @property
    def found(self) -> int:
        """How many joints, segments or points are there."""
        return len(self.names or ())

    @property
    def share(self) -> float:
        """The share of the profile that is there."""
        return 1.0 if self.profile is None else self.found / max(len(self.profile.slots), 1)

    @property
    def why(self) -> str:
        """What was found, in words."""
        if self.profile is None:
            return f"posture table with {len(self.columns)} angle columns"
        what = {"joints": "joints", "frames": "segments", "points": "points"}[self.profile.kind]
        body = f" of body {self.body}" if self.body else ""
        return (
            f"{self.found}/{len(self.profile.slots)} {what} of profile {self.profile.name}{body} in {self.stream.name}"
        )

    @property
    def rank(self) -> tuple[int, ...]:
        """What decides between matches, best first in descending order."""
        if self.profile is None:
            return (1, len(self.columns), 0, 0)
        marks = len(self.profile.marks)
        return (0, len(self.columns), PREFERENCE[self.profile.kind], self.found + marks)


def matches(recording: Recording, known: Iterable[Profile]) -> list[Match]:
    """Return every profile that has at least one name in a stream of its kind, best first."""
    found = []
    for stream in recording.streams:
        if stream.kind == "angles":
            found.append(Match(stream, None, columns=stream.names))
            continue
        for profile in known:
            if profile.kind == stream.kind:
                found += [_match(stream, profile, body, names) for body, names in bodies(profile, stream).items()]
    return sorted(found, key=lambda match: (match.fits, *match.rank), reverse=True)


def choose(recording: Recording, known: tuple[Profile, ...], topic: str | None = None, named: bool = False) -> Match:
    """Return the stream and profile to read a recording by.

    Args:
        recording: the opened file.
        known: the profiles to try.
        topic: name of a stream, id of a body, or "<stream>#<id>"; None if there is nothing to choose.
        named: the caller named the only profile, so a posture table in the recording is passed over.

    Raises:
        ProfileError: nothing fits, two fit equally, or the recording holds several bodies.
    """
    found = [match for match in matches(recording, known) if match.profile or not named]
    if topic is not None:
        found = _of_topic(recording, found, topic)
    fitting = [match for match in found if match.fits]
    if not fitting:
        raise ProfileError(_nothing(recording, found, known if named else ()))
    best = fitting[0]
    same = [match for match in fitting if match.profile is best.profile and match.found >= 0.8 * best.found]
    ids = dict.fromkeys((match.body or match.stream.name) for match in same)
    if len(ids) > 1:
        options = ", ".join(ids)
        raise ProfileError(
            f"{recording.path}: {len(ids)} bodies or streams fit profile {_name(best)}: {options}; "
            f"choose one with --topic, like --topic {next(iter(ids))}"
        )
    equal = [match for match in fitting[1:] if match.rank == best.rank and match.profile is not best.profile]
    if equal:
        other = equal[0]
        raise ProfileError(
            f"{recording.path}: {_name(best)} ({best.why}) and {_name(other)} ({other.why}) fit equally; "
            f"choose with --profile {_name(best)} or --profile {_name(other)}, or with --topic"
        )
    return best


def bodies(profile: Profile, stream: Stream) -> dict[str, dict[str, str]]:
    """Return body id -> profile name -> signal, for every id under which the profile's names occur in a stream."""
    result: dict[str, dict[str, str]] = {}
    for index, pattern in enumerate(profile.patterns):
        for signal in stream.names:
            hit = _expression(profile.names, pattern).fullmatch(signal)
            if hit:
                given = hit.groupdict()
                # Two patterns may give one body two readings; an id belongs to its pattern.
                key = f"{index} {given.get('id') or ''}"
                result.setdefault(key, {})[given["name"]] = signal
    best: dict[str, dict[str, str]] = {}
    for key, names in result.items():
        body = key.partition(" ")[2]
        if len(names) > len(best.get(body, {})):
            best[body] = names
    return best


@cache
def _expression(names: tuple[str, ...], pattern: str) -> re.Pattern[str]:
    longest_first = sorted(names, key=len, reverse=True)
    text = re.escape(pattern).replace(re.escape("{name}"), f"(?P<name>{'|'.join(map(re.escape, longest_first))})")
    return re.compile(text.replace(re.escape("{id}"), "(?P<id>.+?)").replace(re.escape("*"), ".+?"))


def _match(stream: Stream, profile: Profile, body: str, found: Mapping[str, str]) -> Match:
    names: dict[str, tuple[str, ...]] = {}
    for slot, words in profile.slots.items():
        present = tuple(found[word] for word in words if word in found)
        if present and (profile.kind != "points" or len(present) == len(words)):
            names[slot] = present if profile.kind == "points" else present[:1]
    whole = all(slot in names for slot in profile.required)
    marked = set(profile.marks) <= set(stream.names)
    partial = profile.kind == "joints" and len(names) >= ENOUGH * len(profile.slots)
    missing = tuple(slot for slot in profile.slots if slot not in names)
    fits = bool(names) and marked and (whole or partial)
    columns = obtainable(profile, names) if fits else ()
    return Match(stream, profile, body, names, columns, missing, fits and bool(columns))


def _of_topic(recording: Recording, found: list[Match], topic: str) -> list[Match]:
    name, _, body = topic.partition("#")
    chosen = [match for match in found if match.stream.name == name and body in ("", match.body)]
    chosen = chosen or [match for match in found if match.body == topic]
    if not chosen and not any(stream.name == name for stream in recording.streams):
        options = [stream.name for stream in recording.streams] + [match.body for match in found if match.body]
        raise ProfileError(
            f"{recording.path}: no stream {topic!r}{did_you_mean(topic, options)}; "
            f"there are {', '.join(dict.fromkeys(options)) or 'none'}"
        )
    return chosen


def _name(match: Match) -> str:
    return match.profile.name if match.profile else "table"


def _nothing(recording: Recording, found: list[Match], named: tuple[Profile, ...]) -> str:
    where = f"{recording.path}: "
    if not recording.streams:
        left = "; ".join(f"{topic.name} ({topic.type}): {topic.why}" for topic in recording.topics[:4])
        return f"{where}no stream of joints, frames, points or angles{': ' + left if left else ''}; see `reba info`"
    first = [name for stream in recording.streams for name in stream.names][:6]
    fit = f"profile {named[0].name} does not fit" if named else "no profile fits"
    near = max(found, key=lambda match: (match.share, match.found), default=None)
    nearest = ""
    if near is not None and near.profile is not None:
        what = ", ".join(near.missing[:4]) + (" ..." if len(near.missing) > 4 else "")
        nearest = f"; nearest is {near.profile.name} ({near.why}), which lacks {what}"
    return (
        f"{where}{fit} its names {', '.join(first)} ...{nearest}; "
        "see `reba profiles`, or describe the names in a TOML file and give it with --profile"
    )
