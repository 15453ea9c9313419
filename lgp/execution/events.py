"""Events of a run for page and log; `Hub` keeps them for readers in other threads."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from lgp.errors import LgpError
from reba.toml_table import TomlTable

STATES = ("waiting", "running", "done", "failed", "finished")
INSTRUCTIONS = ("told", "started", "late", "retargeted", "slowed", "ended", "finished")
"""Kinds after which the page may show the instruction of the current action: the world is as the plan says, or that
action is under way. After all others the reader has to wait."""
LONGEST_RUN = 3.2e7
"""[s] Longest run that is read: a year."""


@dataclass(frozen=True)
class Event:
    """An event of a run.

    Attributes:
        number: counts from 1 over the whole run, restarts included.
        time: [s] since the run began.
        action: number of the current action in its plan, from 0; None once the run is finished.
        state: "waiting" (for the world, or for a human who is late), "running" (human or robot acts), "done" (an
            action ended), or "failed" and "finished", which end the run.
        kind: one word: "told" (the human has to act), "started", "ended", "retargeted", "replanned", "fault" ...
        text: the event in a sentence.
        plan: 0 for the first plan, 1 for the first replanned one ...
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
        """Return the data that the page receives."""
        about = {"action": self.action, "state": self.state, "text": self.text, "time": round(self.time, 3)}
        return {**about, "plan": self.plan, "wait": self.kind not in INSTRUCTIONS}

    def record(self) -> dict[str, Any]:
        """Return all fields as plain data, as the log holds them."""
        return {**vars(self)}

    @staticmethod
    def read(data: Any) -> Event:
        """Return the event of a record.

        Raises:
            LgpError: a field is missing or wrong.
        """
        table = TomlTable("an event", data, LgpError)
        return Event(
            number=table.whole("number"),
            time=table.number("time", low=0.0, high=LONGEST_RUN),
            action=None if table.values.get("action") is None else table.whole("action"),
            state=table.text("state", choices=STATES),
            kind=table.text("kind"),
            text=table.text("text"),
            details=dict(table.table("details").values),
            plan=table.whole("plan"),
        )


class Hub:
    """All events so far, for readers in other threads; `first` are those of an earlier part of the run."""

    def __init__(self, first: Sequence[Event] = ()) -> None:
        self._events = list(first)
        self._lock = threading.Lock()

    def add(self, event: Event) -> None:
        """Append an event."""
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
