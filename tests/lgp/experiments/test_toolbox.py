"""The toolbox: geometry of a planned sequence, orders and their costs, the report."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import lgp
from lgp.experiments import published
from lgp.experiments.toolbox import CONDITIONS, Condition, scores_of, summarise_toolbox, write_tables
from lgp.experiments.toolbox_orders import GRASP_FIRST, ORDERS, PLACE_FIRST, cost_terms, order_of
from lgp.experiments.toolbox_report import write_page
from lgp.experiments.variants import variants
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import World
from lgp.motion import Motion
from lgp.path.bounds import PathBounds
from lgp.path.cache import WarmStartCache
from lgp.path.phases import Phases
from lgp.planner import parse_sequence, task_of
from reba.provenance import parquet_provenance, provenance
from tests.support.lgp_worlds import needs_robots

pytestmark = pytest.mark.slow


HANDLE, SIDE = "toolbox/handle", "toolbox/side.left"


def paper(condition: str) -> list[str]:
    """The paper's sequence, its last line as its operator means it."""
    *before, _ = published.TOOLBOX_SEQUENCES[condition]
    return [*before, f"screw(8, human.right_hand, {HANDLE}, {SIDE})"]


@cache
def planned() -> lgp.Plan:
    return lgp.plan("toolbox", cost=None, sequence=paper("ergonomic"), slices=3, collisions=False)


def test_the_scene_says_why_it_is_as_it_is() -> None:
    for name in ("toolbox", "toolbox_full"):
        scene = lgp.load_scene(name)
        assert task_of(scene).objects["baxter.left"] == "vacuum_gripper"
        assert all(choice.reason and choice.keys for choice in scene.choices)
    # 18 mm plywood of 680 kg/m3.
    for thing in scene.objects.values():
        assert thing.mass == pytest.approx(680.0 * np.prod(thing.size), abs=0.02)


def test_orders_are_those_of_the_paper() -> None:
    task = task_of(lgp.load_scene("toolbox"))
    orders = [order_of(parse_sequence(task, paper(name))) for name in CONDITIONS]
    assert orders == [GRASP_FIRST, PLACE_FIRST]
    assert order_of(parse_sequence(task, paper("ergonomic"))[:2]) == ""


@needs_robots
def test_a_planned_sequence_keeps_its_geometry() -> None:
    found = planned()
    assert found.feasible, found.reason
    assert max(found.residuals[name] for name in ("equality", "inequality")) <= 1e-6
    motion = Motion(found)
    poses = motion.frames(["baxter.left", "baxter.right", "human.right_hand"])
    handle, side = motion.object_poses(HANDLE), motion.object_poses(SIDE)
    last = {step: int(np.flatnonzero(motion.phase == step)[-1]) for step in range(8)}

    def grip(thing: str, kind: str, at: int) -> np.ndarray:
        pose = motion.object_poses(thing)
        return pose.position[at] + pose.rotation[at] @ motion.plan.scene.objects[thing].grips[kind].at

    # Both hands are on the handle at the handover: the cup on its middle, the palm along its upper edge.
    at = last[1]
    np.testing.assert_allclose(poses["baxter.left"].position[at], grip(HANDLE, "vacuum_gripper", at), atol=1e-6)
    away = handle.rotation[at].T @ (poses["human.right_hand"].position[at] - grip(HANDLE, "human_hand", at))
    np.testing.assert_allclose(away[1:], 0.0, atol=1e-6)
    assert abs(away[0]) <= 0.05 + 1e-6
    # What changes hands does not jump: the next slice starts from where the last one held it.
    steps = np.linalg.norm(np.diff(handle.position, axis=0), axis=1)
    assert steps[last[6] :].max() == pytest.approx(0.0, abs=1e-6)
    # The gripper that holds stays on the upper edge and still.
    held = slice(last[6], last[7] + 1)
    assert np.ptp(poses["baxter.right"].position[held], axis=0).max() < 1e-6
    np.testing.assert_allclose(
        poses["baxter.right"].position[last[6]], grip(HANDLE, "parallel_gripper", last[6]), atol=1e-6
    )
    # At the end the parts stand as joined, and the fingers point along the screw.
    joint = motion.plan.scene.assemblies[0]
    where = handle.position[-1] + handle.rotation[-1] @ joint.position
    np.testing.assert_allclose(side.position[-1], where, atol=1e-6)
    along = handle.rotation[-1] @ joint.along
    np.testing.assert_allclose(poses["human.right_hand"].rotation[-1][:, 0], along, atol=1e-5)


@needs_robots
def test_cost_terms_add_up() -> None:
    terms = cost_terms(planned(), 0.0)
    agents = [value for name, value in terms.items() if name.startswith("acceleration of")]
    assert sum(agents) == pytest.approx(terms["acceleration"], rel=1e-9)
    # The handle is carried in phase 3, the side in phase 6, 2 s each.
    assert terms["carried"] == pytest.approx(2.0 * (1.06 + 0.43))


@needs_robots
def test_light_parts_have_no_weight_in_true_scores() -> None:
    scores = scores_of(planned())
    assert scores["parts"]["load_force"] == 0.0
    assert scores["load_points"] == pytest.approx((1.06 + 0.43) / 8.0 / 5.0)


@needs_robots
def test_the_page_shows_both_sequences(tmp_path: Path) -> None:
    plan = planned()
    common = {"reason": "", "verdict": "solved"}
    visited = [
        common | {"actions": list(plan.actions), "order": PLACE_FIRST, "sequence": 1.0, "path": 2.0},
        common
        | {"actions": paper("non-ergonomic"), "order": GRASP_FIRST, "sequence": 3.0, "path": None}
        | {"verdict": "pruned", "reason": "cannot beat the best path"},
    ]
    conditions = dict.fromkeys(CONDITIONS, Condition(plan, visited, dict.fromkeys(ORDERS, plan), [plan.costs["total"]]))
    weights = [{"weight": 1.0, "order": order, **cost_terms(plan)} for order in ORDERS]
    settings = {"scene": plan.scene.name, "collisions": False}
    summary = summarise_toolbox(conditions, plan.scene, settings, weights)
    chosen = variants()["ours"]
    write_page(tmp_path, summary, dict.fromkeys(CONDITIONS, plan), plan.scene, chosen, "lgp experiment toolbox -o DIR")
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    words = re.sub(r"<[^>]+>", " ", html)
    assert "handover(2, baxter.left, handle, human.right_hand)" in words
    assert "cannot beat the best path" in words
    assert "lgp experiment toolbox -o DIR" in words
    assert "://" not in html.replace("http://www.w3.org/2000/svg", "")
    assert summary["conditions"]["ergonomic"]["order"] == PLACE_FIRST
    write_tables(tmp_path, summary, conditions, plan.scene)
    assert parquet_provenance(tmp_path / "runs.parquet") == provenance()
    assert json.loads((tmp_path / "summary.json").read_text())["provenance"] == provenance()


@needs_robots
def test_other_orders_start_from_the_best_motion_of_the_same_actions() -> None:
    world = World(lgp.load_scene("toolbox"))
    task = task_of(world.scene)
    first, second = (Phases.of(world.scene, parse_sequence(task, paper(name))) for name in CONDITIONS)
    memory = WarmStartCache(world)
    assert memory.initial_guess(second, world.initial_configuration) is None
    rng = np.random.default_rng(0)
    keys = rng.uniform(world.lower, world.upper, (first.count, world.nq))
    size = ModeSequence(world, first.switches).size
    variables = rng.uniform(-1.0, 1.0, size)
    memory.store_motion(first, 2.0, keys, variables)
    memory.store_motion(first, 3.0, keys * 0.0, variables)
    found = memory.initial_guess(second, world.initial_configuration)
    assert found is not None
    left = np.flatnonzero(world.support("baxter.left"))
    # Its grasp of the side is third in one order and fourth in the other; before it the arm is on its way there.
    np.testing.assert_allclose(found[0][3][left], keys[2][left])
    np.testing.assert_allclose(found[0][2][left], (keys[1][left] + keys[2][left]) / 2.0)
    assert sorted(found[1].tolist()) == sorted(variables.tolist())
    names = [
        dict(zip(ModeSequence(world, phases.switches).names, values, strict=True))
        for phases, values in ((first, variables), (second, found[1]))
    ]
    assert names[0][f"3.{HANDLE}.yaw"] == names[1][f"2.{HANDLE}.yaw"]


@needs_robots
def test_poses_are_known_whatever_came_before() -> None:
    bounds = PathBounds(World(lgp.load_scene("toolbox")), slices=3)
    task = task_of(bounds.world.scene)
    far = [task.action(f"grasp(human.right_hand, {part})") for part in (SIDE, HANDLE)]
    near = task.action(f"hold(baxter.right, {HANDLE})")
    alone = bounds.solve("pose", (far[0],), None)
    assert not alone.feasible
    assert alone.reason.startswith("phase 1, grasp(1, human.right_hand")
    later = bounds.solve("pose", (near, far[0]), None)
    assert later.reason.startswith("phase 2, grasp(2, human.right_hand")
    assert not bounds.solve("pose", (far[1],), None).feasible
