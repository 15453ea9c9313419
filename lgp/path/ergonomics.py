"""The ergonomic cost of configurations: a dREBA surrogate through the posture mapping, and the least it can be."""

from __future__ import annotations

from typing import Any, Final, Literal

import numpy as np

from dreba.errors import ModelError
from dreba.surrogates.base import Surrogate
from dreba.surrogates.task_factors import delta_payload
from lgp.errors import LgpError
from lgp.kinematics.posture import PostureMap
from lgp.kinematics.world import World
from reba.arrays import Array, Flags, Indices
from reba.posture.columns import COLUMNS, INDEX

Payload = Literal["linear", "model"]
PAYLOADS: Final = ("linear", "model")
STARTS = 24
"""Random postures from which the least value of a surrogate is searched, besides the first one."""
PROBES = 64
"""Random postures in which a surrogate whose angles add up must have no mixed second derivative."""
STEP = 1e-6
"""[rad] Of the differences that give the second derivatives of the angles."""


class Ergonomics:
    """A surrogate on the configurations of a world.

    A carried load adds its mass / 5 kg (equation 4 of the paper), which makes light loads cost something: the classes
    of the score itself begin at 5 kg. Scores count from 0: where a surrogate dips below 0 its least value is
    subtracted, so that time spent never pays.

    Attributes:
        columns: columns of q that the cost depends on, (k,).
        floor: least score of any posture inside the joint limits without a load. A surrogate that is convex in the
            angles has one minimum; others are minimised from many postures: their floor is as sure as that search.
        shift: what is added to the surrogate's values.
        form: "linear" adds equation 4, "model" leaves loads to the surrogate.
        stages: temperatures to minimise at one after another, (None,) for a surrogate without; the last one counts.
        parts: groups of `columns` whose second derivatives mix, as places in `columns`: one group of all of them, or,
            where the surrogate is a sum over angles, the joints that an angle shares.

    Raises:
        LgpError: the surrogate has a column that is no posture angle.
        WorldError: the world has no human.
    """

    def __init__(self, world: World, model: Surrogate, payload: Payload = "linear") -> None:
        if payload not in PAYLOADS:
            raise LgpError(f"payload is {payload!r}, expected one of {', '.join(PAYLOADS)}")
        unknown = [name for name in model.joints_ if name not in INDEX]
        if unknown:
            raise LgpError(
                f"cost model: joint {unknown[0]!r} is no posture angle of the human; fit it on columns of reba.COLUMNS"
            )
        self.world, self.model, self.form = world, model, payload
        self.posture = PostureMap(world)
        self.columns = self.posture.columns
        self.stages: tuple[float | None, ...] = tuple(model.temperatures_) or (None,)
        self._chosen = [INDEX[name] for name in model.joints_]
        self._last: tuple[Array, Array, Array] | None = None
        q = self._sample()
        angles, jacobian = self._angles(q)
        self._adds_up = self._is_sum(angles)
        self.parts = _groups(np.any(jacobian != 0.0, axis=0)) if self._adds_up else [np.arange(len(self.columns))]
        least = self._minimum(angles)
        self.shift = max(-least, 0.0)
        self.floor = least + self.shift

    def value(self, q: Array, loads: Array, stage: int = -1) -> Array:
        """Return the surrogate's score (n,) of configurations (n, nq) with loads (n,) [kg], without `payload`."""
        angles, _ = self._angles(q)
        given: dict[str, Any] = {"load": self._own(loads), "temperature": self.stages[stage]}
        return self.shift + np.asarray(self.model.value(angles, **given))

    def payload(self, loads: Array) -> Array:
        """Return what loads (n,) [kg] add to the scores of `value`, (n,)."""

        return np.asarray(delta_payload(loads, "linear")) if self.form == "linear" else np.zeros(len(loads))

    def _own(self, loads: Array) -> Array:
        """Return the loads that the model itself is told of."""
        return loads if self.form == "model" else np.zeros(len(loads))

    def model_at(self, q: Array, loads: Array, stage: int = -1) -> tuple[Array, Array, list[Array]]:
        """Return value (n,), gradient (n, k) by `columns`, and a convex Hessian (n, m, m) of each part."""
        angles, jacobian = self._angles(q)
        given: dict[str, Any] = {"load": self._own(loads), "temperature": self.stages[stage]}
        value, slope = self.model.value_and_gradient(angles, **given)
        gradient = np.matmul(slope[:, None, :], jacobian)[:, 0]
        if self._adds_up:
            bends = self._bends(q, slope, jacobian, np.einsum("nii->ni", self.model.hessian(angles, **given)))
        else:
            bends = [self._curvature(angles, jacobian, given)]
        return self.shift + np.asarray(value), gradient, bends

    def _bends(self, q: Array, slope: Array, jacobian: Array, bend: Array) -> list[Array]:
        """Return the convex part of each part's Hessian, that of the angles included: slope and bend are (n, d)."""
        longest = max(len(part) for part in self.parts)
        moved = np.repeat(q[None], longest, axis=0)
        for part in self.parts:
            if len(part) > 1:
                moved[np.arange(len(part)), :, self.columns[part]] += STEP
        slopes = self._evaluate(moved.reshape(-1, q.shape[1]))[1].reshape(longest, *jacobian.shape)
        # Joints of different parts share no angle, so one step moves one joint of each.
        turned = np.einsum("nd,sndk->nsk", slope, slopes - jacobian) / STEP
        found = []
        for part in self.parts:
            own = jacobian[:, :, part]
            hessian = np.swapaxes(own, 1, 2) @ (bend[:, :, None] * own)
            if len(part) > 1:
                twice = turned[:, : len(part), part]
                hessian = _clipped(hessian + 0.5 * (twice + np.swapaxes(twice, 1, 2)))
            found.append(hessian)
        return found

    def _angles(self, q: Array) -> tuple[Array, Array]:
        """Return the angles (n, d) and their Jacobian (n, d, k); those of the last configurations are kept."""
        if self._last is None or not np.array_equal(self._last[0], q):
            self._last = q.copy(), *self._evaluate(q)
        return self._last[1:]

    def _evaluate(self, q: Array) -> tuple[Array, Array]:
        angles, jacobian = self.posture.evaluate(q, smooth=True)
        if self._chosen != list(range(len(COLUMNS))):
            angles, jacobian = angles[:, self._chosen], jacobian[:, self._chosen]
        return angles, jacobian

    def _curvature(self, angles: Array, jacobian: Array, given: dict[str, Any]) -> Array:

        try:
            factor = self.model.gauss_newton(angles, **given)
        except ModelError:
            bend = _clipped(self.model.hessian(angles, **given))
            return np.asarray(np.swapaxes(jacobian, 1, 2) @ bend @ jacobian)
        factored = factor @ jacobian
        return np.asarray(np.swapaxes(factored, 1, 2) @ factored)

    def _sample(self) -> Array:
        """Return the first configuration and random postures inside the limits, (n, nq)."""
        rng = np.random.default_rng(0)
        q = np.tile(self.world.initial_configuration, (4000, 1))
        lower, upper = self.world.lower[self.columns], self.world.upper[self.columns]
        q[1:, self.columns] = rng.uniform(lower, upper, (len(q) - 1, len(lower)))
        return q

    def _is_sum(self, angles: Array) -> bool:
        """Whether the surrogate is a sum of functions of one angle each."""
        bend = np.array(self.model.hessian(angles[:PROBES], temperature=self.stages[-1]))
        np.einsum("nii->ni", bend)[:] = 0.0
        return not bend.any()

    def _minimum(self, angles: Array) -> float:
        """Minimise over the box of angles (n, d) that random postures inside the limits span."""
        from scipy.optimize import minimize

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


def _groups(moved: Flags) -> list[Indices]:
    """Return the joints that angles (d, k) share, directly or through others; joints that move none are left out."""
    found: list[set[int]] = []
    for row in moved:
        own = set(np.flatnonzero(row).tolist())
        touched = [group for group in found if group & own]
        found = [group for group in found if not group & own]
        if own:
            found.append(own.union(*touched))
    return [np.array(sorted(group), dtype=np.intp) for group in sorted(found, key=min)]
