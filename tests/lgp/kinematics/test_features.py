"""Features and rotations: derivatives by differences, series near 0 and half a turn."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.kinematics import features
from lgp.kinematics.features import exponential, exponential_with_slope, inverse_right_jacobian, logarithm
from tests.support.lgp_worlds import anywhere, differences, human_world

HAND = "human.right_hand"


VECTORS = st.tuples(*[st.floats(-1.7, 1.7)] * 3).map(np.array)


@pytest.mark.parametrize("kind", ["along", "tilt", "pose", "pose_difference"])
def test_features_by_differences(kind: str) -> None:
    world = human_world("planted")
    q = anywhere(world, 6, seed=5)
    rotation = exponential(np.array([0.3, -1.0, 0.4]))

    def feature(x: np.ndarray) -> features.Feature:
        kinematics = world.at(x, [HAND, "human.left_hand"])
        place, other = kinematics.placement(HAND), kinematics.placement("human.left_hand")
        if kind == "along":
            return features.along(place, 0, rotation[0])
        if kind == "tilt":
            return features.tilt(place, 30.0)
        if kind == "pose":
            return features.pose(place, rotation, np.array([0.1, 0.2, 0.3]))
        return features.pose_difference(place, other)

    np.testing.assert_allclose(feature(q).jacobian, differences(lambda x: feature(x).value, q), atol=2e-7)


OTHER = "human.left_hand"
PAIRS = {
    "relative_position": features.relative_position,
    "difference": features.difference,
    "distance": features.distance,
    "outside_cone": lambda one, other: features.outside_cone(one, other, 20.0, 1),
    "offset": lambda one, other: features.position(features.offset(one, (0.1, -0.2, 0.3))),
    "stack": lambda one, other: features.stack(-features.axis(one, 0)[[2]] * 3.0, features.position(other) + 1.0),
}


@pytest.mark.parametrize("kind", list(PAIRS))
def test_features_of_two_frames_by_differences(kind: str) -> None:
    world = human_world("planted")
    q = anywhere(world, 5, seed=3)

    def feature(x: np.ndarray) -> features.Feature:
        kinematics = world.at(x, [HAND, OTHER])
        return PAIRS[kind](kinematics.placement(HAND), kinematics.placement(OTHER))

    np.testing.assert_allclose(feature(q).jacobian, differences(lambda x: feature(x).value, q), atol=2e-7)


def test_a_cone_is_around_its_axis() -> None:
    none = np.zeros((2, 6, 0))
    eye = features.FullPose(np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)), none)
    target = features.FullPose(eye.rotation, np.array([[0.2, 0.0, 1.0], [0.0, 0.6, 1.0]]), none)
    seen = features.outside_cone(eye, target, 20.0).value[:, 0]
    assert seen[0] < 0.0 < seen[1], "11 and 31 degrees from z"
    turned = features.offset(eye, (0.0, 0.0, 1.0), exponential(np.array([np.pi / 2, 0.0, 0.0])))
    np.testing.assert_allclose(turned.rotation[0, :, 2], [0.0, -1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(turned.position[0], [0.0, 0.0, 1.0])


def test_curvature_by_differences_of_jacobians() -> None:
    world = human_world("planted")
    q = anywhere(world, 3)
    weights = np.random.default_rng(0).standard_normal((3, 3))

    def slopes(x: np.ndarray, turned: bool) -> np.ndarray:
        place = world.at(x, [HAND]).placement(HAND)
        jacobian = features.axis(place, 2).jacobian if turned else place.jacobian[:, :3]
        return np.einsum("ni,nij->nj", weights, jacobian)

    place = world.at(q, [HAND]).placement(HAND)
    np.testing.assert_allclose(
        features.position_curvature(place.jacobian, weights), differences(lambda x: slopes(x, False), q), atol=1e-7
    )
    np.testing.assert_allclose(
        features.axis_curvature(place.jacobian, place.axis(2), weights),
        differences(lambda x: slopes(x, True), q),
        atol=1e-7,
    )


@settings(max_examples=60, deadline=None)
@given(VECTORS)
def test_rotation_vectors_go_round(vector: np.ndarray) -> None:
    rotation = exponential(vector)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(logarithm(rotation), vector, atol=1e-7)
    np.testing.assert_allclose(
        inverse_right_jacobian(vector) @ rotation.T @ exponential_with_slope(vector)[1], np.eye(3), atol=1e-9
    )


@pytest.mark.parametrize("vector", [(np.pi, 0, 0), (0, -np.pi, 0), (np.pi / np.sqrt(2), 0, -np.pi / np.sqrt(2))])
def test_half_a_turn_has_its_length(vector: tuple[float, ...]) -> None:
    found = logarithm(exponential(np.array(vector)))
    np.testing.assert_allclose(exponential(found), exponential(np.array(vector)), atol=1e-7)
    assert np.linalg.norm(found) == pytest.approx(np.pi)
