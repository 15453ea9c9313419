"""The audit of plans in which a robot carries a table."""

from __future__ import annotations

from pathlib import Path

import lgp
from tests.support.carried_tray import DRIVEN, TRAY, aboard_and_back
from tests.support.gantry import TABLES


def test_a_box_on_a_tray_is_taken_from_where_it_was_driven(tmp_path: Path) -> None:
    assert not lgp.audit_plan(aboard_and_back(tmp_path)).faults


def test_a_box_on_a_tray_is_no_longer_where_it_was_put_down(tmp_path: Path) -> None:
    # The bridge carries the hand and the tray alike, so both are displaced; a tray on the floor stays behind.
    standing = {name: value for name, value in TRAY.items() if name != "frame"}
    plan = aboard_and_back(tmp_path, tables={**TABLES, "tray": standing})
    faults = [fault.what for fault in lgp.audit_plan(plan).faults]
    assert any(f"gantry.hand is {1000 * DRIVEN:.1f} mm beside the grip of box" in what for what in faults)


def test_a_tray_that_is_driven_into_a_table_is_a_fault(tmp_path: Path) -> None:
    wall = {"position": [DRIVEN, 1.3], "size": [0.1, 0.4], "height": 0.81}
    faults = [
        one.what
        for one in lgp.audit_plan(aboard_and_back(tmp_path, tables={**TABLES, "tray": TRAY, "wall": wall})).faults
    ]
    assert any("table.tray" in what and "table.wall" in what for what in faults)
