"""Where every path near those that ignore bodies is stuck in them, a motion by sampling leads to a plan."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lgp
from lgp.kinematics.world import World
from lgp.path.bounds import PathBounds
from lgp.path.sampled_motion import sampled_motions
from lgp.planner import follow, parse_sequence, task_of
from lgp.scene.scene_file import read_scene
from lgp.search.records import SearchStatus
from tests.support.says import says

pytestmark = pytest.mark.slow
ACTIONS = ["grasp(panda.hand, box)", "place(panda.hand, box, table.top)"]


def cabinet(clear: float) -> dict[str, Any]:
    """Return a scene: a box stands under a board, that much above the shelf [m], and is to be put on the board."""
    board = {"position": [0.55, -0.1], "size": [0.5, 0.6]}
    return {
        "title": "box under a board",
        "domain": "screwdriver",
        "initial": ["on_table(box)", "free(panda.hand)"],
        "goal": ["placed(box, table.top)"],
        "tables": {"shelf": {**board, "height": 0.7}, "top": {**board, "height": 0.7 + clear}},
        "objects": {"box": {"size": [0.1, 0.06, 0.08], "mass": 0.8, "on": "table.shelf", "at": [-0.1, 0.0, 0.0]}},
        "robots": {"panda": {"model": "panda", "position": [0.0, -0.1, 0.6], "hands": {"hand": {"tilt": 100}}}},
    }


def test_motions_are_free_between_their_slices_too_and_end_in_their_switches() -> None:
    scene = read_scene(cabinet(clear=0.3))
    world = World(scene)
    bounds = PathBounds(world, collisions=True)
    phases = bounds.phases(parse_sequence(task_of(scene), ACTIONS))
    constraints = bounds.paths.collision_constraints(phases)
    found = list(
        sampled_motions(phases, world.initial_configuration, lambda part: bounds.problem("sequence", part), constraints)
    )
    assert found
    sequence = bounds.problem("sequence", phases)
    for path, variables in found:
        assert path.shape == (phases.total, world.nq)
        assert ((path >= world.lower - 1e-12) & (path <= world.upper + 1e-12)).all()
        assert constraints.deepest_penetration(path, variables)[0] < 2e-3
        _, equality, inequality = sequence.evaluate(sequence.join(path[phases.ends], variables))
        assert np.abs(equality).max() < 1e-3
        assert inequality.max() < 1e-3


def test_a_box_is_taken_out_from_under_a_board() -> None:
    """The grasp that ignores bodies has a link 9 cm in the board, and no path near it gets out."""
    plan = lgp.plan(read_scene(cabinet(clear=0.3)), cost=None, sequence=ACTIONS)
    assert plan.feasible, plan.reason
    assert plan.audit["faults"] == []


def test_a_given_sequence_whose_time_is_up_is_not_decided() -> None:
    scene = read_scene(cabinet(clear=0.3))
    bounds = PathBounds(World(scene), collisions=True)
    skeleton = parse_sequence(task_of(scene), ACTIONS)
    late = follow(bounds, skeleton, seconds=1e-3)
    assert late.status is SearchStatus.EXHAUSTED
    assert late.bound == 0.0
    says(late.reason, "time limit of 0.001 s", "allow more", "until then", "path: ")
    assert follow(bounds, skeleton).status is SearchStatus.GIVEN


def test_without_room_for_a_hand_there_is_no_plan() -> None:
    plan = lgp.plan(read_scene(cabinet(clear=0.14)), cost=None, sequence=ACTIONS)
    assert not plan.feasible
