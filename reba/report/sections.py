"""Content of the sections: angles, assumptions, rules, activity, and the contributions of the parts."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from reba.analysis.contributions import GROUPS, lowered
from reba.analysis.exposure import column
from reba.analysis.wording import percent, span
from reba.arrays import Array
from reba.method.classes import angle_classes
from reba.method.rules import PRESETS
from reba.method.tables import PART_MAXIMA
from reba.posture.angles import against_gravity
from reba.posture.columns import INDEX, PART_COLUMNS
from reba.posture.factors import ACTIVITIES, ASSUMED, COUPLINGS, FACTORS, flag, load_kg
from reba.report.labels import FACTORS as FACTOR_TITLES
from reba.report.labels import PARTS, RULES, angle_name
from reba.report.summary import RecordingSummary

QUANTILES: Final = (0.05, 0.50, 0.95)
"""Time-weighted quantiles of the table of angles: 5th, 50th and 95th percentile."""


@dataclass(frozen=True)
class AngleRow:
    """One measured angle; `name` as in a sentence.

    Attributes:
        lowest, p5, p50, p95, highest: extremes and time-weighted percentiles [deg].
        measured: share of time with a value.
        beyond: (class as text, share of the measured time) of every occurring class above the lowest one.
    """

    name: str
    lowest: float
    p5: float
    p50: float
    p95: float
    highest: float
    measured: float
    beyond: tuple[tuple[str, float], ...]


def angle_rows(record: RecordingSummary) -> list[AngleRow]:
    """Return the rows of the measured angles in worksheet order; upper arms against the reference of the rules."""
    if not record.frames:
        return []
    angles = np.array(record.scores.angles.T, np.float64, order="C")
    if record.scores.rules.upper_arm_reference == "gravity":
        against_gravity(angles)
    rows = []
    for quantity in angle_classes(record.scores.rules):
        for name in quantity.columns:
            values = angles[INDEX[name]]
            known = ~np.isnan(values)
            if not known.any():
                continue
            weights = record.weights[known]
            values = values[known]
            unassigned = np.ones(len(values), bool)
            beyond = []
            for index, one in enumerate(quantity.classes):
                inside = unassigned & (values >= one.low) & (values <= one.high)
                unassigned &= ~inside
                share = float(weights[inside].sum() / weights.sum())
                if index and share > 0:
                    beyond.append((one.text, share))
            p5, p50, p95 = _quantiles(values, weights)
            rows.append(
                AngleRow(
                    name=angle_name(name),
                    lowest=float(values.min()),
                    p5=p5,
                    p50=p50,
                    p95=p95,
                    highest=float(values.max()),
                    measured=float(weights.sum() / record.seconds),
                    beyond=tuple(beyond),
                )
            )
    return rows


def _quantiles(values: Array, weights: Array) -> list[float]:
    """Return the weighted `QUANTILES`; each is a value that occurred."""
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order])
    at = np.searchsorted(cumulative, np.array(QUANTILES) * cumulative[-1] - 1e-9)
    return [float(value) for value in values[order][np.minimum(at, len(values) - 1)]]


@dataclass(frozen=True)
class UnmeasuredPart:
    """Unmeasured angles of one part, the reasons, and the range of the mean part score that they leave."""

    part: str
    angles: tuple[str, ...]
    why: tuple[str, ...]
    leaves: str


def factor_rows(record: RecordingSummary) -> list[tuple[str, str, str]]:
    """Return (factor, value, origin) of every factor."""
    used = record.scores.factors
    return [
        (FACTOR_TITLES.get(name, name), _value(record, name, getattr(used, name)), _origin(record, name))
        for name in FACTORS
    ]


def _origin(record: RecordingSummary, name: str) -> str:
    if name in record.scores.activity_causes:
        return "derived from the movement"
    if name in ACTIVITIES and record.frames < 2 and isinstance(getattr(record.scores.factors, name), np.ndarray):
        return "too short to tell"
    return "assumed" if ASSUMED.get(name) in record.scores.assumed else "given"


def _value(record: RecordingSummary, name: str, value: Any) -> str:
    """Return a factor as text: one value, its range, or the share of time of each value."""
    n = record.frames
    if not n:
        return "no frames"
    if name == "load":
        kilograms = load_kg(value, n)
        return span(float(kilograms.min()), float(kilograms.max()), 0 if (kilograms % 1 == 0).all() else 1)
    if name.startswith("coupling"):
        names: tuple[str, ...] = COUPLINGS
        codes = record.scores.data[name].to_numpy(np.int64)
    elif name == "support":
        codes, kinds = pd.factorize(np.atleast_1d(np.asarray(value, object)))
        names = tuple(str(kind).strip().lower() for kind in kinds)
    else:
        names, codes = ("no", "yes"), flag(name, value, n).astype(np.int64)
    seconds = np.bincount(np.broadcast_to(codes, (n,)), record.weights)
    shares = {names[code]: float(share) for code, share in enumerate(seconds / record.seconds) if share > 0}
    if len(shares) == 1:
        return next(iter(shares))
    return ", ".join(f"{text} {percent(share)}" for text, share in shares.items())


def unmeasured_rows(record: RecordingSummary) -> list[UnmeasuredPart]:
    """Return the parts with unmeasured angles in worksheet order."""
    why = record.scores.postures.why_unmeasured
    rows = []
    for part, title in PARTS.items():
        columns = [column for column in PART_COLUMNS.get(part, ()) if column in record.scores.unmeasured]
        if not columns:
            continue
        ends = (record.ends.low[part], record.ends.high[part])
        low, high = (float(np.average(end, weights=record.weights)) if record.frames else None for end in ends)
        reasons = tuple(dict.fromkeys(why.get(column, "not in the recording") for column in columns))
        rows.append(UnmeasuredPart(title, tuple(map(angle_name, columns)), reasons, span(low, high, 1)))
    return rows


def rule_rows(record: RecordingSummary) -> list[tuple[str, str, str, bool]]:
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


def activity_rows(record: RecordingSummary) -> list[tuple[str, str]]:
    """Return (kind of activity, its causing parts with their shares of time)."""
    rows = []
    for kind, causes in record.scores.activity_causes.items():
        parts = sorted(((share, PARTS.get(part, part)) for part, share in causes.items() if share > 0), reverse=True)
        rows.append((kind, ", ".join(f"{name} {percent(share)}" for share, name in parts) or "did not occur"))
    return rows


@dataclass(frozen=True)
class PartShare:
    """Time in each score of one part.

    Attributes:
        shares: (score, share of time) of the occurring scores, lowest first.
        undetermined: share of time without a single score.
        mean_low, mean_high: time-weighted mean at both ends of the range.
        highest: maximum score of the part.
    """

    title: str
    shares: tuple[tuple[int, float], ...]
    undetermined: float
    mean_low: float
    mean_high: float
    highest: int


@dataclass(frozen=True)
class PartContribution:
    """Contribution of one part: mean REBA if it always had its lowest score, and the difference to the actual mean."""

    title: str
    mean: float
    drop: float


def part_shares(record: RecordingSummary) -> list[PartShare]:
    """Return the share of time in each part score, in worksheet order."""
    if not record.frames:
        return []
    rows = []
    weights, total = record.weights, record.seconds
    for name, title in PARTS.items():
        values = column(record.scores, name)
        known = ~np.isnan(values)
        seconds = np.bincount(values[known].astype(int), weights[known])
        shares = tuple((score, float(s / total)) for score, s in enumerate(seconds.tolist()) if s > 0)
        low, high = (float(np.average(end[name], weights=weights)) for end in (record.ends.low, record.ends.high))
        part = next(part for part in PART_MAXIMA if name.startswith(part))
        rows.append(PartShare(title, shares, float(weights[~known].sum() / total), low, high, PART_MAXIMA[part]))
    return rows


def part_contributions(record: RecordingSummary) -> list[PartContribution]:
    """Return the contribution of each part to the mean REBA (unmeasured angles neutral), largest first.

    Every occurring combination of part scores is scored again with one part at its lowest score.
    """
    if not record.frames:
        return []
    contributions = []
    for one in lowered(record.ends.low, record.weights, record.scores.rules.two_sides):
        before, after = (float(np.average(reba, weights=one.weights)) for reba in (one.before, one.after))
        contributions.append(PartContribution(GROUPS[one.group], after, before - after))
    return sorted(contributions, key=lambda part: -part.drop)
