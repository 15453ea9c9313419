"""Ergonomic cost of configurations: a dREBA surrogate of the mapped posture angles, and its lower bound."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, Literal

import numpy as np
from threadpoolctl import threadpool_limits

from dreba.errors import ModelError
from dreba.surrogates.base import Surrogate
from dreba.surrogates.task_factors import delta_payload
from lgp.errors import LgpError
from lgp.kinematics.posture import PostureMap
from lgp.kinematics.world import World
from lgp.scene.model import Human
from reba.arrays import Array, Flags, Indices
from reba.checks import accepts, has, instance, one_of
from reba.posture.columns import COLUMNS, INDEX

Payload = Literal["linear", "model"]
PAYLOADS: Final = ("linear", "model")
MINIMISATIONS = 24
"""Number of random postures, those of the lowest scores, from which the minimum of a surrogate is sought."""
PROBES = 64
"""Random postures in which an additive surrogate must have no mixed second derivative."""


class Ergonomics:
    """A surrogate on the configurations of a world: the sum of the scores of its persons.

    A carried load adds its mass / 5 kg (equation 4 of the paper), so that light loads have a cost: the load classes
    of REBA begin at 5 kg. Scores are at least 0: where a surrogate is below 0 its minimum is subtracted, so that no
    motion gets cheaper by taking longer.

    Attributes:
        people: the score of each person, in the order of the scene.
        posture: that of the first one.
        columns: columns of q that the cost depends on, (k,).
        lower_bound: least score of any posture inside the joint limits without a load. A surrogate that is convex in
            the angles has one minimum; others are minimised from many postures, and the bound is their lowest minimum.
        form: "linear" adds equation 4, "model" passes loads to the surrogate.
        stages: continuation stages: temperatures to minimise at one after another, (None,) for a surrogate without; the
            last one is the cost of a plan.
        parts: blocks of the Hessian as places in `columns`: one block of all joints of a person, or, for an additive
            surrogate, the joints that share an angle.

    Raises:
        LgpError: an unknown payload, or a surrogate with a column that is no posture angle.
        WorldError: the world has no human.
    """

    @accepts(
        LgpError,
        world=instance("the kinematics of a scene, lgp.World(scene)", World),
        model=has("a fitted surrogate, such as dreba.load returns", "joints_", "temperatures_"),
        payload=one_of(*PAYLOADS),
    )
    def __init__(self, world: World, model: Surrogate, payload: Payload = "linear") -> None:
        unknown = [name for name in model.joints_ if name not in INDEX]
        if unknown:
            raise LgpError(
                f"cost model: joint {unknown[0]!r} is no posture angle of the human; fit it on columns of reba.COLUMNS"
            )
        people = tuple(world.scene.humans.values()) or (None,)  # PostureMap says what a scene without a human lacks
        self.people = tuple(PersonScore(world, person, model, payload) for person in people)
        self.posture = self.people[0].posture
        self.world, self.model, self.form = world, model, payload
        self.stages: tuple[float | None, ...] = tuple(model.temperatures_) or (None,)
        self.columns = np.concatenate([one.columns for one in self.people])
        firsts = np.cumsum([0, *(len(one.columns) for one in self.people)])
        self.parts = [first + part for first, one in zip(firsts, self.people, strict=False) for part in one.parts]
        self.lower_bound = sum(one.lower_bound for one in self.people)

    def value(self, q: Array, loads: Array, stage: int = -1) -> Array:
        """Return the scores (n,) of configurations (n, nq), all persons added, without `payload`.

        Args:
            loads: what each person carries [kg], (n, persons); (n,) of one.
        """
        return np.sum([one.value(q, own, self.stages[stage]) for one, own in self._of_people(loads)], axis=0)

    def payload(self, loads: Array) -> Array:
        """Return the score (n,) that loads, as of `value`, add to it: mass / 5 kg."""
        added = [
            delta_payload(own, "linear") if self.form == "linear" else np.zeros(len(own))
            for _, own in self._of_people(loads)
        ]
        return np.sum(added, axis=0)

    def quadratic_model(self, q: Array, loads: Array, stage: int = -1) -> tuple[Array, Array, list[Array]]:
        """Return value (n,), gradient (n, k) by `columns`, and a convex Hessian block (n, m, m) of each part."""
        models = [one.quadratic_model(q, own, self.stages[stage]) for one, own in self._of_people(loads)]
        values, gradients, blocks = zip(*models, strict=True)
        return np.sum(values, axis=0), np.concatenate(gradients, axis=1), [one for part in blocks for one in part]

    def _of_people(self, loads: Array) -> Iterator[tuple[PersonScore, Array]]:
        """Yield each person's score and loads (n,)."""
        return zip(self.people, np.reshape(loads, (len(loads), len(self.people))).T, strict=True)


class PersonScore:
    """The score of one person of a world; `shift` is the constant added to the values of the surrogate."""

    def __init__(self, world: World, person: Human | None, model: Surrogate, payload: Payload) -> None:
        self.world, self.model, self.form = world, model, payload
        self.posture = PostureMap(world, person)
        self.columns = self.posture.columns
        self._sharpest = (tuple(model.temperatures_) or (None,))[-1]
        self._chosen = [INDEX[name] for name in model.joints_]
        self._evaluated: tuple[Array, Array, Array] | None = None
        q = self._sample()
        angles, jacobian = self._angles(q)
        self._additive, moved = self._is_additive(angles), np.any(jacobian != 0.0, axis=0)
        self.parts = _coupled_joints(moved) if self._additive else [np.arange(len(self.columns))]
        self._set_coupled(moved)
        least = self._minimum(angles)
        self.shift = max(-least, 0.0)
        self.lower_bound = least + self.shift

    def value(self, q: Array, loads: Array, temperature: float | None) -> Array:
        """Return the surrogate's score (n,) of configurations (n, nq) with loads (n,) [kg], without the payload."""
        angles, _ = self._angles(q)
        factors: dict[str, Any] = {"load": self._model_loads(loads), "temperature": temperature}
        return self.shift + np.asarray(self.model.value(angles, **factors))

    def _model_loads(self, loads: Array) -> Array:
        """Return the loads [kg] that the surrogate itself takes into account."""
        return loads if self.form == "model" else np.zeros(len(loads))

    def quadratic_model(self, q: Array, loads: Array, temperature: float | None) -> tuple[Array, Array, list[Array]]:
        """Return value (n,), gradient (n, k) by `columns`, and a convex Hessian block (n, m, m) of each part."""
        angles, jacobian = self._angles(q)
        factors: dict[str, Any] = {"load": self._model_loads(loads), "temperature": temperature}
        value, by_angles = self.model.value_and_gradient(angles, **factors)
        gradient = np.matmul(by_angles[:, None, :], jacobian)[:, 0]
        if self._additive:
            blocks = self._additive_hessian(
                q, by_angles, jacobian, np.einsum("nii->ni", self.model.hessian(angles, **factors))
            )
        else:
            blocks = [self._hessian(angles, jacobian, factors)]
        return self.shift + np.asarray(value), gradient, blocks

    def _additive_hessian(self, q: Array, slope: Array, jacobian: Array, curvature: Array) -> list[Array]:
        """Return the convex part of each block, second derivatives of the angles included; slope, curvature (n, d)."""
        weights = np.zeros((len(q), len(COLUMNS)))
        weights[:, self._chosen] = slope
        turned = self.posture.curvature(q, weights)
        alone = np.einsum("nd,ndk->nk", curvature, jacobian**2)
        blocks = []
        for part, (rows, coupled) in zip(self.parts, self._coupled, strict=True):
            if len(part) == 1:
                blocks.append(np.maximum(alone[:, part, None], 0.0))
                continue
            own = jacobian[:, rows[:, None], part]
            hessian = np.swapaxes(own, 1, 2) @ (curvature[:, rows, None] * own)
            for number, at in coupled:
                hessian[:, at[:, None], at] += turned[number][1]
            blocks.append(_convex_part(hessian))
        return blocks

    def _set_coupled(self, moved: Flags) -> None:
        """Set the angles that each part moves (d, k), and the places in it of the joints of each group of angles."""
        groups = [
            local for local, _ in self.posture.curvature(np.zeros((0, self.world.nq)), np.zeros((0, len(COLUMNS))))
        ]
        self._coupled = [
            (
                np.flatnonzero(moved[:, part].any(axis=1)),
                [(at, np.searchsorted(part, own)) for at, own in enumerate(groups) if np.isin(own, part).all()],
            )
            for part in self.parts
        ]

    def _angles(self, q: Array) -> tuple[Array, Array]:
        """Return the angles (n, d) [deg] and their Jacobian (n, d, k); the last configurations' are stored."""
        if self._evaluated is None or not np.array_equal(self._evaluated[0], q):
            self._evaluated = q.copy(), *self._evaluate(q)
        return self._evaluated[1:]

    def _evaluate(self, q: Array) -> tuple[Array, Array]:
        angles, jacobian = self.posture.evaluate(q, smooth=True)
        if self._chosen != list(range(len(COLUMNS))):
            angles, jacobian = angles[:, self._chosen], jacobian[:, self._chosen]
        return angles, jacobian

    def _hessian(self, angles: Array, jacobian: Array, factors: dict[str, Any]) -> Array:
        """Return the Hessian (n, k, k): Gauss-Newton, or the convex part of the surrogate's where it has no factor."""
        try:
            factor = self.model.gauss_newton(angles, **factors)
        except ModelError:
            hessian = _convex_part(self.model.hessian(angles, **factors))
            return np.asarray(np.swapaxes(jacobian, 1, 2) @ hessian @ jacobian)
        by_joints = factor @ jacobian
        return np.asarray(np.swapaxes(by_joints, 1, 2) @ by_joints)

    def _sample(self) -> Array:
        """Return the initial configuration and random postures within the limits, (n, nq)."""
        rng = np.random.default_rng(0)
        q = np.tile(self.world.initial_configuration, (4000, 1))
        lower, upper = self.world.lower[self.columns], self.world.upper[self.columns]
        q[1:, self.columns] = rng.uniform(lower, upper, (len(q) - 1, len(lower)))
        return q

    def _is_additive(self, angles: Array) -> bool:
        """Whether the surrogate is a sum of functions of one angle each."""
        hessian = np.array(self.model.hessian(angles[:PROBES], temperature=self._sharpest))
        np.einsum("nii->ni", hessian)[:] = 0.0
        return not hessian.any()

    def _minimum(self, angles: Array) -> float:
        """Return the minimum over the box of angles (n, d) [deg] that random postures within the limits span."""
        from scipy.optimize import minimize

        # The box contains all postures, so its minimum is not above theirs.
        box = list(zip(angles.min(axis=0) - 1.0, angles.max(axis=0) + 1.0, strict=True))
        values = np.asarray(self.model.value(angles, temperature=self._sharpest))
        starts = angles[np.argsort(values)[:MINIMISATIONS]]

        def objective(x: Array) -> tuple[float, Array]:
            value, slope = self.model.value_and_gradient(x, temperature=self._sharpest)
            return float(value), np.asarray(slope)

        with threadpool_limits(1):  # of matrices as small as these, threads only wait for each other
            minima = [minimize(objective, start, jac=True, bounds=box, method="L-BFGS-B").fun for start in starts]
        return float(min(minima))


def _convex_part(matrices: Array) -> Array:
    """Return symmetric matrices (n, d, d) without their negative eigenvalues."""
    values, vectors = np.linalg.eigh(matrices)
    return (vectors * np.maximum(values, 0.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)


def _coupled_joints(moved: Flags) -> list[Indices]:
    """Return the connected components of joints by shared angles (d, k); joints that move none are left out."""
    groups: list[set[int]] = []
    for row in moved:
        own = set(np.flatnonzero(row).tolist())
        touched = [group for group in groups if group & own]
        groups = [group for group in groups if not group & own]
        if own:
            groups.append(own.union(*touched))
    return [np.array(sorted(group), dtype=np.intp) for group in sorted(groups, key=min)]
