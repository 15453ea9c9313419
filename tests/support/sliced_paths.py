"""A path problem of the shape of the planner's: T slices of 42 joints, of matrices and two chains of revolute joints.

Cost: squared accelerations from rest, a small quadratic about the initial point, a dense quadratic on 23 joints of
every slice. Equalities (76): at four keyframes a hand reaches a place (the first two with its axis upright, the second
on a table whose place is free in +-0.15 m), the hand is at rest across three switches, the last velocity is zero. Joint
limits on all joints; optionally a minimum distance of spheres on both arms in every slice. Vectorised over slices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from lgp.sqp.problem import Model

DOFS, POSTURE, PLACE = 42, 23, 2
LEFT, RIGHT = np.arange(23, 30), np.arange(4, 14)
"""Joints of the robot's arm and of the human's."""
ON_LEFT, ON_RIGHT = [4, 6], [3, 5, 7, 9]
"""Hinges that carry the spheres."""
STILL = np.array([0, 1, 2, 6, 7, 8])
"""Entries of a hand's values that are at rest across a switch: hand and elbow."""
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Chain:
    """Hinges in a row: axis and offset of each in the frame of the last, (k, 3) each, and where the first one sits."""

    joints: NDArray[np.int64]
    axes: Array
    offsets: Array
    base: Array

    def forward(self, angles: Array) -> tuple[Array, Array, Array]:
        """Return hand positions (s, 3), hinge axes (s, k, 3) and hinge positions (s, k, 3) for angles (s, k)."""
        slices, k = angles.shape
        turn = np.broadcast_to(np.eye(3), (slices, 3, 3))
        place = np.broadcast_to(self.base, (slices, 3))
        axes, places = np.empty((slices, k, 3)), np.empty((slices, k, 3))
        for i in range(k):
            axes[:, i], places[:, i] = turn @ self.axes[i], place
            turn = turn @ _rotation(self.axes[i], angles[:, i])
            place = place + turn @ self.offsets[i]
        return place, axes, places


def _rotation(axis: Array, angle: Array) -> Array:
    cross = np.cross(np.eye(3), axis)
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * cross + (1 - c) * (cross @ cross)


def hand(chain: Chain, q: Array) -> tuple[Array, Array, Array, Array]:
    """Return hand position, pointing direction and elbow position (s, 9), first derivatives (s, 9, k), hinge axes
    (s, k, 3) and first derivatives by hinge (s, k, 9); the last two make the second derivatives.

    The direction is the last link's; hand and elbow at rest keep the whole arm at rest.
    """
    place, axes, places = chain.forward(q[:, chain.joints])
    tip = place - places[:, -1]
    tip = tip / np.linalg.norm(chain.offsets[-1])
    elbow = chain.joints.size // 2
    columns = [np.cross(axes, place[:, None] - places), np.cross(axes, tip[:, None])]
    columns.append(np.cross(axes, places[:, elbow, None] - places))
    columns[2][:, elbow:] = 0.0
    jac = np.concatenate(columns, axis=2)
    return np.concatenate([place, tip, places[:, elbow]], axis=1), jac.transpose(0, 2, 1), axes, jac


def curvature(axes: Array, jac: Array, weights: Array) -> Array:
    """Return sum_r weights_r d2 value_r (s, k, k): the second derivative of hinges i <= j is axis_i x column_j."""
    parts = [slice(0, 3), slice(3, 6), slice(6, 9)]
    weighted = sum(np.cross(weights[:, None, p], axes) @ jac[..., p].transpose(0, 2, 1) for p in parts)
    upper = np.triu(weighted)
    return upper + np.triu(upper, 1).transpose(0, 2, 1)


class PathProblem:
    """The synthetic path problem; `start()` is the rest posture, `spline()` a smooth way through it."""

    def __init__(
        self, slices: int, *, seed: int = 0, shift: float = 0.0, spheres: bool = False, margin: float = 0.0
    ) -> None:
        rng = np.random.default_rng(seed)
        self.slices = slices
        self.n, self.cost_unit = DOFS * slices + PLACE, 1.0
        self.left, self.right = _chain(rng, LEFT, [0.9, 0.25, 0.9]), _chain(rng, RIGHT, [0.0, -0.2, 1.3])
        self.rest = rng.uniform(-0.3, 0.3, DOFS)
        width = rng.uniform(0.9, 1.6, DOFS)
        self.lower = np.concatenate([np.tile(self.rest - width, slices), [-0.15, -0.15]])
        self.upper = np.concatenate([np.tile(self.rest + width, slices), [0.15, 0.15]])
        self.keyframes = np.array([slices // 4 - 1, slices // 2 - 1, 3 * slices // 4 - 1, slices - 1])
        self._goals(rng, shift)
        self._cost(rng)
        self._rows()
        self._spheres = _Spheres(self, margin) if spheres else None

    def start(self) -> Array:
        """Return the rest posture in every slice (n,)."""
        return np.concatenate([np.tile(self.rest, self.slices), np.zeros(PLACE)])

    def _goals(self, rng: np.random.Generator, shift: float) -> None:
        """Set places that poses within the limits reach, so the problem is feasible."""
        reach = self.rest + rng.uniform(-0.6, 0.6, (4, DOFS))
        self.goals = np.concatenate([hand(self.left, reach[:2])[0], hand(self.right, reach[2:])[0]])
        self.goals[:, :3] += shift
        normal = self.goals[:, 3:6]
        first = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        self.sides = np.stack([first, np.cross(normal, first)], axis=1)

    def _cost(self, rng: np.random.Generator) -> None:
        tau = 20.0 / self.slices
        differences = sp.diags_array([1.0, -2.0, 1.0], offsets=[0, -1, -2], shape=(self.slices, self.slices))
        self._acceleration = sp.kron(differences / tau**1.5, sp.eye_array(DOFS), format="csr")
        # Before the first slice the body rests: x_-1 = x_-2 = rest.
        self._before = np.zeros((self.slices, DOFS))
        self._before[0], self._before[1] = -self.rest / tau**1.5, self.rest / tau**1.5
        root = rng.normal(size=(POSTURE, POSTURE)) / POSTURE
        self._posture = 2.0 * tau * (root @ root.T + 0.01 * np.eye(POSTURE))
        self._posture_rest = self.rest[:POSTURE] - 0.2
        self._pull = 2 * 0.01 * tau
        posture = sp.kron(sp.eye_array(self.slices), sp.block_diag([self._posture, sp.csr_array((19, 19))]))
        constant = 2 * self._acceleration.T @ self._acceleration + posture
        constant = sp.block_diag([constant + self._pull * sp.eye_array(DOFS * self.slices), 1e-4 * sp.eye_array(PLACE)])
        self._curved_slices = np.unique(np.concatenate([self.keyframes, self.keyframes[:3] + 1]))
        # Room for the curvature of both arms in the slices that have rows.
        room = [np.meshgrid(DOFS * s + arm, DOFS * s + arm) for s in self._curved_slices for arm in (LEFT, RIGHT)]
        i = np.concatenate([grid[0].ravel() for grid in room])
        j = np.concatenate([grid[1].ravel() for grid in room])
        blocks = sp.csc_array((np.ones(i.size), (i, j)), shape=(self.n, self.n))
        pattern = sp.csc_matrix(sp.triu(abs(constant) + blocks, format="csc"))
        pattern.sort_indices()
        base = sp.csc_matrix(pattern * 0.0)
        base.indices, base.indptr, base.data = pattern.indices, pattern.indptr, np.zeros(pattern.nnz)
        columns = np.repeat(np.arange(self.n), np.diff(pattern.indptr))
        key = columns.astype(np.int64) * self.n + pattern.indices
        upper = sp.coo_array(sp.triu(constant))
        np.add.at(base.data, np.searchsorted(key, upper.col.astype(np.int64) * self.n + upper.row), upper.data)
        self._constant, self._hessian = base.data.copy(), base
        self._arm_at = {}
        for arm in (LEFT, RIGHT):
            r, c = np.triu_indices(arm.size)
            flat = (
                (DOFS * self._curved_slices[:, None] + arm[c]) * self.n + DOFS * self._curved_slices[:, None] + arm[r]
            )
            self._arm_at[arm[0]] = (np.searchsorted(key, flat), r, c)

    def _rows(self) -> None:
        """Lay out the rows: 5 + 5 + 3 + 3 key rows, 3 x 6 switch rows, 42 of the last velocity."""
        cols: list[Array] = []
        base = DOFS * self.keyframes
        for k, (arm, count) in enumerate([(LEFT, 5), (LEFT, 5), (RIGHT, 3), (RIGHT, 3)]):
            extra = [self.n - 2, self.n - 1] if k == 1 else []
            cols += [np.concatenate([base[k] + arm, extra])] * count
        for k, arm in enumerate([LEFT, LEFT, RIGHT]):
            cols += [np.concatenate([base[k] + arm, base[k] + DOFS + arm])] * 6
        last = DOFS * (self.slices - 2) + np.arange(DOFS)
        cols += [np.array([i, i + DOFS]) for i in last]
        indptr = np.concatenate([[0], np.cumsum([c.size for c in cols])])
        self._jac = sp.csr_matrix((np.zeros(indptr[-1]), np.concatenate(cols).astype(int), indptr), shape=(76, self.n))
        self._jac.data[-2 * DOFS :] = np.tile([-1.0, 1.0], DOFS)

    def _hands(self, x: Array) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        path = x[: DOFS * self.slices].reshape(self.slices, DOFS)
        return hand(self.left, path[self._curved_slices[:5]]), hand(self.right, path[self._curved_slices[3:]])

    def _equality(self, x: Array, left: Array, right: Array) -> Array:
        """Return the 76 equalities; hands at curved slices: left at k0 k0+1 k1 k1+1 k2, right at k1+1 k2 k2+1 k3."""
        path = x[: DOFS * self.slices].reshape(self.slices, DOFS)
        off = left[[0, 2], :3] - self.goals[:2, :3]
        off[1] -= x[-2:] @ self.sides[1]
        upright = np.einsum("kij,kj->ki", self.sides[:2], left[[0, 2], 3:6])
        still = [(left[1] - left[0])[STILL], (left[3] - left[2])[STILL], (right[2] - right[1])[STILL]]
        places = right[[1, 3], :3] - self.goals[2:, :3]
        keyed = np.concatenate([off[0], upright[0], off[1], upright[1], places.ravel()])
        return np.concatenate([keyed, *still, path[-1] - path[-2]])

    def _cost_of(self, x: Array) -> tuple[float, Array]:
        """Return cost and gradient (n,)."""
        flat = x[: DOFS * self.slices]
        path = flat.reshape(self.slices, DOFS)
        bend = self._acceleration @ flat + self._before.ravel()
        lean, away = path[:, :POSTURE] - self._posture_rest, path - self.rest
        heavy = lean @ self._posture
        slope = np.concatenate([2 * (self._acceleration.T @ bend) + self._pull * away.ravel(), 1e-4 * x[-2:]])
        slope[: DOFS * self.slices].reshape(self.slices, DOFS)[:, :POSTURE] += heavy
        value = bend @ bend + 0.5 * np.vdot(lean, heavy) + 0.5 * self._pull * np.vdot(away, away)
        return float(value + 0.5e-4 * x[-2:] @ x[-2:]), slope

    def evaluate(self, x: Array) -> tuple[float, Array, Array]:
        """Return cost, equalities (76,) and inequalities."""
        left, right = self._hands(x)
        limits = np.zeros(0) if self._spheres is None else self._spheres.values(x)
        return self._cost_of(x)[0], self._equality(x, left[0], right[0]), limits

    def linearise(self, x: Array, y_eq: Array, y_in: Array) -> Model:
        """Return the model with the clipped curvature of the reach and switch rows."""
        left, right = self._hands(x)
        self._fill_jacobian(left[1], right[1])
        self._hessian.data[:] = self._constant
        if y_eq.any():
            self._fill_curvature(left, right, y_eq)
        values, in_jac = (np.zeros(0), sp.csr_matrix((0, self.n)))
        if self._spheres is not None:
            values, in_jac = self._spheres.values(x), self._spheres.jacobian(x)
        gradient = self._cost_of(x)[1]
        return Model(self._hessian, gradient, self._jac, self._equality(x, left[0], right[0]), in_jac, values)

    def _fill_jacobian(self, left: Array, right: Array) -> None:
        upright = self.sides[:2] @ left[[0, 2], 3:6]
        slide = np.concatenate([-self.sides[1].T, np.zeros((2, 2))])
        blocks = [
            left[0, :3],
            upright[0],
            np.hstack([np.concatenate([left[2, :3], upright[1]]), slide]),
            right[1, :3],
            right[3, :3],
            np.hstack([-left[0, STILL], left[1, STILL]]),
            np.hstack([-left[2, STILL], left[3, STILL]]),
            np.hstack([-right[1, STILL], right[2, STILL]]),
        ]
        self._jac.data[: -2 * DOFS] = np.concatenate([b.ravel() for b in blocks])

    def _fill_curvature(self, left: tuple[Array, ...], right: tuple[Array, ...], y: Array) -> None:
        still = y[16:34].reshape(3, 6)
        for_left, for_right = np.zeros((5, 9)), np.zeros((4, 9))
        for k, rows in ((0, y[0:5]), (2, y[5:10])):
            for_left[k, :6] = np.concatenate([rows[:3], rows[3:] @ self.sides[k // 2]])
            for_left[k, STILL] -= still[k // 2]
            for_left[k + 1, STILL] = still[k // 2]
        for_right[1, :3], for_right[3, :3] = y[10:13], y[13:16]
        for_right[1, STILL] -= still[2]
        for_right[2, STILL] += still[2]
        # A hand at rest couples two slices of nearly equal configurations: their curvatures almost cancel, so they are
        # added before the clipping and act on the first slice; clipped one by one they would stiffen both.
        for (_, _, axes, jac), weights, arm, first, start in (
            (left, for_left, LEFT, [0, 2, 4], 0),
            (right, for_right, RIGHT, [1, 3], 3),
        ):
            hessian = curvature(axes, jac, weights)
            hessian = np.add.reduceat(hessian, first, axis=0)
            values, vectors = np.linalg.eigh(hessian)
            hessian = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.transpose(0, 2, 1)
            where, r, c = self._arm_at[arm[0]]
            np.add.at(self._hessian.data, where[start + np.array(first)], hessian[:, r, c])


class _Spheres:
    """Minimum distance of eight pairs of spheres in each slice, on two places of the left arm and four of the right."""

    def __init__(self, problem: PathProblem, margin: float) -> None:
        self.problem, self.margin = problem, margin
        self.joints = np.concatenate([LEFT, RIGHT])
        slices, pairs = problem.slices, 8
        columns = np.repeat(DOFS * np.arange(slices)[:, None] + self.joints, pairs, axis=0).ravel()
        indptr = np.arange(slices * pairs + 1) * self.joints.size
        self.jac = sp.csr_matrix((np.zeros(columns.size), columns, indptr), shape=(slices * pairs, problem.n))

    def _gaps(self, x: Array) -> tuple[tuple[Array, Array], tuple[Array, Array], Array]:
        """Return axes and hinge places of both arms, and the vectors (T, 2, 4, 3) from right to left spheres."""
        path = x[: DOFS * self.problem.slices].reshape(self.problem.slices, DOFS)
        left, right = (chain.forward(path[:, chain.joints])[1:] for chain in (self.problem.left, self.problem.right))
        return left, right, left[1][:, ON_LEFT, None] - right[1][:, None, ON_RIGHT]

    def values(self, x: Array) -> Array:
        """Return margin - distance (8 T,)."""
        return (self.margin - np.linalg.norm(self._gaps(x)[2], axis=-1)).ravel()

    def jacobian(self, x: Array) -> sp.csr_matrix:
        """Return the Jacobian of the values."""
        left, right, gap = self._gaps(x)
        unit = gap / np.linalg.norm(gap, axis=-1, keepdims=True)
        by_left = -np.einsum("sabi,saik->sabk", unit, _columns(*left, ON_LEFT))
        by_right = np.einsum("sabi,sbik->sabk", unit, _columns(*right, ON_RIGHT))
        self.jac.data[:] = np.concatenate([by_left, by_right], axis=-1).ravel()
        return self.jac


def _columns(axes: Array, places: Array, hinges: list[int]) -> Array:
    """Return the Jacobians (s, p, 3, k) of the places of some hinges."""
    columns = np.cross(axes[:, None], places[:, hinges, None] - places[:, None])
    columns *= (np.arange(axes.shape[1]) < np.array(hinges)[:, None])[None, :, :, None]
    return columns.transpose(0, 1, 3, 2)


def _chain(rng: np.random.Generator, joints: NDArray[np.int64], base: list[float]) -> Chain:
    """Return hinges about alternating axes with links of 5-20 cm along their last frame."""
    k = joints.size
    axes = np.eye(3)[np.arange(k) % 3]
    offsets = rng.uniform(-0.05, 0.05, (k, 3))
    offsets[:, 0] += np.linspace(0.2, 0.08, k)
    return Chain(joints, axes, offsets, np.array(base))
