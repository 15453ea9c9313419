"""The options of `reba live` as they are typed -> what they mean."""

from __future__ import annotations

import re
from typing import Any

from reba.errors import RebaError
from reba.live.alert import score_of_level
from reba.live.command import Options
from reba.live.reading import Reading

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


def live_options(given: dict[str, Any]) -> Options:
    """Return the options.

    Raises:
        RebaError: one of them cannot be used, or both alert options are given.
    """
    if given["alert"] is not None and given["alert_level"] is not None:
        raise RebaError("--alert and --alert-level say the same; give one of them")
    alert = given["alert"] or ALERT
    if given["alert_level"] is not None:
        alert = score_of_level(given["alert_level"])
    return Options(
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
