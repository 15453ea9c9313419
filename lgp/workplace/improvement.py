"""REBA of a posture as the surface that the hands work at moves, and the place with the lowest score.

The person is fitted to a measured frame; then the hands stay on the surface, wherever it is, and the rest of the body
takes the posture of least ergonomic cost. Every score is the exact REBA of its angles with the factors of the frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from threadpoolctl import threadpool_limits

import dreba
from dreba.surrogates.base import Surrogate
from lgp.defaults import COST
from lgp.errors import LgpError
from lgp.kinematics.world import World
from lgp.path.ergonomics import Ergonomics
from lgp.workplace.balance import Balance
from lgp.workplace.body_fit import BodyFit, fit_body, person
from lgp.workplace.postures import Place, PlacedHands, Posture, Scorer, hold_of
from reba.analysis.exposure import worst_intervals
from reba.analysis.score_table import SCORES, ScoreTable
from reba.arrays import Array
from reba.checks import MOMENT, Allowed, accepts, is_finite, is_number, one_of
from reba.posture.columns import COLUMNS, SIDES

HANDS: Final = ("both", *SIDES)
"""Hands whose places are held."""
SEXES: Final = ("male", "female")
STEP: Final = 0.1
"""[m] Between two places of the surface."""
MOMENTS: Final = 3
"""Worst postures that are looked at unasked."""
HEIGHTS: Final = (0.3, 1.6)
"""[m] Hand heights that are tried at a stature of `OF_STATURE`, in proportion to it."""
DISTANCES: Final = (0.25, 0.65)
"""[m] Distances of the hands in front of the ankles that are tried at this stature: nearer is the person's own body."""
OF_STATURE: Final = 1.75
MOST_PLACES: Final = 1000
"""Places of a grid at most."""
SIDEWAYS: Final = 0.3
"""[m] Displacement to either side that is tried."""


def _is_range(*ends: Any) -> bool:
    return len(ends) == 2 and all(map(is_number, ends)) and -10.0 <= ends[0] <= ends[1] <= 10.0


_RANGE: Final = Allowed(
    "two numbers of metres, the lower one first, or None",
    lambda value: value is None or (isinstance(value, list | tuple) and _is_range(*value)),
)


@dataclass(frozen=True)
class MovedSurface:
    """One frame, and REBA as the surface moves.

    Attributes:
        time: of the frame [s].
        measured: the posture as recorded; `unchanged`: the best one found with the hands where they are.
        fit: mean and largest difference of the body's angles from the measured ones [deg], and the angle of the latter.
        grid: places in the side view, those of one height after another; `sideways`: from the best one to either side.
        here, best: the place as it is, and the best one.
    """

    time: float
    measured: Posture
    fit: tuple[float, float, str]
    grid: tuple[tuple[Place, ...], ...]
    sideways: tuple[Place, ...]
    here: Place
    best: Place

    @property
    def unchanged(self) -> Posture:
        """The posture found for the place as it is, which scores no worse than the measured one."""
        return self.here.posture or self.measured

    @property
    def proposed(self) -> Posture:
        """The posture at the best place."""
        return self.best.posture or self.unchanged

    def to_dict(self) -> dict[str, Any]:
        """Return the frame as plain data, as in `lgp improve --json`."""
        mean, largest, angle = self.fit
        return {
            "time": self.time,
            "fit": {"mean_deg": round(mean, 2), "largest_deg": round(largest, 2), "angle": angle},
            "measured": self.measured.to_dict(),
            "unchanged": {**self.here.to_dict(), **self.unchanged.to_dict()},
            "best": {**self.best.to_dict(), **self.proposed.to_dict()},
            "grid": [place.to_dict() for row in self.grid for place in row],
            "sideways": [place.to_dict() for place in self.sideways],
        }


@dataclass(frozen=True)
class MovedWorkplace:
    """What moving the surface would do to some frames of a recording.

    Attributes:
        moments: the frames.
        person: stature [m], sex, and the hands that are held: of arms that were not measured none is.
        cost: name of the ergonomic cost; `rules`: of the scores.
        unmeasured: angles without a measurement, `missing` what stands for them.
        name: of the recording.
    """

    moments: tuple[MovedSurface, ...]
    person: dict[str, Any]
    cost: str
    rules: str
    unmeasured: tuple[str, ...]
    missing: str
    name: str

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain data, as in `lgp improve --json`."""
        return {
            "person": self.person,
            "cost": self.cost,
            "rules": self.rules,
            "unmeasured": list(self.unmeasured),
            "missing": self.missing,
            "moments": [moment.to_dict() for moment in self.moments],
        }


@accepts(
    LgpError,
    scores=SCORES,
    at=MOMENT.or_none(),
    hands=one_of(*HANDS),
    stature=Allowed("metres", is_finite),
    sex=one_of(*SEXES),
    heights=_RANGE,
    distances=_RANGE,
    step=Allowed("metres from 0.02 to 0.5", lambda value: is_number(value) and 0.02 <= value <= 0.5),
)
def improve(
    scores: ScoreTable,
    *,
    at: float | None = None,
    hands: str = "both",
    stature: float = OF_STATURE,
    sex: str = "male",
    cost: Surrogate | str | Path = COST,
    heights: Sequence[float] | None = None,
    distances: Sequence[float] | None = None,
    step: float = STEP,
) -> MovedWorkplace:
    """Return REBA of postures of a recording as the surface that the hands work at moves: higher, nearer, sideways.

    Args:
        scores: what `reba.score` returns.
        at: time of the frame [s]; by default the worst postures of the recording.
        hands: those whose place is held: "both", "left" or "right"; the other one is free.
        stature: of the person [m], 1.4 to 2.1; segment lengths follow from it.
        sex: "male" or "female", of the body measures.
        cost: a dREBA surrogate, its file or the name of a shipped one, by which postures are found.
        heights: lowest and highest hand height that the surface allows [m].
        distances: smallest and largest distance of the hands in front of the ankles [m].
        step: between two places [m].

    Raises:
        LgpError: an argument is invalid, or there is no frame.
        PostureError: the time lies outside the recording.

    Example:
        >>> import reba, lgp
        >>> scores = reba.score({"trunk_flexion": [65.0], "upper_arm_flexion": [60.0], "lower_arm_flexion": [30.0]})
        >>> moved = lgp.improve(scores, at=0.0, distances=(0.3, 0.4), heights=(0.9, 1.1)).moments[0]
        >>> moved.proposed.reba <= moved.unchanged.reba < moved.measured.reba
        True
    """
    if not len(scores.data):
        raise LgpError("the recording has no frame; give one with frames")
    world = person(float(stature), sex)
    ergonomics = Ergonomics(world, model := cost if isinstance(cost, Surrogate) else dreba.load(cost))
    frames = [one.frame for one in worst_intervals(scores)[:MOMENTS]] if at is None else [scores.frame_at(at)]
    ranges = {
        "height": tuple(heights or (end * stature / OF_STATURE for end in HEIGHTS)),
        "distance": tuple(distances or (end * stature / OF_STATURE for end in DISTANCES)),
    }
    held = {hand for frame in frames for hand in Scorer(scores, frame).held(hands)}
    with threadpool_limits(1):  # of matrices as small as these, threads only wait for each other
        moments = tuple(_moment(scores, frame, world, ergonomics, hands, ranges, step) for frame in frames)
    return MovedWorkplace(
        moments,
        {
            "stature": float(stature),
            "sex": sex,
            "hands": held.pop().removesuffix("_hand") if len(held) == 1 else "both",
        },
        model.kind,
        scores.rules.name,
        scores.unmeasured,
        Scorer(scores, frames[0]).missing,
        Path(scores.postures.source).name,
    )


def _moment(
    scores: ScoreTable,
    frame: int,
    world: World,
    ergonomics: Ergonomics,
    hands: str,
    ranges: dict[str, tuple[float, ...]],
    step: float,
) -> MovedSurface:
    scorer = Scorer(scores, frame)
    held = scorer.held(hands)
    balance = Balance(world, scorer.load, held)
    fit = fit_body(world, scorer.angles, balance, standing=not scorer.seated)
    hold = hold_of(world, fit.q, held, scorer.measured, scorer.seated)
    middle = hold.places.mean(axis=0)
    forward = _steps(float(middle[0]), ranges["distance"], step)
    up = _steps(float(middle[2]), ranges["height"], step)
    if len(forward) * len(up) > MOST_PLACES:
        raise LgpError(
            f"heights and distances give {len(forward) * len(up)} places in steps of {step:g} m, expected at most "
            f"{MOST_PLACES}; give a longer step or a smaller range"
        )
    placed = PlacedHands(ergonomics, balance, hold, scorer, step)

    def places(moved: Array) -> tuple[Place, ...]:
        best = placed.best(moved)
        return tuple(_place(middle, one, posture) for one, posture in zip(moved, best, strict=True))

    flat = np.array([[x, 0.0, z] for z in up for x in forward])
    tried = places(flat)
    grid = tuple(tried[at : at + len(forward)] for at in range(0, len(tried), len(forward)))
    here = next(place for place in tried if place.moved == (0.0, 0.0, 0.0))
    best = min(tried, key=lambda place: place.order)
    x, _, z = best.moved
    aside = np.array([y for y in np.arange(-SIDEWAYS, SIDEWAYS + step / 2, step) if abs(y) > step / 2])
    beside = places(np.array([[x, -y, z] for y in aside]))
    sideways = tuple(sorted([*beside, best], key=lambda place: place.side))
    return MovedSurface(
        float(scores.time[frame]),
        scorer.measured_posture,
        _nearness(fit),
        grid,
        sideways,
        here,
        # To a side only where that lowers the score, and no farther than it takes.
        min(sideways, key=lambda place: (place.order[0], abs(place.moved[1]), place.order)),
    )


def _steps(here: float, limits: Sequence[float], step: float) -> list[float]:
    """Return displacements in steps to places within limits [m], and none at all; lowest first."""
    first, last = (int(np.floor((end - here) / step + sign * 1e-9)) for end, sign in zip(limits, (-1, 1), strict=True))
    return [round(number * step, 6) + 0.0 for number in sorted({*range(first + 1, last + 1), 0})]


def _nearness(fit: BodyFit) -> tuple[float, float, str]:
    away = np.abs(fit.away)
    worst = int(np.nanargmax(away))
    return float(np.nanmean(away)), float(away[worst]), COLUMNS[worst].replace("_", " ")


def _place(middle: Array, moved: Array, scored: tuple[Posture, float] | None) -> Place:
    x, y, z = (float(value) for value in moved)
    forward, left, up = (float(value) for value in middle + moved)
    posture, cost = scored or (None, float("inf"))
    return Place(up, forward, -left + 0.0, (x, -y + 0.0, z), posture, cost)
