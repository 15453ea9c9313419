"""Boxes of classes: what lies in them has at most their score, and what lies outside has more."""

from __future__ import annotations

import numpy as np
import pytest

import reba
from dreba.evaluation.class_boxes import boxes, levels, widest
from dreba.evaluation.reach_figure import limits, posture


@pytest.mark.parametrize(("group", "column"), [("a", "score_a"), ("left", "score_b_left"), ("right", "score_b_right")])
def test_boxes_agree_with_the_exact_score(group: str, column: str) -> None:
    low, high = limits()
    drawn = np.random.default_rng(4).uniform(low, high, (4000, 22))
    drawn[:, 3:6] = 0.0  # the neck, which boxes keep in its lowest class
    scores = reba.score_array(np.array([posture(one) for one in drawn]))[column]
    for level in range(1, int(scores.max()) + 1):
        inside = np.any(
            [((box.low <= drawn) & (drawn <= box.high)).all(axis=1) for box in widest(group, level)], axis=0
        )
        assert np.array_equal(inside, scores <= level), level


def test_a_score_of_a_box_is_the_highest_inside() -> None:
    rng = np.random.default_rng(5)
    for box in boxes("left"):
        inside = np.array([posture(one) for one in rng.uniform(box.low, box.high, (50, 22))])
        assert reba.score_array(inside)["score_b_left"].max() <= box.score


def test_levels_are_the_edges_of_table_c() -> None:
    for score in range(1, 13):
        allowed = np.zeros((12, 12), bool)
        for a, b in levels(score):
            allowed[:a, :b] = True
        assert np.array_equal(allowed, score >= reba.TABLE_C)
