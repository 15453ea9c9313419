"""`reba live`: options, and the run that follows a source, scores it, writes the lines and the summary."""

from __future__ import annotations

import math
import re
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reba.checks import shown
from reba.command_line import MOST, echo
from reba.errors import RebaError
from reba.interrupts import exit_code
from reba.live.follow import Follower
from reba.live.frames import ReadingOptions, neutral_until
from reba.live.json_lines import LineStore
from reba.live.notices import Notice
from reba.live.output import Latency, write_lines
from reba.live.session import Alert, LiveScorer, score_of_level
from reba.live.sources import GrowingStore, open_growing
from reba.posture.factors import Factors, checked
from reba.scores import named_activity


@dataclass(frozen=True)
class LiveOptions:
    """Options of `reba live`.

    Attributes:
        factors: load and others by name.
        activity: "none", or a comma list.
        rules: preset or TOML file.
        alert: score from which on an alert is raised.
        hold: time for which the score must persist [s].
        window: length of the rolling window [s].
        until_idle: time without data after which the run ends [s], None for no limit.
        foxglove: port of the Foxglove server, None without a server.
    """

    reading: ReadingOptions
    factors: Mapping[str, Any]
    activity: str = "none"
    rules: str = "measured"
    alert: int = 8
    hold: float = 1.0
    window: float = 60.0
    until_idle: float | None = None
    foxglove: int | None = None


def activity_of(text: str) -> dict[str, bool]:
    """Return the named kinds of activity; "auto" and unknown kinds are refused."""
    if text == "auto":
        raise RebaError(
            "activity auto depends on later frames (a posture held for more than a minute is static from its first "
            "second on), which do not exist yet; use none or some of static,repeated,unstable"
        )
    return named_activity(text)


def stdin_descriptor() -> int:
    """Return the file descriptor of standard input."""
    return sys.stdin.fileno()


def run_live(source_name: str, options: LiveOptions) -> int:
    """Score a source to its end, and return the exit code.

    Args:
        source_name: path of an MCAP file that is being written, or "-" for JSON lines on standard input.

    Raises:
        RebaError: the source or an option cannot be used; the summary of the frames scored before is written first.
    """
    activity = activity_of(options.activity)
    neutral_until(options.reading.neutral, 0.0)
    checked(Factors.of({**activity, **options.factors}), 1)
    scorer = LiveScorer(options.rules, options.window, Alert(options.alert, options.hold))
    server = _foxglove_server(options.foxglove)
    latency = Latency()
    follower: Follower | None = None
    code = 0
    try:
        source: GrowingStore = (
            LineStore(stdin_descriptor(), _report)
            if source_name == "-"
            else open_growing(Path(source_name), options.until_idle)
        )
        follower = Follower(source, options.reading, options.factors, activity, _report)
        _follow(follower, scorer, latency, server, options)
    except KeyboardInterrupt:
        code = exit_code()
    except BrokenPipeError:
        follower = None
        raise
    finally:
        if server is not None:
            server.close()
        if follower is not None and (scorer.frames or code):
            _write_summary(follower, scorer, latency, code)
    return code


def _follow(follower: Follower, scorer: LiveScorer, latency: Latency, server: Any, options: LiveOptions) -> None:
    stream = sys.stdout.buffer
    for frames in follower.follow(options.until_idle):
        if isinstance(frames, Notice):
            _report_notice(frames, scorer, server)
            continue
        if not scorer.frames:
            _report_stream(follower)
        records, scores = scorer.add(frames)
        write_lines(stream, records)
        latency.add(time.perf_counter() - follower.received_at, len(records))
        for record in records:
            event = record["alert"]["event"]
            if event is not None:
                relation = "at or above" if event == "raised" else "below"
                _report(
                    f"alert {event} at {record['time']:.2f} s: REBA {relation} {options.alert} for {options.hold:g} s"
                )
        if server is not None:
            server.publish(frames, records, scores, follower.epoch)


def _report_notice(notice: Notice, scorer: LiveScorer, server: Any) -> None:
    """Write a notice as a line of its own, and report it as text."""
    line = scorer.notice(notice)
    write_lines(sys.stdout.buffer, [line])
    _report(f"{notice.kind}: {notice.text}")
    if line["alert"]["event"] is not None:
        _report("alert cleared: " + ("a new segment begins" if notice.segment else "no signal"))
    if server is not None:
        server.publish_notice(line)


def _report_stream(follower: Follower) -> None:
    """Report the recognised stream, unmeasured angles and assumptions."""
    _report(f"{follower.source.path}: {follower.recognised}")
    converter = follower.converter
    if converter is not None and converter.unmeasured:
        _report(f"not measured: {', '.join(converter.unmeasured)}")
    for text in converter.assumed if converter is not None else ():
        _report(f"assumed: {text}")


def _write_summary(follower: Follower, scorer: LiveScorer, latency: Latency, code: int) -> None:
    """Write the summary as the last line, and report it as text."""
    converter = follower.converter
    totals = scorer.summary(follower.missing)
    skipped = follower.source.skipped + (converter.log.skipped if converter is not None else 0)
    late = converter.late if converter is not None else 0
    summary = {
        **totals,
        "profile": converter.profile if converter is not None else None,
        "unmeasured": converter.unmeasured if converter is not None else None,
        "skipped": skipped,
        "out_of_order": late,
        "warnings": converter.log.warnings if converter is not None else [],
        "interrupted": code != 0,
        "latency": latency.to_dict(),
    }
    write_lines(sys.stdout.buffer, [{"summary": summary}])
    left_out = f", {skipped + late} skipped" if skipped + late else ""
    exposure = totals["exposure"]
    mean = exposure["mean_low"]
    scores = "" if mean is None else f", REBA at least {mean:.2f} on average and {totals['max_low']} at most"
    end = "interrupted after" if code else "ended after"
    missing = f", {exposure['missing']:.1f} s missing" if exposure["missing"] >= SHORTEST_MISSING else ""
    _report(f"{end} {totals['frames']} frames ({exposure['seconds']:.1f} s){missing}{left_out}{scores}")


def _foxglove_server(port: int | None) -> Any:
    if port is None:
        return None
    from reba.live.foxglove import FoxgloveServer

    server = FoxgloveServer(port)
    _report(f"open {server.address} in Foxglove or Lichtblick")
    return server


def _report(text: str) -> None:
    echo(f"reba: {' '.join(text.split())}", err=True)


SHORTEST_MISSING = 0.05
"""[s] Missing time that the last message mentions: what its digits can show."""
ALERT_SCORE = 8
"""Default score from which on an alert is raised: high risk, action necessary soon (Hignett & McAtamney 2000)."""
FACTORS = ("load", "coupling", "support")
_FORM = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*(s|min)?")
_UNITS = {None: 1.0, "s": 1.0, "min": 60.0}


def parse_seconds(name: str, text: str) -> float:
    """Return a duration [s]; `name` of the option for the error.

    >>> parse_seconds("window", "1.5min"), parse_seconds("hold", "2")
    (90.0, 2.0)
    """
    form = _FORM.fullmatch(text.strip())
    seconds = float(form[1]) * _UNITS[form[2]] if form is not None else math.inf
    if seconds > MOST:
        raise RebaError(f"--{name} is {shown(text)}; expected seconds up to {MOST}, like 2s, 0.5 or 1min")
    return seconds


def live_options(values: dict[str, Any]) -> LiveOptions:
    """Return the record of the values that click gives."""
    if values["alert"] is not None and values["alert_level"] is not None:
        raise RebaError("--alert and --alert-level are alternatives; give one of them")
    alert = values["alert"] or ALERT_SCORE
    if values["alert_level"] is not None:
        alert = score_of_level(values["alert_level"])
    return LiveOptions(
        reading=ReadingOptions(
            values["profile"], values["topic"], values["neutral"], parse_seconds("settle", values["settle"])
        ),
        factors={name: values[name] for name in FACTORS if values[name] is not None},
        activity=values["activity"],
        rules=values["rules"],
        alert=alert,
        hold=parse_seconds("hold", values["hold"]),
        window=parse_seconds("window", values["window"]),
        until_idle=values["until_idle"],
        foxglove=values["foxglove"],
    )
