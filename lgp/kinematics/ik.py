"""Batched inverse kinematics: damped least squares (Levenberg-Marquardt) with projection on the joint limits.

Used for reachability maps and initial guesses; plans are optimised by `lgp.sqp`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reba.arrays import Array, Indices

Residuals = Callable[[Array, Indices], tuple[Array, Array]]
"""(joints (n, k), numbers of their problems (n,)) -> residuals (n, m) and Jacobians (n, m, k)."""


def least_squares(
    residuals: Residuals, initial: Array, lower: Array, upper: Array, tolerance: float = 1e-4, iterations: int = 60
) -> tuple[Array, Array]:
    """Return joints (n, k) and the largest absolute residual (n,) of n independent problems.

    The initial joints are (n, k), their limits (k,). A joint at a limit that the gradient step would violate takes no
    part in the step. A problem ends once its largest residual is below the tolerance, or after `iterations` steps.
    """
    x = np.clip(initial, lower, upper)
    problems = np.arange(len(x))
    value, jacobian = residuals(x, problems)
    damping = np.full(len(x), 1e-2)
    for _ in range(iterations):
        active = problems[_largest(value) > tolerance]
        if not len(active):
            break
        step = _step(x[active], value[active], jacobian[active], damping[active], lower, upper)
        trial = np.clip(x[active] + step, lower, upper)
        trial_value, trial_jacobian = residuals(trial, active)
        better = np.sum(trial_value**2, axis=1) < np.sum(value[active] ** 2, axis=1)
        accepted = active[better]
        x[accepted], value[accepted], jacobian[accepted] = trial[better], trial_value[better], trial_jacobian[better]
        damping[active] = np.where(
            better, np.maximum(damping[active] / 4.0, 1e-6), np.minimum(damping[active] * 5.0, 1e4)
        )
    return x, _largest(value)


def _largest(value: Array) -> Array:
    """Return the largest absolute residual (n,) of residuals (n, m), 0 where there are none."""
    return np.asarray(np.abs(value).max(axis=1, initial=0.0))


def _step(x: Array, value: Array, jacobian: Array, damping: Array, lower: Array, upper: Array) -> Array:
    gradient = np.einsum("nmk,nm->nk", jacobian, value)
    at_limit = ((x <= lower) & (gradient > 0.0)) | ((x >= upper) & (gradient < 0.0))
    free = np.where(at_limit[:, None, :], 0.0, jacobian)
    # J'(JJ' + damping)^-1 r: the system has m rows, fewer than the k joints.
    normal = free @ np.swapaxes(free, 1, 2)
    normal[:, range(normal.shape[1]), range(normal.shape[1])] += damping[:, None]
    return -np.einsum("nmk,nm->nk", free, np.linalg.solve(normal, value[:, :, None])[:, :, 0])
