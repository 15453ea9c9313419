"""`NetModel`: a ReLU network of the size of DULA and DEBA, for comparison only.

Yazdani et al. (2022), DULA and DEBA: Differentiable Ergonomic Risk Models: layers of 124, 124, 124 and 7 units, squared
error on the score, Adam. It is accurate, but a poor cost: between the learned steps its gradient is near 0.
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from dreba.errors import ModelError
from dreba.surrogates.base import Surrogate
from dreba.surrogates.registry import register
from dreba.surrogates.task_factors import TaskFactors
from dreba.surrogates.validation import COUNTS, check_sample_count
from reba.arrays import Array
from reba.checks import SEED, Allowed, count_to
from reba.method.rules import load_points
from reba.posture.factors import load_kg


@register
class NetModel(Surrogate):
    """Score from angles, load points and both couplings; activity is added. Piecewise linear: the Hessian is 0.

    Args:
        layers: units of the hidden layers.
        epochs: passes over the poses.
        seed: seed of the initial weights and of the order of the poses.
        joints: names of the columns; None for all 22.

    Example:
        >>> import dreba
        >>> poses = dreba.sample(500, rng=1)
        >>> model = NetModel(layers=(8,), epochs=2).fit(poses.angles, poses.reba)
        >>> model.gradient(poses.angles[0]).shape
        (22,)
    """

    kind = "net"
    learned: ClassVar[dict[str, int]] = {"layers_": 0, "biases_": 0, "middle_": 1, "spread_": 1}
    """Weights and biases of the layers; mean (`middle_`) and standard deviation (`spread_`) of the inputs."""

    allowed: ClassVar[dict[str, Allowed]] = {"layers": COUNTS, "epochs": count_to(1_000_000), "seed": SEED}

    layers_: list[Array]
    biases_: list[Array]
    middle_: Array
    spread_: Array

    def __init__(
        self,
        layers: tuple[int, ...] = (124, 124, 124, 7),
        epochs: int = 40,
        seed: int = 0,
        joints: Sequence[str] | None = None,
    ) -> None:
        self.layers = layers
        self.epochs = epochs
        self.seed = seed
        self.joints = joints

    def _fit(self, poses: Array, scores: Array, weights: Array, factors: TaskFactors) -> None:
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.neural_network import MLPRegressor

        check_sample_count(len(scores))
        inputs = np.column_stack([poses, *_points(factors, len(poses))])
        self.middle_ = inputs.mean(axis=0)
        deviation = inputs.std(axis=0)
        self.spread_ = np.where(deviation > 1e-9, deviation, 1.0)  # an input that does not vary is not scaled
        net = MLPRegressor(
            hidden_layer_sizes=self.layers, max_iter=self.epochs, random_state=self.seed, n_iter_no_change=self.epochs
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # the fit has a fixed number of epochs
            net.fit((inputs - self.middle_) / self.spread_, scores - factors.activity, weights)
        self.layers_, self.biases_ = list(net.coefs_), list(net.intercepts_)
        constant = deviation <= 1e-9
        constant[: poses.shape[1]] = False
        self.layers_[0][constant] = 0.0  # the weights of a factor that no pose varies in are those of the start

    def _restore(self, state: dict[str, Any]) -> None:
        if set(state) != set(self.learned):
            raise ModelError(f"parameters are {', '.join(sorted(state))}; expected {', '.join(sorted(self.learned))}")
        try:
            layers = [np.asarray(layer, np.float64) for layer in state["layers_"]]
            biases = [np.asarray(bias, np.float64) for bias in state["biases_"]]
            middle, deviation = (np.asarray(state[name], np.float64) for name in ("middle_", "spread_"))
        except (TypeError, ValueError) as error:
            raise ModelError("the net has a value that is not a number; the file is damaged") from error
        sizes = [len(self.joints_) + 3, *self.layers, 1]
        fits = [layer.shape for layer in layers] == list(itertools.pairwise(sizes))
        fits = fits and [bias.shape for bias in biases] == [(size,) for size in sizes[1:]]
        if not fits or middle.shape != (sizes[0],) or deviation.shape != (sizes[0],):
            raise ModelError(
                f"layers do not fit {len(self.joints_)} joints and {self.layers} units; the file is damaged"
            )
        if not all(np.isfinite(array).all() for array in (*layers, *biases, middle, deviation)):
            raise ModelError("the net has values that are not finite; the file is damaged")
        self.layers_, self.biases_, self.middle_, self.spread_ = layers, biases, middle, deviation

    def _value_gradient(self, poses: Array, factors: TaskFactors) -> tuple[Array, Array]:
        n = len(poses)
        points = [np.broadcast_to(part, n) for part in _points(factors, n)]
        signal = (np.column_stack([poses, *points]) - self.middle_) / self.spread_
        active_units = []
        for layer, bias in zip(self.layers_[:-1], self.biases_[:-1], strict=True):
            signal = signal @ layer + bias
            active_units.append(signal > 0.0)
            signal *= active_units[-1]
        value = (signal @ self.layers_[-1] + self.biases_[-1])[:, 0]
        back = np.broadcast_to(self.layers_[-1][:, 0], (n, len(self.layers_[-1])))
        for layer, active in zip(reversed(self.layers_[:-1]), reversed(active_units), strict=True):
            back = (back * active) @ layer.T
        return value + factors.activity, (back / self.spread_)[:, : len(self.joints_)]

    def _hessian(self, poses: Array, factors: TaskFactors) -> Array:
        return np.zeros((len(poses), len(self.joints_), len(self.joints_)))

    def _factor_weights(self) -> dict[str, float]:
        load, left, right = (float(abs(row).max()) for row in self.layers_[0][-3:])
        return {"load": load, "coupling": max(left, right), "activity": 1.0}

    def _payload(self) -> dict[str, Any]:
        return {"form": "inputs"}


def _points(given: TaskFactors, n: int) -> tuple[Array, Array, Array]:
    """Return load points, left and right coupling, each (n,)."""
    load = load_kg(given.load, n)
    points = load_points(load).astype(float)
    left, right = (np.broadcast_to(np.asarray(side, np.float64), n) for side in given.coupling)
    return np.broadcast_to(points, n), left, right
