"""Accounts of a recording: for every stream, what was read = what is in the table + what is not, by reason."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from reba.errors import ReadError
from reba.readers.recognise import Match
from reba.readers.recording.stream import ASKED_FOR, LOST, UNUSED, ReadLog, Recording, Stream
from reba.readers.signal_names import bodies

TABLE: Final = ("table", "table of points")
"""Ends of the formats of streams that are rows of a table."""
NOTED: Final = 0.01
"""Share of the messages above which those that are not used are a warning; a choice."""


def accounts_of(
    recording: Recording, match: Match, log: ReadLog, seconds: float, frames: Mapping[str, ReadLog]
) -> tuple[dict[str, Any], ...]:
    """Return the account of each stream of postures, that of the one that was read first.

    Args:
        log: of its reading.
        seconds: from the first to the last frame of the table.
        frames: name of another stream of frames that was read, as that of the pelvis -> log of its reading.
    """
    _name_other_bodies(match, log)
    result = [{"stream": match.stream.name, **log.account(), "seconds": _seconds(match.stream, seconds)}]
    result += _of_static(match.stream, seconds, used=True)
    for stream in recording.streams:
        if not _same_rows(stream, match.stream):
            read = stream.total or max(stream.messages.values(), default=stream.count or 0)
            account = _not_used(read)
            if stream.kind == "frames" and stream.name in frames:
                account = frames[stream.name].account()
            used = seconds if account["used"] else 0.0
            result.append({"stream": stream.name, **account, "seconds": _seconds(stream, used)})
            result += _of_static(stream, used, used=bool(account["used"]))
    return tuple(result)


def _of_static(stream: Stream, seconds: float, *, used: bool) -> list[dict[str, Any]]:
    """Return the accounts of static transforms, which hold as long [s] as their stream is used."""
    return [
        {
            "stream": topic,
            **(log.account() if used else _not_used(log.messages)),
            "seconds": {"read": round(seconds, 3), "used": round(seconds, 3)},
            "static": True,
        }
        for topic, log in stream.static.items()
    ]


def _not_used(read: int) -> dict[str, Any]:
    return {"read": read, "used": 0, "not_used": {"other_stream": read} if read else {}}


def _same_rows(stream: Stream, other: Stream) -> bool:
    """Return whether two streams are one, or the same rows of a table, whose points are offered as joints too."""
    tables = stream.format.endswith(TABLE) and other.format.endswith(TABLE)
    return stream.name in (other.name, *other.topics) and (stream.kind == other.kind or tables)


def _name_other_bodies(match: Match, log: ReadLog) -> None:
    """Move messages of other bodies of the profile from those without a signal of it."""
    if match.profile is None or not log.unused["other_signals"] or not match.stream.messages:
        return
    mine = {name for signals in (match.names or {}).values() for name in signals}
    others = 0
    for names in bodies(match.profile, match.stream).values():
        if not mine & set(names.values()):
            others += max(match.stream.messages.get(name, 0) for name in names.values())
    others = min(others, log.unused["other_signals"])
    log.unused["other_body"] += others
    log.unused["other_signals"] -= others


def _seconds(stream: Stream, used: float) -> dict[str, float]:
    ends = [end for spans in stream.present.values() for span in spans for end in span]
    read = max(ends) - min(ends) if ends else used
    return {"read": round(max(read, used), 3), "used": round(used, 3)}


def of_interval(account: dict[str, Any], inside: int, seconds: float) -> dict[str, Any]:
    """Return the account of a stream of which an interval was asked for.

    Args:
        account: of the complete reading.
        inside: messages in the interval, of those that it used.
        seconds: from the first to the last frame of the interval.

    >>> account = {"read": 50, "used": 49, "not_used": {"repeated_time": 1}, "seconds": {"read": 0.98}}
    >>> of_interval(account, 20, 0.4)["not_used"]
    {'repeated_time': 1, 'outside_interval': 29}
    """
    if account.get("static"):  # what holds is used wherever the interval is
        inside = account["used"]
    outside = account["used"] - inside
    return {
        **account,
        "used": inside,
        "not_used": {**account["not_used"], **({ASKED_FOR: outside} if outside else {})},
        "seconds": {**account["seconds"], "used": round(seconds, 3)},
    }


def account_warnings(account: dict[str, Any]) -> list[str]:
    """Return a warning for each reason that leaves out more than `NOTED` of the messages of a stream.

    >>> account_warnings({"stream": "/joints", "read": 50, "used": 49, "not_used": {"repeated_time": 1}})
    ['1 of 50 messages of /joints repeat the time of another: not used']
    """
    return [
        f"{count} of {account['read']} messages of {account['stream']} {UNUSED[reason]}: not used"
        for reason, count in account["not_used"].items()
        if reason in UNUSED and reason != ASKED_FOR and count > NOTED * account["read"]
    ]


def refuse_losses(path: str, account: dict[str, Any], log: ReadLog) -> None:
    """Refuse a recording of which more than `NOTED` is lost: damaged, without a time, or two messages of one time.

    Raises:
        ReadError: it is.
    """
    lost = {reason: account["not_used"][reason] for reason in LOST if reason in account["not_used"]}
    if sum(lost.values()) > NOTED * account["read"]:
        texts = ", ".join(f"{count} {reason.replace('_', ' ')}" for reason, count in lost.items())
        first = f"; the first: {log.first_skipped}" if log.first_skipped else ""
        raise ReadError(
            path,
            f"{sum(lost.values())} of {account['read']} messages of {account['stream']} are lost ({texts}){first}",
            hint="read it without strict to use the others",
        )
