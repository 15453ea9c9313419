"""What `lgp plan` prints of a plan: constraints are called satisfied of a plan without a fault only."""

from __future__ import annotations

import io
import math
import re
from dataclasses import replace
from pathlib import Path
from unittest import mock

import pytest

import lgp
from lgp.console import show_plan, shown_progress
from lgp.plan_record import Plan
from lgp.scene.scene_file import read_scene
from lgp.search.records import SearchProgress
from reba.terminal import Console
from tests.support.gantry import PUT, TABLES, carried
from tests.support.lgp_worlds import HUMAN_ONLY

COSTS = {"total": 1.4, "acceleration": 1.0, "ergonomics": 0.0, "time": 0.4}
SEARCH = {"poses": 1, "sequences": 1, "paths": 1, "seconds": 0.1, "gap": 0.0}


def shown(plan: Plan) -> list[str]:
    """Return the lines that the terminal shows of a plan with its audit."""
    residuals = {"metres": 1e-8, "radians": 1e-8, "equality": 1e-8, "inequality": 1e-8, "penetration": 0.0}
    audited = replace(plan, audit=lgp.audit_plan(plan).summary(), costs=COSTS, residuals=residuals, search=SEARCH)
    text = io.StringIO()
    show_plan(Console(file=text, width=200), audited.summary())
    return text.getvalue().splitlines()


def test_a_clean_plan(tmp_path: Path) -> None:
    lines = shown(carried(tmp_path))
    assert lines[0] == "scene: 2 actions in 4.0 s; the audit found no faults"
    assert not any("REBA" in line for line in lines)  # there is nobody
    assert any(line.startswith("search: 1 pose, 1 sequence, 1 path in ") for line in lines)
    assert any(line.endswith("; constraints are satisfied within 1.0e-08 m and 1.0e-08 rad") for line in lines)
    assert "audit: nothing deeper than 1 mm in 201 samples, at most 42 % of joint speed limits" in lines


@pytest.mark.parametrize("terminal", [True, False])
def test_a_terminal_shows_what_a_search_knows_in_one_line(terminal: bool) -> None:
    out = io.StringIO()
    with mock.patch("sys.stderr", out), mock.patch.object(out, "isatty", return_value=terminal):
        with shown_progress() as on_progress:
            plan = lgp.plan(read_scene(HUMAN_ONLY), cost=None, collisions=False, on_progress=on_progress)
            if on_progress is not None:
                on_progress(SearchProgress("searching", 77, 2, 11.274, 2.15))
        assert plan.feasible
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", out.getvalue())
    assert ("searching: 77 sequences, 2 paths; cost 11.27, bound 2.15, gap 81 %" in text) == terminal
    assert terminal or not text


def test_the_progress_is_of_the_search_and_of_what_follows() -> None:
    known: list[SearchProgress] = []
    plan = lgp.plan(read_scene(HUMAN_ONLY), cost=None, collisions=False, on_progress=known.append)
    assert (known[0].step, known[0].paths, known[0].gap) == ("searching", 0, math.inf)
    assert (known[-1].step, known[-1].cost) == ("improving the motion", pytest.approx(plan.costs["total"]))


def test_a_plan_with_faults(tmp_path: Path) -> None:
    x, y, z, tilt = PUT
    edge = {"edge": {"position": [0.5, 0.0], "size": [0.1, 1.0], "height": 1.04, "thickness": 0.1}}
    lines = shown(carried(tmp_path, put=(x, y, z + 0.005, tilt), tables=TABLES | edge))
    assert lines[0].endswith("; the audit found 4 faults")
    assert any("; the constraints of the planner are satisfied" in line for line in lines)
    at = next(number for number, line in enumerate(lines) if line.startswith("audit: 4 faults in 201 samples"))
    assert lines[at + 1].startswith("  object/table: box is 40.0 mm in table.edge at ")
    assert lines[at + 2].startswith("  robot/table: gantry.f")
    assert lines[at + 2].endswith(" s, and 1 more")
    assert lines[at + 3].endswith("box is put down 5.0 mm too high on table.b at 4.00 s")


@pytest.mark.slow
def test_every_plan_has_an_audit_in_its_json() -> None:
    made = lgp.plan(read_scene(HUMAN_ONLY), cost=None, collisions=False)
    audit = made.summary()["audit"]
    assert audit["samples"] == 101
    assert {"deepest", "hands", "speed", "faults", "clean"} <= set(audit)
    assert 0.0 < audit["speed"] < 1.0
    assert audit == lgp.audit_plan(made).summary()
