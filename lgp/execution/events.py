"""What happened, as the page and the log are told; `Hub` keeps all of it for readers of other threads."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

STATES: Final = ("waiting", "running", "done", "failed", "finished")
"""waiting: for the world, or for the human, who is late. running: somebody acts. done: an action ended. The last two
end the run."""


@dataclass(frozen=True)
class Event:
    """One thing that happened.

    Attributes:
        number: counts from 1 over the whole run, restarts included.
        time: [s] since the run began.
        action: number of the current action in its plan, from 0; None before the first and after the last.
        state: one of `STATES`.
        kind: what happened, one word: told, started, ended, stopped, retargeted, replanned, fault ...
        text: a sentence for people.
        details: numbers and names.
        plan: which plan it is about: 0 is the first, 1 the one that was made anew first ...
    """

    number: int
    time: float
    action: int | None
    state: str
    kind: str
    text: str
    details: dict[str, Any] = field(default_factory=dict)
    plan: int = 0

    def page(self) -> dict[str, Any]:
        """Return what the page is told."""
        about = {"action": self.action, "state": self.state, "text": self.text, "time": round(self.time, 3)}
        return {**about, "plan": self.plan}

    def record(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        return {**vars(self)}


class Hub:
    """All events so far, for readers of other threads.

    Args:
        first: events of an earlier part of the run.
    """

    def __init__(self, first: Sequence[Event] = ()) -> None:
        self._events = list(first)
        self._lock = threading.Lock()

    def add(self, event: Event) -> None:
        """Take in one more event."""
        with self._lock:
            self._events.append(event)

    @property
    def last(self) -> Event | None:
        """The last event."""
        with self._lock:
            return self._events[-1] if self._events else None

    def after(self, number: int) -> list[Event]:
        """Return the events with higher numbers."""
        with self._lock:
            return [event for event in self._events if event.number > number]
