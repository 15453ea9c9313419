"""The ribbon of the shipped scenes has something to show: with ergonomics REBA is lower than without."""

from __future__ import annotations

import pytest

import lgp
from lgp.page.page import score_spans

pytestmark = pytest.mark.slow
SEQUENCES = {
    "screwdriver": ("baxter.right", "table.left"),
    "screwdriver_panda": ("panda.hand", "table.left"),
}


@pytest.mark.parametrize("name", SEQUENCES)
def test_the_ribbon_differs_with_and_without_ergonomics(name: str) -> None:
    hand, table = SEQUENCES[name]
    actions = [
        f"grasp(1, {hand}, screwdriver)",
        f"place(2, {hand}, screwdriver, {table})",
        "grasp(3, human.right_hand, screwdriver)",
    ]
    scene = lgp.load_scene(name)
    plain = lgp.plan(scene, cost=None, sequence=actions)
    ergonomic = lgp.plan(scene, sequence=actions)
    assert plain.feasible
    assert ergonomic.feasible
    highest = [max(span.score for spans in score_spans(plan).values() for span in spans) for plan in (ergonomic, plain)]
    assert highest[0] <= 2 < 4 <= highest[1], highest
