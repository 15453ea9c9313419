"""Recognition: which stream of a recording is read by which profile. The best pair is taken, a tie is refused."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from reba.errors import ProfileError, did_you_mean, join_names
from reba.readers.mapping import obtainable_columns
from reba.readers.recording.profile import Profile
from reba.readers.recording.stream import JOINED, Recording, Stream
from reba.readers.signal_names import bodies

PREFERENCE = {"joints": 0, "points": 1, "frames": 2}
"""Rank of the kinds: frames have the world and full orientations, so they win where joints give no more columns."""
ENOUGH = 0.5
"""Share of a joints profile that suffices without all required joints; columns of absent joints are not measured."""
NEARLY_ALL = 0.8
"""Share of the names of the best body that another body has; of points, which may lack many, `ENOUGH` is one."""


@dataclass(frozen=True)
class Match:
    """A profile in a stream.

    Attributes:
        profile: what the names mean; None for a posture table, which needs none.
        body: id of the body in the names, "" if they have none.
        names: joint, segment or point of the profile -> its signals; only those present.
        columns: the angle columns that it gives.
        missing: joints, segments or points of the profile that are absent.
        fits: whether the recording can be read by it.
        note: an assumption about the bodies, "" without one.
        ids: of a body that had several, in the order of time.
    """

    stream: Stream
    profile: Profile | None
    body: str = ""
    names: Mapping[str, tuple[str, ...]] | None = None
    columns: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    fits: bool = True
    note: str = ""
    ids: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """The id of the body, or the stream of a body without one."""
        return self.body or self.stream.name

    @property
    def present(self) -> int:
        """Number of joints, segments or points that are present."""
        return len(self.names or ())

    @property
    def explained(self) -> int:
        """Number of points that are read; 0 for other kinds."""
        points = self.profile is not None and self.profile.kind == "points"
        return len({signal for group in (self.names or {}).values() for signal in group}) if points else 0

    @property
    def share(self) -> float:
        """Share of the profile that is present."""
        return 1.0 if self.profile is None else self.present / max(len(self.profile.slots), 1)

    @property
    def why(self) -> str:
        """What was recognised, as one sentence."""
        if self.profile is None:
            return f"posture table with {len(self.columns)} angle columns"
        what = {"joints": "joints", "frames": "segments", "points": "points"}[self.profile.kind]
        body = f" of body {self.body}" if self.body else ""
        count = f"{self.present}/{len(self.profile.slots)} {what}"
        return f"{count} of profile {self.profile.name}{body} in {self.stream.name}"

    @property
    def rank(self) -> tuple[int, ...]:
        """Sort key of matches; the largest is the best."""
        if self.profile is None:
            return (1, len(self.columns), 0, 0)
        marks = len(self.profile.marks)
        return (0, len(self.columns), PREFERENCE[self.profile.kind], self.present + marks)


def matches(recording: Recording, known: Iterable[Profile]) -> list[Match]:
    """Return the matches with at least one name in a stream of the profile's kind, best first."""
    candidates = []
    for stream in recording.streams:
        if stream.kind == "angles":
            candidates.append(Match(stream, None, columns=stream.names))
            continue
        for profile in known:
            if profile.kind == stream.kind:
                candidates += [_match(stream, profile, body, names) for body, names in bodies(profile, stream).items()]
    return sorted(candidates, key=lambda match: (match.fits, *match.rank), reverse=True)


def choose(
    recording: Recording,
    known: tuple[Profile, ...],
    topic: str | None = None,
    named: bool = False,
    body: str | None = None,
) -> Match:
    """Return the stream of a recording and the profile to read it by.

    Args:
        known: the profiles to try.
        topic: name of a stream, id of a body, or "<stream>#<id>"; None for the best.
        named: the caller named the only profile, so a posture table in the recording is not used.
        body: id of a body, None for the only one.

    Raises:
        ProfileError: no profile fits, two fit equally, or the recording has several bodies or not that of the id.
    """
    candidates = candidates_in(recording, known, topic, named)
    if body is not None:
        candidates = _of_body(recording, candidates, body)
    fitting = [match for match in candidates if match.fits]
    if not fitting:
        raise NoMatch(_no_match(recording, candidates, known if named else ()))
    best, rivals = _explaining_most(fitting)
    same = alike(fitting, best)
    ids = dict.fromkeys(match.label for match in same)
    if len(ids) > 1:
        one_person = in_turn(same) or _scored_last(recording, same)
        if one_person is not None:
            return replace(one_person, note="; ".join(filter(None, (one_person.note, rivals))))
        options = ", ".join(f"{match.label}{seconds_text(match)}" for match in same)
        raise SeveralBodies(
            f"{recording.path}: {len(ids)} bodies or streams fit profile {_name(best)}: {options}; "
            f"choose one with --topic, like --topic {next(iter(ids))}"
        )
    equal = [match for match in fitting if match.rank == best.rank and match.profile is not best.profile]
    if equal:
        other = equal[0]
        raise ProfileError(
            f"{recording.path}: {_name(best)} ({best.why}) and {_name(other)} ({other.why}) fit equally; "
            f"choose with --profile {_name(best)} or --profile {_name(other)}, or with --topic"
        )
    return replace(best, note="; ".join(filter(None, (best.note, rivals, _elsewhere(candidates, best)))))


def _elsewhere(candidates: Sequence[Match], best: Match) -> str:
    """Return which missing joints another stream has, as a note, "" for none: they are recorded, but not read."""
    for match in candidates:
        if match.stream is not best.stream and match.profile is best.profile and match.stream.kind == "joints":
            there = [joint for joint in best.missing if joint in (match.names or {})]
            if there:
                names = join_names(there, 4)
                return f"{names} stand in {match.stream.name}, which is not read beside {best.stream.name}"
    return ""


def _explaining_most(fitting: list[Match]) -> tuple[Match, str]:
    """Return the best match; of several profiles of one stream of points that which explains most of them, and a note.

    A file may have the points of two sets, as those of a video and the markers that were derived from them.
    """
    best = fitting[0]
    ranked = sorted(
        (match for match in fitting if match.stream is best.stream),
        key=lambda match: (match.explained, len(match.columns)),
        reverse=True,
    )
    other = next((match for match in ranked if match.profile is not ranked[0].profile), None)
    if not best.explained or other is None:
        return best, ""
    first, total = ranked[0], len(best.stream.names)
    return first, (
        f"profiles {_name(first)} and {_name(other)} both fit; "
        f"taken is {_name(first)}, which explains {first.explained} of {total} points, not {other.explained}"
    )


class SeveralBodies(ProfileError):
    """The recording has several bodies, of which the user has to choose one."""


class NotThere(ProfileError):
    """The recording has no stream or body of the name that the user gave."""


class NoMatch(ProfileError):
    """No profile fits a stream of the recording."""


def candidates_in(
    recording: Recording, known: Iterable[Profile], topic: str | None = None, named: bool = False
) -> list[Match]:
    """Return the matches among which `choose` chooses, best first; arguments and errors are its own."""
    candidates = [match for match in matches(recording, known) if match.profile or not named]
    if topic is not None:
        candidates = _of_topic(recording, candidates, topic)
    return _across_topics(candidates)


def _across_topics(candidates: list[Match]) -> list[Match]:
    """Return the matches, with those of one body joined whose joints stand in several topics, none of them in two."""
    result = list(candidates)
    of_body: dict[tuple[str, str], list[Match]] = {}
    for match in candidates:
        if match.profile is not None and match.profile.kind == "joints" and match.stream.join is not None:
            of_body.setdefault((match.profile.name, match.body), []).append(match)
    for same in of_body.values():
        first, *others = sorted(same, key=lambda match: match.present, reverse=True)
        names, further = dict(first.names or {}), []
        for other in others:
            if names.keys().isdisjoint(other.names or {}):
                names |= other.names or {}
                further.append(other)
        if further and first.profile is not None and first.stream.join is not None:
            stream = first.stream.join({}, [other.stream for other in further])
            joined = _match_of(stream, first.profile, first.body, names)
            result = [match for match in result if match is not first and match not in further]
            result.append(
                replace(joined, note=f"joints of one person stand in {len(stream.topics)} topics: {stream.name}")
            )
    return sorted(result, key=lambda match: (match.fits, *match.rank), reverse=True)


def alike(fitting: Sequence[Match], best: Match) -> list[Match]:
    """Return the matches of the profile of the best one with about as many names as that."""
    least = (ENOUGH if best.explained else NEARLY_ALL) * best.present
    return [match for match in fitting if match.profile is best.profile and match.present >= least]


AT_ONCE = 0.5
"""[s] In which two ids may overlap and still be one person whose id a tracker renewed; a choice."""


def presence(match: Match) -> list[tuple[float, float]]:
    """Return the intervals [s since the start of the recording] in which signals of a match are there, joined.

    Empty where the recording does not say; a body is there from its first signal on.
    """
    spans = sorted(
        (start, end)
        for signals in (match.names or {}).values()
        for name in signals
        for start, end in match.stream.present.get(name, ())
    )
    result: list[tuple[float, float]] = []
    for start, end in spans:
        if result and start <= result[-1][1]:
            result[-1] = (result[-1][0], max(result[-1][1], end))
        else:
            result.append((start, end))
    return result


def in_turn(same: Sequence[Match]) -> Match | None:
    """Return one match of bodies of one stream that follow each other and are never there at once, else None.

    Topics of which each has the id of its body in its name, as in ROS4HRI, count as one stream.
    """
    first = min(same, key=lambda match: min(presence(match), default=(0.0, 0.0)))
    stream, profile = first.stream, first.profile
    if profile is None or stream.join is None or len({_without_id(match) for match in same}) > 1:
        return None
    spans = [presence(match) for match in same]
    for at, one in enumerate(spans):
        for other in spans[at + 1 :]:
            both = sum(max(0.0, min(a[1], b[1]) - max(a[0], b[0])) for a in one for b in other)
            if not one or not other or both > AT_ONCE:
                return None
    renamed: dict[str, str] = {}
    names = dict(first.names or {})
    for match in same:
        for slot, signals in (match.names or {}).items():
            kept = names.setdefault(slot, signals)
            renamed |= {other: name for other, name in zip(signals, kept, strict=True) if other != name}
    ordered = sorted(same, key=presence)
    ids = ", ".join(f"{match.body}{seconds_text(match)}" for match in ordered)
    return replace(
        first,
        stream=stream.join(renamed, [match.stream for match in same]),
        names=names,
        columns=obtainable_columns(profile, names),
        missing=tuple(slot for slot in profile.slots if slot not in names),
        note=f"bodies that follow each other are one person: {ids}",
        ids=tuple(match.body for match in ordered),
    )


def _scored_last(recording: Recording, same: Sequence[Match]) -> Match | None:
    """Return the newest scores of a file whose scores were scored again, else None: they are of one recording."""
    streams = [match.stream.name for match in same]
    if same[0].profile is not None or (recording.scored or {}).get("topic") not in streams:
        return None
    newest = max(same, key=lambda match: (len(match.stream.name), match.stream.name))  # reba, reba_2 ... reba_10
    return replace(newest, note=f"scored {len(same)} times: the newest scores are read, {newest.stream.name}")


def _without_id(match: Match) -> str:
    """Return the name of a stream without the id of a body as one of the words between its slashes."""
    words = match.stream.name.split("/")
    return "/".join("{id}" if match.body and word == match.body else word for word in words)


def seconds_text(match: Match) -> str:
    """Return when a body is there, as text for a message."""
    spans = presence(match)
    return f" ({spans[0][0]:.1f} to {spans[-1][1]:.1f} s)" if spans else ""


def _match(stream: Stream, profile: Profile, body: str, signals: Mapping[str, str]) -> Match:
    names: dict[str, tuple[str, ...]] = {}
    for slot, words in profile.slots.items():
        called = [next((signals[name] for name in word.split("|") if name in signals), "") for word in words]
        present = tuple(filter(None, called))
        if profile.kind == "points":  # the mean of all
            present = present if len(present) == len(words) else ()
        if present:
            names[slot] = present if profile.kind == "points" else present[:1]
    return _match_of(stream, profile, body, names)


def _match_of(stream: Stream, profile: Profile, body: str, names: Mapping[str, tuple[str, ...]]) -> Match:
    """Return the match of a body whose joints, segments or points have these signals."""
    complete = all(any(slot in names for slot in group) for group in profile.required)
    marked = set(profile.marks) <= set(stream.names)
    partial = profile.kind == "joints" and len(names) >= ENOUGH * len(profile.slots)
    missing = tuple(slot for slot in profile.slots if slot not in names)
    fits = bool(names) and marked and (complete or partial)
    columns = obtainable_columns(profile, names) if fits else ()
    return Match(stream, profile, body, names, columns, missing, fits and bool(columns))


def _of_topic(recording: Recording, candidates: list[Match], topic: str) -> list[Match]:
    name, _, body = topic.partition("#")
    chosen = [
        match for match in candidates if match.stream.name in (name, *name.split(JOINED)) and body in ("", match.body)
    ]
    chosen = chosen or [match for match in candidates if match.body == topic]
    if not chosen and not any(stream.name in (name, *name.split(JOINED)) for stream in recording.streams):
        options = [stream.name for stream in recording.streams] + [
            match.body for match in candidates if match.body and match.fits
        ]
        raise NotThere(
            f"{recording.path}: no stream {topic!r}{did_you_mean(topic, options)}; "
            f"streams and bodies are {', '.join(dict.fromkeys(options)) or 'none'}"
        )
    return chosen


def _of_body(recording: Recording, candidates: list[Match], body: str) -> list[Match]:
    chosen = [match for match in candidates if match.body == body]
    if not chosen:
        ids = dict.fromkeys(f"{match.body}{seconds_text(match)}" for match in candidates if match.body and match.fits)
        near = did_you_mean(body, [match.body for match in candidates if match.body])
        raise NotThere(f"{recording.path}: no body {body!r}{near}; bodies are {', '.join(ids) or 'without an id'}")
    return chosen


def _name(match: Match) -> str:
    return match.profile.name if match.profile else "table"


def _no_match(recording: Recording, candidates: list[Match], named: tuple[Profile, ...]) -> str:
    where = f"{recording.path}: "
    if not recording.streams:
        unused = "; ".join(f"{topic.name} ({topic.type}): {topic.why}" for topic in recording.topics[:4])
        return f"{where}no stream of joints, frames, points or angles{': ' + unused if unused else ''}; see `reba info`"
    first = [name for stream in recording.streams for name in stream.names][:6]
    fit = f"profile {named[0].name} does not fit" if named else "no profile fits"
    nearest = max(candidates, key=lambda match: (match.share, match.present), default=None)
    hint = ""
    if nearest is not None and nearest.profile is not None:
        absent = ", ".join(nearest.missing[:4]) + (" ..." if len(nearest.missing) > 4 else "")
        hint = f"; nearest is {nearest.profile.name} ({nearest.why}), which lacks {absent}"
    return (
        f"{where}{fit} its names {', '.join(first)} ...{hint}; {recording.hint and recording.hint + ', '}"
        "see `reba profiles`, or describe the names in a TOML file and give it with --profile"
    )
