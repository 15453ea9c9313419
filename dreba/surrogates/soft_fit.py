"""Fit of the soft tables: thresholds, step heights, shared points and all 240 cells, by projected Adam.

Adam: Kingma & Ba (2015), Adam: A Method for Stochastic Optimization, algorithm 1. After each update the parameters are
projected onto those of a score: heights not negative, two adjustments never worth less than one, and Tables A, B and C
non-decreasing along every axis.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from dreba.surrogates.soft_steps import PAIRED, ROWS
from dreba.surrogates.soft_tables import CORNERS_AB, CORNERS_C, MONOMIALS_AB, MONOMIALS_C, Pass, SoftTables
from reba.arrays import Array, Indices
from reba.method.steps import STEPS
from reba.method.tables import TABLE_A, TABLE_B

BATCH: Final = 512
"""Poses of an update, about 50 of each class if ten classes are balanced."""
RATES: Final[dict[str, float]] = {
    "thresholds": 1.5, "heights": 0.08, "overlap": 0.08, "table_a": 0.15, "table_b": 0.15, "table_c": 0.15,
}  # fmt: skip
"""Initial step size of each block of parameters [deg or points]; it decays to 0 by half a cosine."""
_DECAY: Final = (0.9, 0.99)
"""Decay rates of the mean and the mean square of the gradients, beta_1 and beta_2 of Adam."""
BALANCE_EXPONENT: Final = 0.4
"""Exponent of the relative RMSE of a class in its weight; 0 for constant weights."""
BALANCE_UPDATES: Final = 20
"""Number of updates of the class weights during a fit."""
_SWEEPS: Final = 2
"""Sweeps of the projection onto monotone tables after each update; `_monotone` completes it after the last."""
_MIRRORED: Final = np.array([step.sense == 0 for step in STEPS])
_ADJUSTMENTS: Final = tuple(
    np.array([step.part == part and bool(step.adjustment) for step in STEPS]) for part in ("trunk", "neck", "wrist")
)
_INTO_STEPS: Final = (np.arange(len(STEPS))[:, None] == ROWS.step[None, :]).astype(float)


def learn(
    start: SoftTables,
    angles: Array,
    scores: Array,
    weights: Array,
    added: Array,
    activity: Any,
    updates: int,
    rng: np.random.Generator,
) -> SoftTables:
    """Return tables fitted to n poses by weighted least squares, at the temperature of the initial tables `start`.

    Args:
        angles: (n, 22) [deg], with true REBA scores (n,).
        weights: (n,) weights of the squared errors, not negative.
        added: (3, n) or (3, 1) points added to Score A and both Scores B.
        activity: points added to the total, a scalar or (n,).
        updates: number of updates with `BATCH` poses each.
        rng: generator of the order of the poses.
    """
    columns = np.ascontiguousarray(angles.T)
    target = scores - activity
    shares = weights / weights.mean()
    added = np.broadcast_to(added, (3, len(scores)))
    mean = {name: np.zeros_like(getattr(start, name)) for name in RATES}
    square = {name: np.zeros_like(getattr(start, name)) for name in RATES}
    class_weights = _ClassWeights(scores)
    tables = start
    for update, batch in enumerate(_batches(len(scores), updates, rng)):
        run = tables.forward(columns[:, batch], added[:, batch])
        error = run.value - target[batch]
        weight = shares[batch] * class_weights.weights(batch, error, shares[batch])
        slope = by_parameters(tables, run, error * weight / len(batch))
        rate = 0.5 * (1.0 + np.cos(np.pi * update / updates))
        changed = {}
        for name in RATES:
            mean[name] += (1.0 - _DECAY[0]) * (slope[name] - mean[name])
            square[name] += (1.0 - _DECAY[1]) * (slope[name] ** 2 - square[name])
            step = mean[name] / (1.0 - _DECAY[0] ** (update + 1))
            step /= np.sqrt(square[name] / (1.0 - _DECAY[1] ** (update + 1))) + 1e-8
            changed[name] = getattr(tables, name) - RATES[name] * rate * step
        tables = _admissible(tables, changed)
        if (update + 1) % max(updates // BALANCE_UPDATES, 1) == 0:
            class_weights.update()
    return _monotone(tables)


def _batches(n: int, updates: int, rng: np.random.Generator) -> Iterator[Indices]:
    """Yield the indices of the poses of each update; every pose is used once before any is used again."""
    size = min(BATCH, n)
    per_pass = n // size
    for update in range(updates):
        place = update % per_pass
        if place == 0:
            order = rng.permutation(n)
        yield order[place * size : (place + 1) * size]


class _ClassWeights:
    """Weights of the REBA classes that balance their errors: classes of larger RMSE get larger weights."""

    def __init__(self, scores: Array) -> None:
        self.classes, self.number = np.unique(np.round(scores), return_inverse=True)
        self.weight = np.ones(len(self.classes))
        self.square, self.count = np.zeros(len(self.classes)), np.zeros(len(self.classes))

    def weights(self, batch: Indices, error: Array, share: Array) -> Array:
        """Return the weights of poses and accumulate their squared errors."""
        number = self.number[batch]
        self.square += np.bincount(number, share * error**2, minlength=len(self.classes))
        self.count += np.bincount(number, share, minlength=len(self.classes))
        return self.weight[number]

    def update(self) -> None:
        """Update the weights from the errors accumulated since the last update."""
        rmse = np.sqrt(self.square / np.maximum(self.count, 1e-9)) + 1e-9
        self.weight *= (rmse / np.sqrt(np.mean(rmse**2))) ** BALANCE_EXPONENT
        self.weight /= self.weight.mean()
        self.square[:], self.count[:] = 0.0, 0.0


def by_parameters(tables: SoftTables, run: Pass, weight: Array) -> dict[str, Array]:
    """Return the derivatives of sum(weight * value) by every parameter, in the shapes of `SoftTables`, weight (n,)."""
    by_table = tables.reverse_tables(run, weight)
    by_part = tables.reverse_parts(run, by_table)
    by_group = tables.reverse_groups(by_part, run)
    by_argument = tables.reverse_steps(by_group, run).sum(axis=1)
    by_height = 0.5 * (
        (run.steps @ by_group.T)[np.arange(len(ROWS.step)), ROWS.group] + by_group.sum(axis=1)[ROWS.group]
    )
    shared = -(by_part[PAIRED] * run.groups[4:8] * run.groups[8:12]).sum(axis=1)
    cells_ab = _scatter(_monomials_ab(run.place), by_table, run.cell, MONOMIALS_AB, CORNERS_AB)
    cells_c = _scatter(_monomials_c(run.place_c), weight, run.cell_c, MONOMIALS_C, CORNERS_C)
    return {
        "thresholds": -(_INTO_STEPS @ by_argument) / (2.0 * tables.temperature),
        "heights": _INTO_STEPS @ by_height,
        "overlap": np.array([shared[0], shared[1], shared[2] + shared[3]]),
        "table_a": cells_ab[: TABLE_A.size].reshape(TABLE_A.shape),
        "table_b": cells_ab[TABLE_A.size :].reshape(TABLE_B.shape),
        "table_c": cells_c.reshape(12, 12),
    }


def _monomials_ab(place: Array) -> Array:
    """Return the monomials 1, c, b, bc, a, ac, ab, abc, (8, 3, n)."""
    a, b, c = place[:3], place[3:6], place[6:]
    out = np.empty((8, *a.shape))
    out[0], out[1], out[2], out[4] = 1.0, c, b, a
    np.multiply(b, c, out=out[3])
    np.multiply(a, out[1:4], out=out[5:8])
    return out


def _monomials_c(place: Array) -> Array:
    """Return the monomials 1, y, x, xy, (4, n)."""
    x, y = place
    return np.array([np.ones_like(x), y, x, x * y])


def _scatter(monomials: Array, weight: Array, cell: Indices, into_coef: Array, corners: Indices) -> Array:
    """Return the derivative by the table entries from weights of poses at positions in their interpolation cells."""
    cells = corners.shape[1]
    cell_of_pose = cell.ravel()
    by_coef = np.array([np.bincount(cell_of_pose, (m * weight).ravel(), minlength=cells) for m in monomials])
    by_corner = into_coef.T @ by_coef
    out: Array = np.bincount(corners.ravel(), by_corner.ravel()).astype(float)
    return out


def _admissible(tables: SoftTables, changed: dict[str, Array]) -> SoftTables:
    """Return the tables with changed parameters, projected onto the admissible ones."""
    heights = np.maximum(changed["heights"], 0.0)
    most = [1.0 / max(float(heights[which].max()), 1e-9) for which in _ADJUSTMENTS]
    thresholds = np.where(_MIRRORED, np.maximum(changed["thresholds"], 0.0), changed["thresholds"])
    for name in ("table_a", "table_b", "table_c"):
        for _ in range(_SWEEPS):
            _reduce_descents(changed[name])
    values: dict[str, Any] = {
        **changed,
        "heights": heights,
        "thresholds": thresholds,
        "overlap": np.clip(changed["overlap"], 0.0, most),
    }
    return dataclasses.replace(tables, **values)


def _reduce_descents(table: Array) -> None:
    """Set both entries of every descent to their mean, in place, axis by axis: towards the nearest monotone table."""
    for axis in range(table.ndim):
        cells = np.moveaxis(table, axis, 0)
        half = 0.5 * np.maximum(cells[:-1] - cells[1:], 0.0)
        cells[:-1] -= half
        cells[1:] += half


def _monotone(tables: SoftTables) -> SoftTables:
    """Return the tables with the remaining small descents raised to the running maximum."""

    def rising(table: Array) -> Array:
        for axis in range(table.ndim):
            table = np.maximum.accumulate(table, axis=axis)
        return table

    return dataclasses.replace(
        tables, table_a=rising(tables.table_a), table_b=rising(tables.table_b), table_c=rising(tables.table_c)
    )
