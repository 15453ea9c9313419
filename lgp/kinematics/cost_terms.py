"""Cost terms of one's own: functions of a configuration, registered by name, that a scene weights in `[cost.terms]`.

A term is at least 0 and counts per second, as the ergonomic cost does, so that a plan on fewer slices costs no more
than one on all of them. Its second derivatives are those of a Gauss-Newton factor F, F'F.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from lgp.errors import LgpError, WorldError
from lgp.extensions import ask
from lgp.kinematics.features import Feature, FullPose, rotation_about_z
from lgp.kinematics.world import World
from lgp.scene.model import Scene
from reba.arrays import Array, Indices
from reba.checks import TEXT, Allowed, accepts
from reba.errors import did_you_mean


class ConfigurationMoment:
    """The n configurations q (n, nq) [rad, m] in which a cost term is asked, with Jacobians by q.

    Attributes:
        asked: joints and frames that were asked for.
    """

    def __init__(self, world: World, q: Array) -> None:
        self.world, self.q = world, q
        self.asked: list[str] = []

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.world.scene

    def place(self, name: str) -> FullPose:
        """Return the placements of a hand, a table (the centre of its top) or a frame such as `human.head`.

        Raises:
            WorldError: there is no such frame; objects have none, as where they are depends on the actions.
        """
        if name in self.scene.objects:
            raise WorldError(f"a cost term asks for the object {name!r}, expected a hand, a table or a frame")
        if name in self.scene.tables and name not in self.scene.carried_tables:
            table = self.scene.tables[name]
            top = np.broadcast_to(rotation_about_z(np.radians(table.yaw)), (len(self.q), 3, 3))
            middle = np.tile([*table.position, table.height], (len(self.q), 1))
            return FullPose(top, middle, np.zeros((len(self.q), 6, self.q.shape[1])))
        self.asked.append(name)
        place = self.world.at(self.q, [name]).placement(name)
        return FullPose(place.rotation, place.position, place.jacobian)

    def joint(self, name: str) -> Feature:
        """Return the values (n, 1) [rad, m] of a joint such as `human.right_elbow_Z`.

        Raises:
            WorldError: there is no such joint, or it does not move.
        """
        if name not in self.world.column:
            raise WorldError(f"no joint {name!r} that moves{did_you_mean(name, self.world.column)}")
        self.asked.append(name)
        jacobian = np.zeros((len(self.q), 1, self.q.shape[1]))
        jacobian[:, 0, self.world.column[name]] = 1.0
        return Feature(self.q[:, [self.world.column[name]]], jacobian)


@dataclass(frozen=True)
class TermValues:
    """A cost term in n configurations.

    Attributes:
        value: (n,), at least 0.
        gradient: (n, nq).
        factor: F (n, m, nq); F'F stands for the second derivatives.
    """

    value: Array
    gradient: Array
    factor: Array


def squares(feature: Feature, *, beyond: bool = False) -> TermValues:
    """Return the sum of the squares of a feature as a cost term.

    Args:
        beyond: of its positive values only: a feature at most 0 costs nothing.

    >>> at = Feature(np.array([[2.0, -1.0]]), np.eye(2)[None])
    >>> squares(at).value.tolist(), squares(at, beyond=True).value.tolist()
    ([5.0], [4.0])
    """
    counts = feature.value > 0.0 if beyond else np.ones(feature.value.shape, dtype=bool)
    value = np.where(counts, feature.value, 0.0)
    jacobian = np.where(counts[:, :, None], feature.jacobian, 0.0)
    gradient = 2.0 * np.einsum("nm,nmj->nj", value, jacobian)
    return TermValues((value**2).sum(axis=1), gradient, np.sqrt(2.0) * jacobian)


CostTerm = Callable[[ConfigurationMoment], TermValues]
"""A cost term: what it costs, for each configuration and second."""
_registered: dict[str, CostTerm] = {}
TERM: Final = Allowed("a function of a `ConfigurationMoment` that returns `TermValues`", callable)


@accepts(LgpError, name=TEXT, term=TERM)
def register_cost_term(name: str, term: CostTerm) -> None:
    """Register a cost term under the name by which scenes weight it; it may be registered again.

    Example:
        >>> import lgp
        >>> from lgp.kinematics.cost_terms import squares
        >>> lgp.register_cost_term("elbow_bent", lambda at: squares(at.joint("human.right_elbow_Z")))
    """
    if not name.isidentifier():
        raise LgpError(f"cost term {name!r} is no name; use letters, digits and _")
    _registered[name] = term


class CostTerms:
    """The weighted sum of the terms of a scene.

    Attributes:
        columns: (p,) columns of q that they depend on, as far as what they ask for tells.

    Raises:
        LgpError: a term is not registered, or its values do not fit.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.weights = world.scene.cost.terms
        for name in self.weights:
            if name not in _registered:
                raise LgpError(
                    f"{world.scene.name}: cost term {name!r} is not registered{did_you_mean(name, _registered)}; "
                    "register it with lgp.register_cost_term, or give its file with --extension"
                )
        first = np.tile(world.initial_configuration, (2, 1))
        moved, asked = np.zeros(world.nq, dtype=bool), set[str]()
        for name in self.weights:
            moment = ConfigurationMoment(world, first)
            _asked(name, moment, 2)
            asked |= set(moment.asked)
        for name in asked:
            moved |= np.arange(world.nq) == world.column[name] if name in world.column else world.support(name) > 0.0
        self.columns: Indices = np.flatnonzero(moved)

    def __bool__(self) -> bool:
        return bool(self.weights)

    def value(self, q: Array) -> Array:
        """Return the cost (n,) per second of configurations (n, nq)."""
        return self.quadratic_model(q)[0]

    def quadratic_model(self, q: Array) -> tuple[Array, Array, Array]:
        """Return value (n,), gradient (n, p) and convex Hessian (n, p, p) by `columns`."""
        value, gradient = np.zeros(len(q)), np.zeros((len(q), len(self.columns)))
        hessian = np.zeros((len(q), len(self.columns), len(self.columns)))
        for name, weight in self.weights.items():
            term = _asked(name, ConfigurationMoment(self.world, q), len(q))
            factor = term.factor[:, :, self.columns]
            value += weight * term.value
            gradient += weight * term.gradient[:, self.columns]
            hessian += weight * (np.swapaxes(factor, 1, 2) @ factor)
        return value, gradient, hessian


def _asked(name: str, moment: ConfigurationMoment, count: int) -> TermValues:
    return _check(name, ask(f"cost term {name!r}", _registered[name], moment), count, moment.world.nq)


def _check(name: str, values: object, count: int, nq: int) -> TermValues:
    """Return the values of a term if they fit n configurations (n, nq)."""
    if not isinstance(values, TermValues):
        raise LgpError(f"cost term {name!r} returns a {type(values).__name__}, expected `TermValues`; correct it")
    shapes = values.value.shape, values.gradient.shape, values.factor.shape
    if shapes[:2] != ((count,), (count, nq)) or len(shapes[2]) != 3 or shapes[2][::2] != (count, nq):
        raise LgpError(
            f"cost term {name!r} returns shapes {', '.join(map(str, shapes))} in {count} configurations, expected "
            f"({count},), ({count}, {nq}) and ({count}, m, {nq}); correct it"
        )
    for part in (values.value, values.gradient, values.factor):
        if not np.isfinite(part).all():
            raise LgpError(f"cost term {name!r} has {part[~np.isfinite(part)][0]}, expected finite numbers; correct it")
    if (values.value < 0.0).any():
        raise LgpError(f"cost term {name!r} is {values.value.min():.3g}, expected 0 or more; add a constant")
    return values
