"""What was assumed, given or not measured, and what that leaves open."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from reba.factors import ACTIVITIES, ASSUMED, COUPLINGS, FACTORS, flag, load_kg
from reba.posture import ANGLES, SIDES
from reba.report.phrases import angle_name, percent, span
from reba.report.recording import Recording
from reba.report.words import BODY, PARTS, RULES
from reba.report.words import FACTORS as FACTOR_WORDS
from reba.rules import PRESETS


@dataclass(frozen=True)
class Unmeasured:
    """Angles of one part that were not measured, why, and the mean part score they leave."""

    part: str
    angles: tuple[str, ...]
    why: tuple[str, ...]
    leaves: str


def factor_rows(record: Recording) -> list[tuple[str, str, str]]:
    """Return (factor, value, where it comes from) of every factor."""
    used = record.scores.factors
    return [
        (FACTOR_WORDS.get(name, name), _value(record, name, getattr(used, name)), _origin(record, name))
        for name in FACTORS
    ]


def _origin(record: Recording, name: str) -> str:
    if name in record.scores.activity_causes:
        return "found in the movement"
    if name in ACTIVITIES and record.frames < 2 and isinstance(getattr(record.scores.factors, name), np.ndarray):
        return "too short to tell"
    return "assumed" if ASSUMED.get(name) in record.scores.assumed else "given"


def _value(record: Recording, name: str, value: Any) -> str:
    """Return a factor in words: one value, its range, or the share of time of each value."""
    n = record.frames
    if not n:
        return "no frames"
    if name == "load":
        kilograms = load_kg(value, n)
        return span(float(kilograms.min()), float(kilograms.max()), 0 if (kilograms % 1 == 0).all() else 1)
    if name.startswith("coupling"):
        words: tuple[str, ...] = COUPLINGS
        which = record.scores.data[name].to_numpy(np.int64)
    elif name == "support":
        which, kinds = pd.factorize(np.atleast_1d(np.asarray(value, object)))
        words = tuple(str(kind).strip().lower() for kind in kinds)
    else:
        words, which = ("no", "yes"), flag(name, value, n).astype(np.int64)
    seconds = np.bincount(np.broadcast_to(which, (n,)), record.weights)
    shares = {words[kind]: float(share) for kind, share in enumerate(seconds / record.seconds) if share > 0}
    if len(shares) == 1:
        return next(iter(shares))
    return ", ".join(f"{word} {percent(share)}" for word, share in shares.items())


def unmeasured_rows(record: Recording) -> list[Unmeasured]:
    """Return what was not measured, part by part."""
    of_angle = {angle.name: angle.columns for angle in ANGLES}
    why = record.scores.postures.why_unmeasured
    rows = []
    for part, _, names in BODY:
        columns = [c for name in names for c in of_angle[name] if c in record.scores.unmeasured]
        if not columns:
            continue
        sides = [side for side in SIDES if any(column.endswith(side) for column in columns)]
        sided = [f"{part}_{side}" for side in sides if f"{part}_{side}" in PARTS] or [part]
        means = [
            [float(np.average(end[one], weights=record.weights)) for one in sided] if record.frames else []
            for end in (record.ends.low, record.ends.high)
        ]
        leaves = span(min(means[0]), max(means[1]), 1) if means[0] else "not known"
        reasons = tuple(dict.fromkeys(why.get(column, "not in the recording") for column in columns))
        title = " and ".join(PARTS[one].lower() for one in sided).capitalize()
        rows.append(Unmeasured(title, tuple(angle_name(column) for column in columns), reasons, leaves))
    return rows


def rule_rows(record: Recording) -> list[tuple[str, str, str, bool]]:
    """Return (field, value, meaning, whether it differs from the preset "measured") of every rule."""
    usual = PRESETS["measured"]
    rows = []
    for field in dataclasses.fields(record.scores.rules):
        value = getattr(record.scores.rules, field.name)
        text = ("yes" if value else "no") if isinstance(value, bool) else f"{value:g}" if _number(value) else str(value)
        rows.append((field.name, text, RULES.get(field.name, ""), value != getattr(usual, field.name)))
    return rows


def _number(value: object) -> bool:
    return isinstance(value, (int, float))


def activity_rows(record: Recording) -> list[tuple[str, str]]:
    """Return (kind of activity, the parts that caused it and for how long)."""
    rows = []
    for kind, causes in record.scores.activity_causes.items():
        parts = sorted(((share, PARTS.get(part, part)) for part, share in causes.items() if share > 0), reverse=True)
        rows.append((kind, ", ".join(f"{name} {percent(share)}" for share, name in parts) or "did not occur"))
    return rows
