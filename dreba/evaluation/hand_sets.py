"""Where a hand can be relative to its shoulder while Score B stays low: lower bounds of the distance to that set.

The set of grip positions of a box of arm angles is built from the hand to the shoulder. Each joint turns the set of the
joints before it about one axis: in cylindrical coordinates about this axis that is a minimum over a range of the angle.
What is stored at nodes are lower bounds of squared distances. The squared distance d(p)^2 to any set is |p|^2 plus a
minimum of affine functions, so that d(p)^2 - |p|^2 is concave: for weights w of nodes x whose mean is p,

    d(p)^2 >= sum w d(x)^2 - sum w |x - p|^2,

a lower bound between the nodes whose loss is of the order of the squared step. Rounding therefore makes sets larger,
never smaller, and a position with a positive bound is proved to be out of reach.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from dreba.evaluation.class_boxes import Box, boxes
from dreba.evaluation.reach_figure import CHAINS, Joint, turn
from reba.arrays import Array

CAP: Final = 0.08
"""[m] Larger distances are stored as this one, which is a lower bound too."""
POINT_STEP: Final = 0.5
"""[deg] Step of the wrist angles in the points that the construction begins with."""
POINT_SIZE: Final = 1e-3
"""[m] Size of the cells in which these points are merged."""
WRIST: Final = CHAINS["left"][7:]
"""Twist, flexion and deviation of the left wrist; the right arm is its mirror image."""
ARM: Final = CHAINS["left"][3:7]
"""Flexion, abduction and rotation of the upper arm, and the elbow."""
ROUNDING: Final = 1e-5
"""[m] Allowance for single precision and for the arc between two nodes, which is not quite the chord."""


@dataclass(frozen=True)
class DistanceField:
    """Lower bounds of the squared distance [m^2] to a set of points, by cylindrical coordinates about an axis.

    The nodes span a cylinder that contains the set. It is convex: the squared distance of a point outside is at least
    that of its nearest point in the cylinder plus the square of the way there.

    Attributes:
        axis: 0, 1 or 2.
        start: [m] first node along the axis.
        step: [m] distance of nodes along the axis and away from it.
        values: (along the axis, away from it, around it), float32.
    """

    axis: int
    start: float
    step: float
    values: Array

    @staticmethod
    def empty(axis: int, start: float, end: float, radius: float, step: float, around: int) -> DistanceField:
        """Return a field without values over a cylinder, with a number of nodes around its axis."""
        shape = (int(np.ceil((end - start) / step)) + 1, int(np.ceil(radius / step)) + 1, around)
        return DistanceField(axis, start, step, np.empty(shape, np.float32))

    @property
    def turn(self) -> float:
        """Angle between two nodes [rad]."""
        return 2.0 * np.pi / self.values.shape[2]

    def layers(self) -> Iterator[tuple[int, Any]]:
        """Yield each layer along the axis with the positions of its nodes (away, around, 3)."""
        away = np.arange(self.values.shape[1]) * self.step
        around = np.arange(self.values.shape[2]) * self.turn
        points = np.empty((len(away), len(around), 3), np.float32)
        points[..., (self.axis + 1) % 3] = away[:, None] * np.cos(around)
        points[..., (self.axis + 2) % 3] = away[:, None] * np.sin(around)
        for layer in range(len(self.values)):
            points[..., self.axis] = self.start + layer * self.step
            yield layer, points

    def at(self, points: Array) -> Array:
        """Return lower bounds (...) of the squared distance [m^2] of points (..., 3) [m], 0 where nothing is proved."""
        x, y = points[..., (self.axis + 1) % 3], points[..., (self.axis + 2) % 3]
        layers, rings, circle = self.values.shape
        far_along, far_away = (points[..., self.axis] - self.start) / self.step, np.hypot(x, y) / self.step
        along, away = np.clip(far_along, 0, layers - 1.001), np.minimum(far_away, rings - 1.001)
        around = np.arctan2(y, x) / self.turn
        i, j, k = (np.floor(place).astype(np.int32) for place in (along, away, around))
        f, g, h = along - i, away - j, around - k
        after, k = (k + 1) % circle, k % circle
        bounds = np.zeros(f.shape, np.float32)
        for layer, of_layer in ((i, 1.0 - f), (i + 1, f)):
            for ring, of_ring in ((j, 1.0 - g), (j + 1, g)):
                low, high = self.values[layer, ring, k], self.values[layer, ring, after]
                bounds += of_layer * of_ring * (low + h * (high - low))
        spread = f * (1.0 - f) + g * (1.0 - g) + h * (1.0 - h) * ((j + 1) * self.turn) ** 2
        outside = (far_along - along) ** 2 + (far_away - away) ** 2
        return np.maximum(bounds + self.step**2 * (outside - spread) - 2.0 * ROUNDING * CAP, 0.0)

    def swept(self, low: float, high: float) -> DistanceField:
        """Return the field of the set turned about the axis by every angle from low to high [deg]."""
        from scipy.ndimage import minimum_filter1d

        around = self.values.shape[2]
        first, last = int(np.floor(np.radians(low) / self.turn)), int(np.ceil(np.radians(high) / self.turn))
        if last - first + 1 >= around:
            least = np.broadcast_to(self.values.min(axis=2, keepdims=True), self.values.shape)
        else:
            width = last - first + 1
            least = np.roll(minimum_filter1d(self.values, width, axis=2, mode="wrap"), last - width // 2, axis=2)
        chords = np.arange(self.values.shape[1], dtype=np.float32)[None, :, None] * np.float32(self.step * self.turn)
        return replace(self, values=np.maximum(least - chords**2 / 4.0 - 2.0 * ROUNDING * CAP, 0.0))

    def about(self, nodes: DistanceField, offset: tuple[float, float, float]) -> DistanceField:
        """Return the field of the set moved by an offset [m], at the nodes of another field."""
        values = np.empty_like(nodes.values)
        for layer, points in nodes.layers():
            values[layer] = np.minimum(self.at(points - np.array(offset, np.float32)), CAP**2)
        return replace(nodes, values=values)


def hand_fields(most: int, step: float = 0.006, around: int = 600) -> dict[int, DistanceField]:
    """Return for each Score B up to `most` the field of the positions of the left grip relative to the shoulder.

    Args:
        step: [m] distance of nodes; positions up to about twice that from the set are not proved to be out of reach.
        around: number of nodes around an axis.
    """
    flexion, abduction, rotation, elbow = ARM
    reach = float(sum(np.linalg.norm(joint.offset) for joint in CHAINS["left"][3:])) + step
    forearm = reach - float(np.linalg.norm(rotation.offset))
    wanted = [box for box in boxes("left") if box.score <= most]
    fields: dict[int, DistanceField] = {}
    for wrist, of_wrist in _by(wanted, WRIST):
        hand = _hand_field(wrist, DistanceField.empty(1, -0.22, 0.22, forearm, step, around))
        for bent, of_elbow in _by(of_wrist, [elbow]):
            elbows = _turned(hand, elbow, bent[0]).about(
                DistanceField.empty(2, -reach, forearm - float(np.linalg.norm(rotation.offset)), forearm, step, around),
                rotation.offset,
            )
            shoulder = DistanceField.empty(0, -reach, reach, reach, step, around)
            turned = _turned(elbows, rotation, _ends(wanted[0], rotation)).about(shoulder, (0.0, 0.0, 0.0))
            for raised, of_abduction in _by(of_elbow, [abduction]):
                shoulder = DistanceField.empty(1, -reach, reach, reach, step, around)
                away = _turned(turned, abduction, raised[0]).about(shoulder, (0.0, 0.0, 0.0))
                for flexed, same in _by(of_abduction, [flexion]):
                    values = _turned(away, flexion, flexed[0]).values
                    for level in range(min(box.score for box in same), most + 1):
                        known = fields.get(level)
                        least = values if known is None else np.minimum(known.values, values)
                        fields[level] = replace(away, values=least)
    return fields


_Ends = tuple[float, float]


def _ends(box: Box, joint: Joint) -> _Ends:
    """Return the angles of a joint in a box, from the lowest to the highest [deg]."""
    return float(box.low[joint.dof]), float(box.high[joint.dof])


def _by(wanted: list[Box], joints: Sequence[Joint]) -> Iterator[tuple[tuple[_Ends, ...], list[Box]]]:
    """Yield boxes that are alike in the angles of some joints, with these angles."""
    groups: dict[tuple[_Ends, ...], list[Box]] = {}
    for box in wanted:
        groups.setdefault(tuple(_ends(box, joint) for joint in joints), []).append(box)
    yield from groups.items()


def _turned(field: DistanceField, joint: Joint, ends: _Ends) -> DistanceField:
    """Return the field of a set turned by every angle of a joint about its axis, which is that of the field."""
    low, high = sorted(joint.axis[field.axis] * end for end in ends)
    return field.swept(low, high)


def _hand_field(wrist: tuple[_Ends, ...], nodes: DistanceField) -> DistanceField:
    """Return the field of the grip positions relative to the elbow, the forearm hanging."""
    from scipy.spatial import cKDTree

    points, cover = _grips(wrist)
    tree = cKDTree(points)
    values = np.empty_like(nodes.values)
    for layer, places in nodes.layers():
        distances, _ = tree.query(places.reshape(-1, 3), distance_upper_bound=CAP)
        bounds = np.clip(np.minimum(distances, CAP) - cover - ROUNDING, 0.0, None)
        values[layer] = bounds.reshape(values[layer].shape) ** 2
    return replace(nodes, values=values)


def _grips(wrist: tuple[_Ends, ...]) -> tuple[Array, float]:
    """Return grip positions (n, 3) [m] such that every other one is within a distance [m] of one of them."""
    twist, flexion, deviation = WRIST
    grip = np.array(deviation.offset)
    angles = [np.linspace(low, high, int(np.ceil((high - low) / POINT_STEP)) + 1) for low, high in wrist]
    points = np.array([turn(deviation, one) @ grip for one in angles[2]])
    points = np.concatenate([points @ turn(flexion, one).T for one in angles[1]])
    cells = np.concatenate([np.rint(points @ turn(twist, one).T / POINT_SIZE).astype(np.int64) for one in angles[0]])
    low, size = cells.min(axis=0), np.ptp(cells, axis=0) + 1
    # Numbered, as sorting numbers is many times faster than sorting rows.
    cells = low + np.column_stack(np.unravel_index(np.unique(np.ravel_multi_index((cells - low).T, size)), size))
    half_steps = len(WRIST) * float(np.linalg.norm(grip)) * np.radians(POINT_STEP) / 2.0
    return cells * POINT_SIZE + np.array(twist.offset), half_steps + POINT_SIZE * np.sqrt(3.0) / 2.0
