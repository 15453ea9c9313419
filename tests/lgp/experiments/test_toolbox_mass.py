"""Costs of both orders over the mass of the first part."""

from __future__ import annotations

import re

import numpy as np
import pytest

from lgp.experiments.toolbox_mass import MASSES, mass_figure, mass_sweep
from lgp.experiments.toolbox_orders import GRASP_FIRST, PLACE_FIRST

SECONDS = {PLACE_FIRST: 5.0, GRASP_FIRST: 10.0}


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
    assert mass_sweep({PLACE_FIRST: 9.0, GRASP_FIRST: 1.0}, SECONDS, 0.5, 1.0, 8.0)[-1]["mass"] >= 10.0


def test_the_figure_marks_the_mass_and_the_change() -> None:
    rows = mass_sweep({PLACE_FIRST: 6.24, GRASP_FIRST: 8.48}, SECONDS, 1.06, 4.0, 0.5)
    figure = mass_figure(rows, 1.06, 0.5)
    assert len(re.findall("<polyline", figure)) == 2
    assert "stroke-dasharray" in figure
    assert "5 5" not in mass_figure(rows, 1.06, None)
    assert mass_figure([], 1.0, None) == ""
