"""What `reba live` does: follow, score, write, tell, sum up."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from reba.errors import RebaError
from reba.live.follow import Follower
from reba.live.frames import Reading, neutral_until
from reba.live.json_lines import Lines
from reba.live.output import Latency, write_lines
from reba.live.session import Alert, LiveScorer, score_of_level
from reba.live.sources import GrowingStore, open_growing
from reba.posture.factors import Factors, checked
from reba.scores import named_activity

INTERRUPTED = 130
"""Exit code of a command that was interrupted."""


@dataclass(frozen=True)
class LiveOptions:
    """What the caller chose beside the source.

    Attributes:
        reading: how the source is read.
        factors: load and others, as given.
        activity: "none", or a comma list.
        rules: preset or TOML file.
        alert: score from which on to alert.
        hold: [s] for which it has to stay there.
        window: [s] length of the rolling window.
        until_idle: [s] of silence after which to end, None to go on for ever.
        foxglove: port to serve on, None not to.
    """

    reading: Reading
    factors: Mapping[str, Any]
    activity: str = "none"
    rules: str = "measured"
    alert: int = 8
    hold: float = 1.0
    window: float = 60.0
    until_idle: float | None = None
    foxglove: int | None = None


def activity_of(text: str) -> dict[str, bool]:
    """Return the kinds of activity that were named.

    Raises:
        RebaError: it is "auto", or a kind is unknown.
    """
    if text == "auto":
        raise RebaError(
            "activity auto depends on what follows a frame (a posture is static from its first second on once it has "
            "been held for a minute), which is not known live; use none or some of static,repeated,unstable"
        )
    return named_activity(text)


def stdin_descriptor() -> int:
    """Return the file descriptor of standard input."""
    return sys.stdin.fileno()


def run_live(place: str, options: LiveOptions) -> int:
    """Follow a source to its end, and return the exit code.

    Args:
        place: MCAP file that is being written, or "-" for JSON lines on standard input.
        options: what the caller chose.

    Raises:
        RebaError: the source or an option cannot be used; what was scored before is summed up all the same.
    """
    activity = activity_of(options.activity)
    neutral_until(options.reading.neutral, 0.0)
    checked(Factors.of({**activity, **options.factors}), 1)
    session = LiveScorer(options.rules, options.window, Alert(options.alert, options.hold))
    view = _view(options.foxglove)
    latency = Latency()
    follower: Follower | None = None
    code = 0
    try:
        source: GrowingStore = (
            Lines(stdin_descriptor(), _tell) if place == "-" else open_growing(Path(place), options.until_idle)
        )
        follower = Follower(source, options.reading, options.factors, activity, _tell)
        _follow(follower, session, latency, view, options)
    except KeyboardInterrupt:
        code = INTERRUPTED
    except BrokenPipeError:
        follower = None
        raise
    finally:
        if view is not None:
            view.close()
        if follower is not None and (session.frames or code):
            _sum_up(follower, session, latency, code)
    return code


def _follow(follower: Follower, session: LiveScorer, latency: Latency, view: Any, options: LiveOptions) -> None:
    stream = sys.stdout.buffer
    for frames in follower.frames(options.until_idle):
        if not session.frames:
            _introduce(follower)
        records, scores = session.add(frames)
        write_lines(stream, records)
        latency.add(time.perf_counter() - follower.seen, len(records))
        for record in records:
            event = record["alert"]["event"]
            if event is not None:
                word = "at or above" if event == "raised" else "below"
                _tell(f"alert {event} at {record['time']:.2f} s: REBA {word} {options.alert} for {options.hold:g} s")
        if view is not None:
            view.publish(frames, records, scores, follower.epoch)


def _introduce(follower: Follower) -> None:
    """Say what was recognised and what is not measured."""
    _tell(f"{follower.source.path}: {follower.about}")
    stage = follower.stage
    if stage is not None and stage.unmeasured:
        _tell(f"not measured: {', '.join(stage.unmeasured)}")
    for text in stage.assumed if stage is not None else ():
        _tell(f"assumed: {text}")


def _sum_up(follower: Follower, session: LiveScorer, latency: Latency, code: int) -> None:
    """Write the summary as the last line, and say it in words."""
    stage = follower.stage
    found = session.summary()
    skipped = follower.source.skipped + (stage.log.skipped if stage is not None else 0)
    late = stage.late if stage is not None else 0
    summary = {
        **found,
        "profile": stage.profile if stage is not None else None,
        "unmeasured": stage.unmeasured if stage is not None else None,
        "skipped": skipped,
        "out_of_order": late,
        "warnings": stage.log.warnings if stage is not None else [],
        "interrupted": code == INTERRUPTED,
        "latency": latency.to_dict(),
    }
    write_lines(sys.stdout.buffer, [{"summary": summary}])
    left_out = f", {skipped + late} left out" if skipped + late else ""
    mean = found["exposure"]["mean_low"]
    words = "" if mean is None else f", REBA at least {mean:.2f} on average and {found['max_low']} at most"
    how = "interrupted after" if code else "ended after"
    _tell(f"{how} {found['frames']} frames ({found['exposure']['seconds']:.1f} s){left_out}{words}")


def _view(port: int | None) -> Any:
    if port is None:
        return None
    from reba.live.foxglove import FoxgloveServer

    view = FoxgloveServer(port)
    _tell(f"open {view.address} in Foxglove or Lichtblick")
    return view


def _tell(text: str) -> None:
    click.echo(f"reba: {' '.join(text.split())}", err=True)


ALERT = 8
"""Score from which on to alert: the paper's high risk, action necessary soon."""
FACTORS = ("load", "coupling", "support")
_FORM = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*(s|min)?")
_UNITS = {None: 1.0, "s": 1.0, "min": 60.0}


def seconds(name: str, text: str) -> float:
    """Return a length of time [s].

    >>> seconds("window", "1.5min"), seconds("hold", "2")
    (90.0, 2.0)

    Raises:
        RebaError: it is none.
    """
    form = _FORM.fullmatch(text.strip())
    if form is None:
        raise RebaError(f"--{name} is {text!r}; expected seconds, like 2s, 0.5 or 1min")
    return float(form[1]) * _UNITS[form[2]]


def live_options(given: dict[str, Any]) -> LiveOptions:
    """Return the options.

    Raises:
        RebaError: one of them cannot be used, or both alert options are given.
    """
    if given["alert"] is not None and given["alert_level"] is not None:
        raise RebaError("--alert and --alert-level say the same; give one of them")
    alert = given["alert"] or ALERT
    if given["alert_level"] is not None:
        alert = score_of_level(given["alert_level"])
    return LiveOptions(
        reading=Reading(given["profile"], given["topic"], given["neutral"], seconds("settle", given["settle"])),
        factors={name: given[name] for name in FACTORS if given[name] is not None},
        activity=given["activity"],
        rules=given["rules"],
        alert=alert,
        hold=seconds("hold", given["hold"]),
        window=seconds("window", given["window"]),
        until_idle=given["until_idle"],
        foxglove=given["foxglove"],
    )
