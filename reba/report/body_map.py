"""The body map: every part of the body in the colour of the time that it spends in its upper classes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from reba.analysis.wording import percent
from reba.method.tables import PART_MAXIMA
from reba.posture.columns import GROUP_A, GROUP_B, SIDES
from reba.printable import as_markup
from reba.report.labels import PART_COLOURS, PARTS
from reba.report.summary import RecordingSummary

STEPS: Final = (0.0, 0.0, 0.1, 0.25, 0.5)
"""Shares of time from which the next colour counts."""
COLOURS: Final = (PART_COLOURS[0], PART_COLOURS[2], PART_COLOURS[3], PART_COLOURS[4], PART_COLOURS[6])
SCALE: Final = tuple(zip(("0 %", "under 10 %", "10 to 25 %", "25 to 50 %", "over 50 %"), COLOURS, strict=True))
"""Each colour with the shares that it stands for."""
_PLACES: Final[dict[str, tuple[str, float, float, str]]] = {
    "neck": ('<circle cx="150" cy="34" r="21"/><rect x="141" y="52" width="18" height="16" rx="5"/>', 196, 16, "start"),
    "trunk": (
        '<rect x="118" y="68" width="64" height="96" rx="18"/><path class="leader" d="M174 78L194 58"/>',
        198,
        50,
        "start",
    ),
    "legs": ('<path d="M134 172v112M166 172v112"/>', 214, 240, "start"),
    "upper_arm_right": ('<path d="M106 82L88 134"/>', 74, 104, "end"),
    "lower_arm_right": ('<path d="M86 142L76 190"/>', 60, 158, "end"),
    "wrist_right": ('<circle cx="73" cy="206" r="10"/>', 52, 212, "end"),
    "upper_arm_left": ('<path d="M194 82L212 134"/>', 226, 104, "start"),
    "lower_arm_left": ('<path d="M214 142L224 190"/>', 240, 158, "start"),
    "wrist_left": ('<circle cx="227" cy="206" r="10"/>', 246, 212, "start"),
}
"""Part score -> its shape on a person seen from the front, and where its label stands."""


@dataclass(frozen=True)
class UpperShare:
    """Share of time of a part in its upper classes, at both ends of the range; `least` is their lowest score."""

    name: str
    title: str
    low: float
    high: float
    least: int

    @property
    def text(self) -> str:
        """The share as text."""
        low, high = percent(self.low), percent(self.high)
        unit = " %"
        return low if low == high else f"{low.removesuffix(unit)} to {high}"


def upper_shares(record: RecordingSummary) -> list[UpperShare]:
    """Return the share of each part of the body: the time above half way from its lowest to its highest score."""
    shares = []
    for name in _PLACES if record.frames else ():
        part = name.removesuffix("_left").removesuffix("_right")
        assert part in GROUP_A + GROUP_B
        least = 1 + (PART_MAXIMA[part] - 1) // 2 + 1
        low, high = (
            float(record.weights[end[name] >= least].sum() / record.seconds)
            for end in (record.ends.low, record.ends.high)
        )
        shares.append(UpperShare(name, PARTS[name].removeprefix("Left ").removeprefix("Right "), low, high, least))
    return shares


def body_map(record: RecordingSummary) -> str:
    """Return the body map as SVG."""
    shares = upper_shares(record)
    drawn = []
    for one in shares:
        shape, x, y, anchor = _PLACES[one.name]
        step = int(np.searchsorted(STEPS, one.low, side="right")) - 1 if one.low > 0 else 0
        line = shape.startswith("<path")
        kind = f'class="limb" stroke="{COLOURS[step]}"' if line else f'fill="{COLOURS[step]}"'
        outline = f'<g class="outline">{shape}</g>' if line else ""
        drawn.append(f"{outline}<g {kind}>{shape}</g>")
        name = one.title.capitalize()
        drawn.append(f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}">{name}</text>')
        drawn.append(f'<text class="share" x="{x:g}" y="{y + 15:g}" text-anchor="{anchor}">{one.text}</text>')
    for side, x in zip(SIDES, (245, 55), strict=True):
        drawn.append(f'<text class="side" x="{x}" y="300" text-anchor="middle">{side}</text>')
    texts = "; ".join(f"{PARTS[one.name].lower()} {one.text}" for one in shares)
    label = as_markup(f"Share of time at high scores: {texts}")
    return f'<svg class="body-map" viewBox="-36 0 382 310" role="img" aria-label="{label}">{"".join(drawn)}</svg>'
