"""Orders of one first part, and their costs over its mass."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lgp.experiments import toolbox_orders
from lgp.experiments.toolbox_mass import MASSES, mass_figure, mass_sweep
from lgp.experiments.toolbox_orders import GRASP_FIRST, PLACE_FIRST, best_of, break_even_mass

SECONDS = {PLACE_FIRST: 5.0, GRASP_FIRST: 10.0}


def test_orders_are_compared_by_sequences_of_one_first_part(monkeypatch: pytest.MonkeyPatch) -> None:
    def row(part: str, order: str, cost: float) -> dict[str, Any]:
        return {"actions": [f"grasp(1, arm, {part})", str(cost)], "order": order, "sequence": cost, "path": cost}

    def plan(_bounds: Any, _task: Any, sequence: list[str]) -> Any:
        return SimpleNamespace(actions=sequence, feasible=True, costs={"total": float(sequence[1])})

    monkeypatch.setattr(toolbox_orders, "plan_within", plan)
    monkeypatch.setattr(toolbox_orders, "parse_sequence", lambda _task, actions: actions)
    rows = [
        row("handle", PLACE_FIRST, 3.0), row("side", GRASP_FIRST, 3.5), row("handle", GRASP_FIRST, 4.2),
        row("handle", GRASP_FIRST, 4.0),
    ]  # fmt: skip
    unused: Any = None
    best = best_of(unused, unused, rows, GRASP_FIRST, "handle")
    assert best is not None
    assert best.costs["total"] == 4.0
    assert best_of(unused, unused, rows, PLACE_FIRST, "side") is None


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
