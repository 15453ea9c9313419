"""Lower REBA with a gradient: the posture nearest to a given one that scores a little less."""

import numpy as np
from scipy.optimize import minimize

import dreba
import reba

model = dreba.load("soft")
pose = dreba.sample(1, classes=[9], rng=5).angles[0]


def cost(angles: np.ndarray) -> tuple[float, np.ndarray]:
    """Surrogate REBA plus a small price on leaving the posture, with the gradient [per degree]."""
    value, gradient = model.value_and_gradient(angles)
    away = angles - pose
    return value + 1e-4 * away @ away, gradient + 2e-4 * away


better = minimize(cost, pose, jac=True, method="L-BFGS-B", bounds=[(a - 30.0, a + 30.0) for a in pose]).x
before, after = (int(reba.score_array(angles[None])["reba"][0]) for angles in (pose, better))
print(f"true REBA {before} -> {after}, each angle changed by {np.abs(better - pose).max():.0f} degrees at most")
