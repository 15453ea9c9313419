"""Postures with their exact scores, and the best ones found for places of the hands."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np

from lgp.errors import LgpError
from lgp.kinematics.posture import PELVIS, PostureMap, joint_angles
from lgp.kinematics.world import World
from lgp.path.ergonomics import Ergonomics
from lgp.workplace.balance import Balance
from lgp.workplace.held_hands import Aim, HeldHands, Hold
from reba.analysis.score_table import ScoreTable
from reba.arrays import Array, Flags, Indices
from reba.method.classes import angle_classes
from reba.method.rules import Rules
from reba.method.scoring import Missing, score_angles
from reba.method.tables import ACTION_LEVELS
from reba.posture.columns import COLUMNS, GROUP_A, GROUP_B, INDEX, SIDES
from reba.posture.factors import Factors

PARTS: Final = (
    *GROUP_A,
    "load_force",
    *(f"{part}_{side}" for part in (*GROUP_B, "coupling") for side in SIDES),
    "activity",
)
"""Part scores of a posture."""
MARGIN: Final = 2.0
"""[deg] Inside a class that postures are drawn into."""
MAINLY: Final = 3.0
"""How much more a joint moves an angle that was not measured than any other, for it to stay."""
STRAIGHT: Final = 0.02
"""[m] How far the pelvis sinks with knees that count as straight: they bend by about 25 deg."""
SWEEPS: Final = 2
"""Times that the best posture of a place is tried at those beside it."""


@dataclass(frozen=True)
class Posture:
    """A posture and its exact score.

    Attributes:
        angles: (22,) [deg] in the order of `reba.COLUMNS`, NaN = not measured.
        reba, level: REBA and its action level.
        parts: part score -> points.
    """

    angles: Array
    reba: int
    level: int
    parts: dict[str, int]

    def to_dict(self) -> dict[str, Any]:
        """Return the posture as plain data."""
        known = {name: round(float(a), 1) for name, a in zip(COLUMNS, self.angles, strict=True) if not np.isnan(a)}
        return {"reba": self.reba, "action_level": self.level, "risk": ACTION_LEVELS[self.level][0],
                "parts": self.parts, "angles": known}  # fmt: skip


@dataclass(frozen=True)
class Place:
    """A place of the hands, the mean of those that are held.

    Attributes:
        height: above the floor; `distance`: in front of the ankles; `side`: to the right of the middle [m].
        moved: (forward, right, up) from the measured place [m].
        posture: the best posture found, None where the hands do not reach it; `cost`: its ergonomic cost.
    """

    height: float
    distance: float
    side: float
    moved: tuple[float, float, float]
    posture: Posture | None
    cost: float

    @property
    def order(self) -> tuple[float, float]:
        """What places are ordered by: REBA, then the ergonomic cost."""
        return (np.inf, np.inf) if self.posture is None else (self.posture.reba, self.cost)

    def to_dict(self) -> dict[str, Any]:
        """Return the place with its score as plain data, None where it is out of reach."""
        place = {name: round(getattr(self, name), 3) for name in ("height", "distance", "side")}
        moved = dict(zip(("forward", "right", "up"), (round(value, 3) for value in self.moved), strict=True))
        return {**place, "moved": moved, "reba": None if self.posture is None else self.posture.reba}


class Scorer:
    """The exact score of any posture under the factors and rules of one frame of a recording.

    Attributes:
        angles: (22,) [deg] as recorded; `measured`: (22,) which of them were.
        missing: what stands for angles that were not measured.
        load: [kg]; `seated`: whether the person sits.
    """

    def __init__(self, scores: ScoreTable, frame: int) -> None:
        self.angles = scores.angles[frame]
        self.measured: Flags = ~np.isnan(self.angles)
        self.rules: Rules = scores.rules
        self.missing: Missing = "worst" if scores.missing == "worst" else "neutral"
        values = {field.name: np.atleast_1d(getattr(scores.factors, field.name)) for field in fields(Factors)}
        self._factors = {
            name: (value[frame] if len(value) == len(scores.data) else value[0]).item()
            for name, value in values.items()
        }
        self.load = float(self._factors["load"])
        self.seated = str(self._factors["support"]) == "sitting"

    @property
    def measured_posture(self) -> Posture:
        """The posture as recorded."""
        return self.postures(self.angles[None])[0]

    def postures(self, angles: Array) -> list[Posture]:
        """Return angles (n, 22) [deg] with their scores; those that were not measured are left out of both."""
        angles = np.where(self.measured, angles, np.nan)
        scored = score_angles(angles, self._factors, self.rules, self.missing)
        return [
            Posture(
                row,
                int(scored["reba"][n]),
                int(scored["action_level"][n]),
                {name: int(scored[name][n]) for name in PARTS},
            )
            for n, row in enumerate(angles)
        ]

    def held(self, hands: str) -> tuple[str, ...]:
        """Return the hands that are held: those asked for whose arms were measured.

        Raises:
            LgpError: there is none.
        """
        held = tuple(
            f"{side}_hand"
            for side in SIDES
            if hands in (side, "both")
            and all(self.measured[INDEX[f"{part}_flexion_{side}"]] for part in ("upper_arm", "lower_arm"))
        )
        if not held or not self.measured[INDEX["trunk_flexion"]]:
            what = "arm" if hands == "both" else f"{hands} arm"
            raise LgpError(
                f"the {what} or the trunk was not measured, so where the hand is, is unknown; choose a time when it was"
            )
        return held

    def aims(self) -> list[Aim | None]:
        """Return what postures are drawn into: nothing, and the lowest and second classes of trunk, arms and both."""
        groups = (GROUP_A, tuple(f"{part}_{side}" for part in GROUP_B for side in SIDES))
        both = groups[0] + groups[1]
        return [None, *(self._aim(parts, rank) for rank in (0, 1) for parts in (both, *groups))]

    def _aim(self, parts: tuple[str, ...], rank: int) -> Aim:
        low, high = np.full(len(COLUMNS), -np.inf), np.full(len(COLUMNS), np.inf)
        for quantity in angle_classes(self.rules):
            if quantity.part not in parts:
                continue
            # The last class holds every angle: an angle of two classes is drawn into its first.
            one = quantity.classes[min(rank, len(quantity.classes) - 2)]
            margin = min(MARGIN, max(one.high - one.low, 0.0) / 4.0)
            for name in quantity.columns:
                low[INDEX[name]], high[INDEX[name]] = one.low + margin, one.high - margin
        return Aim(low, high)


def hold_of(world: World, q: Array, hands: tuple[str, ...], measured: Flags, seated: bool) -> Hold:
    """Return what is held: the hands of a configuration (nq,), and joints whose angles were not `measured` (22,)."""
    names = [f"human.{hand}" for hand in hands]
    kinematics = world.at(q[None], names)
    posture = PostureMap(world)
    moves = np.abs(posture.evaluate(q[None])[1][0])
    kept = np.zeros(world.nq, bool)
    kept[posture.columns] = moves[~measured].max(axis=0, initial=0.0) > MAINLY * moves[measured].max(axis=0)
    # The pelvis keeps the balance. Knees that were not measured count as straight: it may hardly sink.
    kept[[world.column[f"human.{name}"] for name in PELVIS]] = False
    knees = all(measured[INDEX[f"knee_flexion_{side}"]] for side in SIDES)
    for column, (joint, _, _) in joint_angles().items():
        if not measured[INDEX[column]] and f"human.{joint}" in world.column:
            kept[world.column[f"human.{joint}"]] = True
    turns = [
        all(measured[INDEX[f"wrist_{way}_{hand.removesuffix('_hand')}"]] for way in ("flexion", "deviation", "twist"))
        for hand in hands
    ]
    return Hold(
        hands,
        kinematics.position[0],
        kinematics.rotation[0],
        np.array(turns, bool),
        seated,
        kept,
        np.inf if knees else STRAIGHT,
        q,
    )


class PlacedHands:
    """The best postures found for places of the hands.

    Args:
        near: distance between two places [m] up to which a posture of one is tried at the other.
    """

    def __init__(self, ergonomics: Ergonomics, balance: Balance, hold: Hold, scorer: Scorer, near: float) -> None:
        self.ergonomics, self.scorer, self.near = ergonomics, scorer, near
        self._problems = [HeldHands(ergonomics, balance, hold, aim) for aim in scorer.aims()]
        self._starts = np.array([hold.q, self._problems[0].rest()])

    def best(self, moved: Array) -> list[tuple[Posture, float] | None]:
        """Return for each displacement (n, 3) [m] the posture of the lowest REBA found and its cost, None out of reach.

        Of equal scores that of the least ergonomic cost is taken. With the hands where they are, the measured posture
        is one of those compared.
        """
        best = _Best(self, len(moved))
        which = np.repeat(np.arange(len(moved)), len(self._starts))
        starts, _ = self._problems[0].project(np.tile(self._starts, (len(moved), 1)), moved[which])
        for problem in self._problems:
            best.add(problem.solve(starts, moved[which]), moved, which)
        close = np.linalg.norm(moved[:, None] - moved, axis=2) <= self.near * 1.01
        for _ in range(SWEEPS):
            known, other = np.nonzero(close & ~np.eye(len(moved), dtype=bool) & best.reached[:, None])
            best.add(best.q[known], moved, other)
        measured = self.scorer.measured_posture
        for place in np.flatnonzero(~moved.any(axis=1)):
            best.keep(int(place), measured, float(self._problems[0].cost(self._starts[:1])[0]), self._starts[0])
        return best.scored

    def project(self, q: Array, moved: Array) -> tuple[Array, Flags]:
        """Return postures (B, nq) that hold what is held, and whether they do."""
        return self._problems[0].project(q, moved)

    def cost(self, q: Array) -> Array:
        """Return the ergonomic cost of postures (B, nq)."""
        return self._problems[0].cost(q)


class _Best:
    """The best posture so far of each of n places."""

    def __init__(self, placed: PlacedHands, n: int) -> None:
        self.placed = placed
        self.scored: list[tuple[Posture, float] | None] = [None] * n
        self.q = np.zeros((n, placed.ergonomics.world.nq))

    @property
    def reached(self) -> Flags:
        return np.array([one is not None for one in self.scored])

    def add(self, q: Array, moved: Array, which: Indices) -> None:
        """Compare postures (B, nq), brought to the places `which` (B,)."""
        if not len(q):
            return
        q, holds = self.placed.project(q, moved[which])
        q, which = q[holds], which[holds]
        postures = self.placed.scorer.postures(self.placed.ergonomics.posture.angles(q))
        for own, posture, cost, place in zip(q, postures, self.placed.cost(q).tolist(), which.tolist(), strict=True):
            self.keep(place, posture, cost, own)

    def keep(self, place: int, posture: Posture, cost: float, q: Array) -> None:
        """Keep a posture if it is the best one of its place so far."""
        known = self.scored[place]
        if known is None or (posture.reba, cost) < (known[0].reba, known[1]):
            self.scored[place], self.q[place] = (posture, cost), q
