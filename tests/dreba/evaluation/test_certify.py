"""Proved bounds: no hand is where a field says it cannot be, no posture has less than what is proved."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from dreba.evaluation.certify import excluded, least_score
from dreba.evaluation.class_boxes import widest
from dreba.evaluation.hand_sets import CAP, DistanceField, hand_fields
from dreba.evaluation.reach_figure import ARMS, from_shoulder, hand
from dreba.evaluation.reach_tasks import ReachTask, tasks

pytestmark = pytest.mark.slow


@cache
def fields() -> dict[int, DistanceField]:
    return hand_fields(3, step=0.02, around=180)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_fields_are_below_the_distance_to_turned_points(axis: int) -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.2, 0.2, (20, 3))
    field = DistanceField.empty(axis, -0.3, 0.3, 0.3, 0.01, 360)
    for layer, places in field.layers():
        apart = np.linalg.norm(places[..., None, :] - points, axis=-1).min(axis=-1)
        field.values[layer] = np.minimum(apart, CAP) ** 2
    turned = field.swept(-20.0, 75.0)
    angles = np.radians(np.linspace(-20.0, 75.0, 300))[:, None]
    one, two = (axis + 1) % 3, (axis + 2) % 3
    swept = np.repeat(points[None], len(angles), axis=0)
    swept[..., one] = np.cos(angles) * points[:, one] - np.sin(angles) * points[:, two]
    swept[..., two] = np.sin(angles) * points[:, one] + np.cos(angles) * points[:, two]
    asked = rng.uniform(-0.35, 0.35, (500, 3))
    for found, cloud in ((field, points), (turned, swept.reshape(-1, 3))):
        distance = np.linalg.norm(asked[:, None] - cloud, axis=-1).min(axis=1)
        bound = np.sqrt(found.at(asked))
        assert (bound <= distance + 1e-6).all()
        assert np.mean((distance < CAP) & (distance > 0.03) & (bound > 0.5 * distance)) > 0.5 * np.mean(
            (distance < CAP) & (distance > 0.03)
        )


@pytest.mark.parametrize("level", [1, 3])
def test_no_hand_is_where_a_field_excludes_it(level: int) -> None:
    rng = np.random.default_rng(level)
    upright = np.zeros(22)
    for box in widest("left", level):
        for dofs in rng.uniform(box.low, box.high, (60, 22)):
            upright[ARMS["left"]] = dofs[ARMS["left"]]
            seen = from_shoulder(upright[None], "left", tuple(hand(upright, "left")[0]))
            assert fields()[level].at(seen)[0] == 0.0


@pytest.mark.parametrize(("a", "b"), [(1, 3), (2, 1), (5, 2)])
def test_a_task_is_never_excluded_at_the_scores_of_a_posture_that_solves_it(a: int, b: int) -> None:
    rng = np.random.default_rng(a)
    for _ in range(40):
        chosen = [found[rng.integers(len(found))] for found in (widest("a", a), widest("left", b), widest("right", b))]
        low, high = np.max([box.low for box in chosen], axis=0), np.min([box.high for box in chosen], axis=0)
        dofs = rng.uniform(low, high)
        task = ReachTask({side: tuple(hand(dofs, side)[0]) for side in ("left", "right")})  # type: ignore[misc]
        assert not excluded(task, a, b, fields())


def test_a_far_target_needs_more_than_the_lowest_score_and_a_near_one_does_not() -> None:
    far = ReachTask({"left": (0.3, 0.2, 0.12)})  # near the floor
    near = tasks(3, 0, "wide")[2]
    assert least_score(far, fields()).proved >= 2
    assert least_score(near, fields()).certified
