"""Names of signals: which of a profile they are, and of which body.

signal of a stream -> pattern of the profile or of a namespace -> name in the profile, id of the body
"""

from __future__ import annotations

import re
from functools import cache

from reba.readers.recording.profile import Profile
from reba.readers.recording.stream import Stream

QUALIFIED = ("/{name}", "{id}/{name}", "{id}::{name}", "{id}:{name}", "{id}.{name}")
"""Patterns of namespaces, which hold for every profile of bare names: what stands before the name says whose it is."""
POSITIONS = ("{name}/position", "{id}/{name}/position", "{name}.position", "{id}.{name}.position")
"""Patterns of what exports of joint states (PlotJuggler) call the position of a joint, beside its velocity."""
PLACES = ("{name}_pos", "{name}_position", "{name}.pos", "{name}.position", "{name}/position",
          "{name}_landmark", "{name}_keypoint")  # fmt: skip
"""Patterns of what tables call the place of a point, beside its other values; for points."""


def bodies(profile: Profile, stream: Stream) -> dict[str, dict[str, str]]:
    """Return body id -> profile name -> signal, for every id under which names of the profile occur in a stream.

    Points are found in other spellings too ("LEFT_HIP", "leftHip", "l_hip"): they have no signs that could hang on it.
    """
    result: dict[str, dict[str, str]] = {}
    patterns, loose = _patterns(profile)
    if not _has_name(profile.names, stream.names, loose):
        return {}
    spelling = {_folded(name): name for name in profile.names}
    without_id: set[str] = set()
    for index, pattern in enumerate(patterns):
        for signal in stream.names:
            parsed = None if signal in without_id else _parsed(profile.names, pattern, loose, signal)
            if parsed:
                groups = parsed.groupdict()
                if "id" not in groups:  # what stands before the name is a word of the source, and no id
                    without_id.add(signal)
                # Two patterns may read one body in two ways, so an id belongs to its pattern.
                by_name = result.setdefault(f"{index} {(groups.get('id') or '').strip('/:.')}", {})
                word = groups["name"]
                name = word if word in profile.names else spelling[_folded(word)]
                if name not in by_name or word == name:
                    by_name[name] = signal
    best: dict[str, dict[str, str]] = {}
    for key, names in result.items():
        body = key.partition(" ")[2]
        if len(names) > len(best.get(body, {})):
            best[body] = names
    return best


def may_concern(profile: Profile, signal: str) -> bool:
    """Return whether a signal may be one of a profile, of any body."""
    patterns, loose = _patterns(profile)
    return any(_parsed(profile.names, pattern, loose, signal) for pattern in patterns)


def _patterns(profile: Profile) -> tuple[tuple[str, ...], bool]:
    """Return the patterns of the signals of a profile, and whether other spellings are found too."""
    loose = profile.kind == "points"
    further = (
        (*QUALIFIED, *{"points": PLACES, "joints": POSITIONS}.get(profile.kind, ()))
        if "{name}" in profile.patterns
        else ()
    )
    return (*profile.patterns, *further), loose


def _has_name(names: tuple[str, ...], signals: tuple[str, ...], loose: bool) -> bool:
    """Return whether a signal contains a name: of few profiles one does, and their expressions compile slowly."""
    text = "\n".join(signals)
    text = _folded(text) if loose else text
    return any(name in text for name in (_folded_names(names) if loose else names))


def _parsed(names: tuple[str, ...], pattern: str, loose: bool, signal: str) -> re.Match[str] | None:
    text = signal.lower() if loose else signal
    if not all(part in text for part in _literals(pattern, loose)):
        return None
    return _expression(names, pattern, loose).fullmatch(signal)


@cache
def _literals(pattern: str, loose: bool) -> tuple[str, ...]:
    """Return what stands in every signal of a pattern."""
    return tuple(filter(None, re.split(r"\{name\}|\{id\}|\*", pattern.lower() if loose else pattern)))


@cache
def _folded_names(names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(map(_folded, names))


@cache
def _expression(names: tuple[str, ...], pattern: str, loose: bool) -> re.Pattern[str]:
    words = [re.escape(name) for name in sorted(names, key=len, reverse=True)]
    if loose:
        words = [_BETWEEN_WORDS.sub("[ _-]?", word) for word in words]
    text = re.escape(pattern).replace(re.escape("{name}"), f"(?P<name>{'|'.join(words)})")
    text = text.replace(re.escape("{id}"), "(?P<id>.+?)").replace(re.escape("*"), ".+?")
    return re.compile(text, re.IGNORECASE if loose else 0)


_BETWEEN_WORDS = re.compile(r"_|(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")


def _folded(name: str) -> str:
    return re.sub("[ _-]", "", name.lower())
