"""Which body is followed while others come and go, by the rule of complete recordings: `reba.readers.recognise`."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace

import numpy as np

from reba.errors import ProfileError
from reba.readers.mcap.contents import Contents
from reba.readers.mcap.presence import PAUSE, Interval, at_once, united
from reba.readers.recognise import AT_ONCE, Match, alike, candidates_in, in_turn
from reba.readers.recording.profile import Profile
from reba.readers.recording.stream import Recording
from reba.readers.signal_names import may_concern

ASIDE = "{} (not followed)"
"""Name of a signal of a body that is there at once with the one that is followed."""


class FollowedBody:
    """The body that is followed, under all ids that it has had.

    Args:
        recording: the first seconds.
        match: as decided from the first seconds.
        topic: that the user gave; a body that was named so has one id.

    Attributes:
        match: with the ids so far.
        ids: signal -> id of its body.
        current: id at the newest frame.
    """

    def __init__(self, recording: Recording, match: Match, profile: Profile, topic: str | None) -> None:
        self.match = match
        self.current = match.ids[0] if match.ids else match.label
        self.ids: dict[str, str] = {}
        self._profile, self._topic = profile, topic
        self._mentioned: set[str] = set()
        self._alone = False
        self._seen: Counter[str] = Counter()
        self._last: dict[str, float] = {}
        self._note_ids([match])
        self.renew(recording)

    def concerns(self, name: str) -> bool:
        """Return whether a signal may be one of a body, its pelvis, or a frame that these hang on."""
        roots = any(re.fullmatch(re.escape(root).replace(r"\{id\}", ".+"), name) for root in self._profile.root)
        frames = self.match.stream.kind == "frames" and name in {*self.match.stream.names, *self.match.stream.parents}
        return roots or frames or may_concern(self._profile, name)

    def unsettled_since(self, contents: Contents) -> int | None:
        """Return the log time [ns] from which on an id other than the current one is there (again), None without one.

        The next messages show whether both are there at once.
        """
        spans = self._spans(contents)
        starts = [first for label, (first, _) in spans.items() if label != self.current and first > self._seen[label]]
        return min(starts, default=None)

    def overlap(self, contents: Contents) -> bool:
        """Return whether two ids that were taken for one body are now there at once."""
        spans = list(self._spans(contents).values())
        return any(at_once([one], [other]) > AT_ONCE * 1e9 for at, one in enumerate(spans) for other in spans[at + 1 :])

    def _spans(self, contents: Contents) -> dict[str, Interval]:
        """Return id -> first and last log time [ns] of its newest presence; empty for a body with one id."""
        if len(set(self.ids.values())) < 2:
            return {}
        spans: dict[str, list[Interval]] = {}
        for groups in contents.presence.values():
            for signals, presence in groups.sets.items():
                label = self.ids.get(signals[0][0])
                if label is not None and presence.intervals:
                    spans.setdefault(label, []).append(presence.intervals[-1])
        return {label: united(intervals)[-1] for label, intervals in spans.items()}

    def settle(self, contents: Contents) -> None:
        """Take the ids that are there now as settled."""
        self._seen.update({label: first for label, (first, _) in self._spans(contents).items()})

    def renew(self, recording: Recording) -> list[str]:
        """Find the signals of the body in the recording so far; return what is said of bodies beside it."""
        try:
            candidates = candidates_in(recording, (self._profile,), self._topic, named=True)
        except ProfileError:
            return []
        fitting = [match for match in candidates if match.fits]
        same = alike(fitting, fitting[0]) if fitting else []
        mine = [match for match in same if match.label == self.current and self._same_stream(match)]
        one = in_turn(same) if len(same) > 1 and not self._alone else None
        if one is not None:
            self.match = one
            self._note_ids(same)
            return []
        if mine:
            self._alone = len(same) > 1
            self.match = self._only(mine[0], same)
            self._note_ids(mine)
        others = [match.label for match in same if match.label != self.current]
        new = [label for label in others if label not in self._mentioned]
        self._mentioned.update(new)
        return new

    def follows(self, label: str, moment: float) -> bool:
        """Note that an id is there at a time [s]; return whether the body has it from then on."""
        before, self._last[label] = self._last.get(label, -np.inf), moment
        if label == self.current or moment - before <= PAUSE / 1e9:
            return False
        self.current = label
        return True

    def others(self) -> list[str]:
        """Return the bodies that were there beside it."""
        return sorted(self._mentioned)

    def _note_ids(self, matches: list[Match]) -> None:
        self.ids = {
            name: match.label for match in matches for signals in (match.names or {}).values() for name in signals
        }

    def _same_stream(self, match: Match) -> bool:
        """Return whether a match is in the stream that is followed; that of all transforms has changing names."""
        stream = self.match.stream
        shared = set(stream.topics) & set(match.stream.topics)
        return match.stream.kind == stream.kind and (stream.kind == "frames" or bool(shared))

    def _only(self, mine: Match, same: list[Match]) -> Match:
        """Return the match of one id under the names that the signals of the body have had so far."""
        names = dict(self.match.names or {})
        renamed: dict[str, str] = {}
        for slot, signals in (mine.names or {}).items():
            kept = names.setdefault(slot, signals)
            renamed |= {other: name for other, name in zip(signals, kept, strict=True) if other != name}
        taken = set(renamed.values())
        for other in same:
            if other is not mine:
                signals_of = [name for signals in (other.names or {}).values() for name in signals]
                renamed |= {name: ASIDE.format(name) for name in signals_of if name in taken}
        stream = mine.stream.join(renamed, ()) if renamed and mine.stream.join is not None else mine.stream
        return replace(mine, stream=stream, names=names)
