"""The ergonomic cost of configurations: a dREBA surrogate through the posture mapping, and the least it can be."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lgp.errors import LgpError
from lgp.world.model import World
from lgp.world.posture import PostureMap
from reba.posture import COLUMNS, INDEX

if TYPE_CHECKING:
    from dreba.model import Surrogate

Array = NDArray[np.float64]

STARTS = 24
"""Random postures from which the least value of a surrogate is searched, besides the first one."""


class Ergonomics:
    """A surrogate on the configurations of a world.

    Scores count from 0: where a surrogate dips below 0 its least value is subtracted, so that time spent never pays.

    Attributes:
        columns: columns of q that the cost depends on, (k,).
        floor: least score of any posture inside the joint limits without a load. A surrogate that is convex in the
            angles has one minimum; others are minimised from many postures: their floor is as sure as that search.
        shift: what is added to the surrogate's values.
        stages: temperatures to minimise at one after another, (None,) for a surrogate without; the last one counts.

    Raises:
        LgpError: the surrogate has a column that is no posture angle.
        WorldError: the world has no human.
    """

    def __init__(self, world: World, model: Surrogate) -> None:
        unknown = [name for name in model.joints_ if name not in INDEX]
        if unknown:
            raise LgpError(
                f"cost model: joint {unknown[0]!r} is no posture angle of the human; fit it on columns of reba.COLUMNS"
            )
        self.world, self.model = world, model
        self.posture = PostureMap(world)
        self.columns = self.posture.columns
        self.stages: tuple[float | None, ...] = tuple(model.temperatures_) or (None,)
        self._chosen = [INDEX[name] for name in model.joints_]
        self._last: tuple[Array, Array, Array] | None = None
        least = self._minimum()
        self.shift = max(-least, 0.0)
        self.floor = least + self.shift

    def value(self, q: Array, loads: Array, stage: int = -1) -> Array:
        """Return the surrogate's score (n,) of configurations (n, nq) with loads (n,) [kg]."""
        angles, _ = self._angles(q)
        return self.shift + np.asarray(self.model.value(angles, load=loads, temperature=self.stages[stage]))

    def model_at(self, q: Array, loads: Array, stage: int = -1) -> tuple[Array, Array, Array]:
        """Return value (n,), gradient (n, k) and a positive semidefinite Hessian (n, k, k) by `columns`."""
        angles, jacobian = self._angles(q)
        given: dict[str, Any] = {"load": loads, "temperature": self.stages[stage]}
        value, slope = self.model.value_and_gradient(angles, **given)
        gradient = np.matmul(slope[:, None, :], jacobian)[:, 0]
        return self.shift + np.asarray(value), gradient, self._curvature(angles, jacobian, given)

    def _angles(self, q: Array) -> tuple[Array, Array]:
        """Return the angles (n, d) and their Jacobian (n, d, k); those of the last configurations are kept."""
        if self._last is None or not np.array_equal(self._last[0], q):
            angles, jacobian = self.posture.evaluate(q, smooth=True)
            if self._chosen != list(range(len(COLUMNS))):
                angles, jacobian = angles[:, self._chosen], jacobian[:, self._chosen]
            self._last = q.copy(), angles, jacobian
        return self._last[1:]

    def _curvature(self, angles: Array, jacobian: Array, given: dict[str, Any]) -> Array:
        from dreba.errors import ModelError

        try:
            factor = self.model.gauss_newton(angles, **given)
        except ModelError:
            bend = _clipped(self.model.hessian(angles, **given))
            return np.asarray(np.swapaxes(jacobian, 1, 2) @ bend @ jacobian)
        factored = factor @ jacobian
        return np.asarray(np.swapaxes(factored, 1, 2) @ factored)

    def _minimum(self) -> float:
        """Minimise over the box of angles that random postures inside the limits span."""
        from scipy.optimize import minimize

        rng = np.random.default_rng(0)
        q = np.tile(self.world.start, (4000, 1))
        lower, upper = self.world.lower[self.columns], self.world.upper[self.columns]
        q[1:, self.columns] = rng.uniform(lower, upper, (len(q) - 1, len(lower)))
        angles = self.posture.evaluate(q, smooth=True)[0][:, self._chosen]
        # The box holds combinations that no posture reaches, so its minimum is not above theirs.
        box = list(zip(angles.min(axis=0) - 1.0, angles.max(axis=0) + 1.0, strict=True))
        values = np.asarray(self.model.value(angles, temperature=self.stages[-1]))
        starts = angles[np.argsort(values)[:STARTS]]

        def objective(x: Array) -> tuple[float, Array]:
            value, slope = self.model.value_and_gradient(x, temperature=self.stages[-1])
            return float(value), np.asarray(slope)

        found = [minimize(objective, start, jac=True, bounds=box, method="L-BFGS-B").fun for start in starts]
        return float(min(found))


def _clipped(matrices: Array) -> Array:
    """Return symmetric matrices (n, d, d) without their negative eigenvalues."""
    values, vectors = np.linalg.eigh(matrices)
    return (vectors * np.maximum(values, 0.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
