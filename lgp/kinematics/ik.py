"""Inverse kinematics for many targets at once: damped least squares inside joint limits.

Meant for questions about a scene (what can be reached from where) and for starting points; plans are made by `lgp.sqp`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reba.arrays import Array, Indices

Residuals = Callable[[Array, Indices], tuple[Array, Array]]
"""(n, k) joints and the numbers (n,) of their problems -> residuals (n, m) and their Jacobian (n, m, k)."""


def least_squares(
    residuals: Residuals, start: Array, lower: Array, upper: Array, tolerance: float = 1e-4, steps: int = 60
) -> tuple[Array, Array]:
    """Return joints (n, k) and the largest remaining residual (n,) of n independent problems.

    Levenberg-Marquardt with the joints kept inside their limits by projection: a joint at its limit that would leave it
    takes no part in the step. A problem is left alone once its residual is below the tolerance.

    Args:
        residuals: values and Jacobians.
        start: (n, k).
        lower, upper: (k,).
        tolerance: of the largest residual.
        steps: at most.
    """
    x = np.clip(start, lower, upper)
    everyone = np.arange(len(x))
    value, jacobian = residuals(x, everyone)
    damping = np.full(len(x), 1e-2)
    for _ in range(steps):
        open_ = everyone[np.abs(value).max(axis=1) > tolerance]
        if not len(open_):
            break
        step = _step(x[open_], value[open_], jacobian[open_], damping[open_], lower, upper)
        trial = np.clip(x[open_] + step, lower, upper)
        trial_value, trial_jacobian = residuals(trial, open_)
        better = np.sum(trial_value**2, axis=1) < np.sum(value[open_] ** 2, axis=1)
        accepted = open_[better]
        x[accepted], value[accepted], jacobian[accepted] = trial[better], trial_value[better], trial_jacobian[better]
        damping[open_] = np.where(better, np.maximum(damping[open_] / 4.0, 1e-6), np.minimum(damping[open_] * 5.0, 1e4))
    return x, np.abs(value).max(axis=1)


def _step(x: Array, value: Array, jacobian: Array, damping: Array, lower: Array, upper: Array) -> Array:
    gradient = np.einsum("nmk,nm->nk", jacobian, value)
    stuck = ((x <= lower) & (gradient > 0.0)) | ((x >= upper) & (gradient < 0.0))
    free = np.where(stuck[:, None, :], 0.0, jacobian)
    # m residuals are fewer than k joints: solve in the space of residuals.
    normal = free @ np.swapaxes(free, 1, 2)
    normal[:, range(normal.shape[1]), range(normal.shape[1])] += damping[:, None]
    return -np.einsum("nmk,nm->nk", free, np.linalg.solve(normal, value[:, :, None])[:, :, 0])
