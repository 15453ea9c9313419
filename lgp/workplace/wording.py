"""What was found for a moved surface, in sentences; alike in the terminal and on the page."""

from __future__ import annotations

from typing import Final

from lgp.workplace.improvement import MovedSurface, MovedWorkplace
from lgp.workplace.postures import Place, Posture
from reba.analysis.wording import both
from reba.method.tables import ACTION_LEVELS
from reba.report.labels import body_parts

LIMITS: Final = (
    "A score shows what the place allows: a person may take another posture there.",
    "The feet stay where they are: a step towards the work is a smaller distance here.",
    "Neither the edge of a table nor the load itself is in the way of the body, and how far a person can lift is not "
    "asked.",
    "How an upper arm is turned about its own axis is not in the posture table; hands are where the planner's body has "
    "them in the measured angles.",
    "Load, grip, support and activity stay as they are.",
)
"""What the figures leave out."""


def scored(posture: Posture) -> str:
    """Return a score with its risk: "REBA 9 (high)"."""
    return f"REBA {posture.reba} ({ACTION_LEVELS[posture.level][0]})"


def where(place: Place) -> str:
    """Return where the hands are: "94 cm high, 25 cm in front of the ankles, 13 cm to the left"."""
    side = round(100 * place.side)
    aside = f", {abs(side)} cm to the {'right' if side > 0 else 'left'}" if side else ""
    return f"{100 * place.height:.0f} cm high, {100 * place.distance:.0f} cm in front of the ankles{aside}"


def move(place: Place) -> str:
    """Return the move of the surface: "30 cm higher, 10 cm nearer", "where it is" without one."""
    words = (("farther", "nearer"), ("to the right", "to the left"), ("higher", "lower"))
    steps = [
        f"{abs(100 * value):.0f} cm {ways[value < 0]}"
        for value, ways in zip(place.moved, words, strict=True)
        if abs(value) > 1e-6
    ]
    return ", ".join(reversed(steps)) or "where it is"


def mark(place: Place, moment: MovedSurface, *, in_grid: bool) -> str:
    """Return "best" for the best place, "now" for that of the surface as it is, "" for others.

    In the grid, whose places are not moved sideways, the best one is that of the best height and distance.
    """
    (x, y, z), (forward, side, up) = place.moved, moment.best.moved
    if (x, z) == (forward, up) and (in_grid or y == side):
        return "best"
    return "now" if place.moved == moment.here.moved else ""


def result(moment: MovedSurface, workplace: MovedWorkplace) -> str:
    """Return the result in a sentence or two."""
    filled = f", unmeasured angles {workplace.missing}" if workplace.unmeasured else ""
    first = f"{scored(moment.measured)} as measured{filled}."
    if moment.unchanged.reba < moment.measured.reba:
        first += f" With the hands where they are, the best posture found has {scored(moment.unchanged)}."
    else:
        first += " With the hands where they are, no better posture was found."
    if moment.proposed.reba >= moment.unchanged.reba:
        return f"{first} No place of the surface that was tried lowers it."
    heights = [place.height for row in moment.grid for place in row if _equals(place, moment)]
    ends = both(*(f"{100 * end:.0f} cm" for end in (min(heights), max(heights)))) if heights else ""
    among = f"; at hand heights of {ends} some place has this score" if len(set(heights)) > 1 else ""
    return f"{first} With the surface {move(moment.best)}: {scored(moment.proposed)}{among}."


def _equals(place: Place, moment: MovedSurface) -> bool:
    return place.posture is not None and place.posture.reba == moment.proposed.reba


def nearness(moment: MovedSurface) -> str:
    """Return how near the body comes to the measured posture."""
    mean, largest, angle = moment.fit
    if largest < 0.05:
        return "The body has the measured angles."
    return f"The body has the measured angles within {mean:.1f} deg on average, {largest:.1f} deg at most ({angle})."


def assumptions(workplace: MovedWorkplace) -> list[str]:
    """Return what was assumed and left out, one sentence each."""
    person = workplace.person
    held = "both hands where they work" if person["hands"] == "both" else f"the {person['hands']} hand where it works"
    notes = [f"A {person['sex']} body of {person['stature']:g} m; {held}; ergonomic cost {workplace.cost}."]
    if workplace.unmeasured:
        names = ", ".join(body_parts(workplace.unmeasured))
        notes.append(f"Not measured, taken as {workplace.missing} and not moved: {names}.")
    return [*notes, *LIMITS]
