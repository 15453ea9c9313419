"""Orders of one first part, and their costs over its mass."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.experiments import published, toolbox_orders
from lgp.experiments.toolbox_mass import MASSES, mass_figure, mass_sweep
from lgp.experiments.toolbox_orders import GRASP_FIRST, PLACE_FIRST, best_of, break_even_mass
from lgp.planner import task_of
from lgp.search.records import Skeleton

SECONDS = {PLACE_FIRST: 5.0, GRASP_FIRST: 10.0}


def test_orders_are_compared_by_sequences_of_one_first_part(monkeypatch: pytest.MonkeyPatch) -> None:
    handle, side = "toolbox/handle", "toolbox/side.left"
    task = task_of(lgp.load_scene("toolbox"))
    end = [f"hold(7, baxter.right, {handle})", f"screw(8, human.right_hand, {handle}, {side})"]
    place, grasp = ([*published.TOOLBOX_SEQUENCES[name][:6], *end] for name in ("ergonomic", "non-ergonomic"))
    turned = [action.replace(handle, "?").replace(side, handle).replace("?", side) for action in grasp[:6]] + end
    costs = {tuple(place): 3.0, tuple(grasp): 4.0, tuple(turned): 3.5}
    planned: list[tuple[str, ...]] = []

    def plan(_bounds: Any, _task: Any, sequence: Skeleton) -> Any:
        actions = tuple(action.at(step + 1) for step, action in enumerate(sequence))
        planned.append(actions)
        return SimpleNamespace(actions=actions, feasible=True, costs={"total": costs[actions]})

    def row(actions: list[str], order: str) -> dict[str, Any]:
        cost = costs[tuple(actions)]
        return {"actions": actions, "order": order, "sequence": cost, "path": cost}

    monkeypatch.setattr(toolbox_orders, "plan_within", plan)
    unused: Any = None
    every = [row(place, PLACE_FIRST), row(turned, GRASP_FIRST), row(grasp, GRASP_FIRST)]
    for known in (every, every[:2]):  # the search need not have seen the other order
        best = best_of(unused, task, known, GRASP_FIRST, handle)
        assert best is not None
        assert (best.costs["total"], best.actions) == (4.0, tuple(grasp))
    assert tuple(turned) not in planned
    assert best_of(unused, task, every[:1], GRASP_FIRST, side) is None


def test_the_mass_from_which_placing_first_pays_is_where_both_cost_the_same() -> None:
    def costs(mass: float, *, place: float = 2.0, grasp: float = 1.4) -> dict[str, float]:
        """Of plans whose second part costs as much in both orders: that is in `place` and `grasp`."""
        rest = {PLACE_FIRST: place, GRASP_FIRST: grasp}
        return {order: rest[order] + 4.0 * mass * seconds / 5.0 for order, seconds in SECONDS.items()}

    for known in (0.0, 1.06, 3.0):  # the mass of the part that was planned with does not matter
        assert break_even_mass(costs(known), SECONDS, known, 4.0) == pytest.approx(0.15)
        assert break_even_mass(costs(known, place=1.0), SECONDS, known, 4.0) == 0.0
    assert costs(0.15)[PLACE_FIRST] == pytest.approx(costs(0.15)[GRASP_FIRST])
    equal = dict.fromkeys(SECONDS, 5.0)
    assert break_even_mass({PLACE_FIRST: 2.0, GRASP_FIRST: 1.0}, equal, 1.0, 4.0) is None
    assert break_even_mass({PLACE_FIRST: 1.0, GRASP_FIRST: 2.0}, equal, 1.0, 4.0) == 0.0


def test_costs_are_lines_that_cross_where_the_order_changes() -> None:
    # Weight 4 and 1.06 kg: 4.24 and 8.48 of load; they cost the same at 0.5 kg.
    totals = {PLACE_FIRST: 2.0 + 4.24, GRASP_FIRST: 2.0 - 2.0 + 8.48}
    rows = mass_sweep(totals, SECONDS, 1.06, 4.0, 0.5)
    masses = [row["mass"] for row in rows]
    assert len(rows) == MASSES
    assert masses[0] == 0.0
    assert masses[-1] >= 2 * 1.06
    assert rows[0]["costs"] == {PLACE_FIRST: pytest.approx(2.0), GRASP_FIRST: pytest.approx(0.0)}
    assert [row["order"] for row in rows] == [GRASP_FIRST if mass < 0.5 else PLACE_FIRST for mass in masses]
    for order, seconds in SECONDS.items():
        costs = [row["costs"][order] for row in rows]
        assert np.diff(costs) / np.diff(masses) == pytest.approx(4.0 * seconds / 5.0)


def test_the_sweep_reaches_beyond_the_change() -> None:
    assert mass_sweep({PLACE_FIRST: 1.0, GRASP_FIRST: 1.0}, SECONDS, 0.0, 1.0, 0.0)[-1]["mass"] >= 1.0
    assert mass_sweep({PLACE_FIRST: 9.0, GRASP_FIRST: 1.0}, SECONDS, 0.5, 1.0, 8.0)[-1]["mass"] >= 10.0


def test_the_figure_marks_the_mass_and_the_change() -> None:
    rows = mass_sweep({PLACE_FIRST: 6.24, GRASP_FIRST: 8.48}, SECONDS, 1.06, 4.0, 0.5)
    figure = mass_figure(rows, 1.06, 0.5)
    assert len(re.findall("<polyline", figure)) == 2
    assert "stroke-dasharray" in figure
    assert "5 5" not in mass_figure(rows, 1.06, None)
    assert mass_figure([], 1.0, None) == ""
