"""Some arms of example-robot-data, as docs/arms.md has them; the page is written with all of them."""

from __future__ import annotations

import runpy

import pytest

from tests.support.lgp_worlds import needs_robots
from tests.support.paths import ROOT

ARMS = runpy.run_path(str(ROOT / "docs" / "arms.py"))
TRIED = ("Borinot flying arm", "Kinova j2s6s200", "Panda, collision model", "UR5", "UR5 with a gripper")
pytestmark = [pytest.mark.slow, needs_robots]


def row(name: str) -> list[str]:
    """Return the cells of an arm in docs/arms.md."""
    lines = ARMS["PAGE"].read_text(encoding="utf-8").splitlines()
    return next([cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line.startswith(f"| {name} |"))


@pytest.mark.filterwarnings("ignore:.*has no body")
@pytest.mark.parametrize("name", TRIED)
def test_an_arm_does_what_its_row_says(name: str) -> None:
    outcome = ARMS["tried"](name, *ARMS["arms"]()[name])
    *cells, plan, _, _ = row(name)
    assert outcome.row.split(" | ")[1:6] == cells[1:], f"run: python docs/arms.py {name!r}"
    assert outcome.plan.partition(":")[0] == plan.partition(":")[0], f"run: python docs/arms.py {name!r}"
    assert not outcome.plan.startswith("none"), outcome.plan


def test_the_page_has_a_row_of_every_arm() -> None:
    for name in ARMS["arms"]():
        assert len(row(name)) == 9
