"""Plans from scene to files: search, record, command line, drawing, and what is said when there is none."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import lgp
import reba
from lgp.cli import cli
from lgp.kinematics.world import World
from lgp.logic.pddl import SHIPPED
from lgp.planner import parse_sequence, task_of
from lgp.scene.scene_file import read_scene
from lgp.search.tree_figure import draw
from reba.provenance import parquet_provenance
from tests.support.invoke import invoke
from tests.support.lgp_worlds import HUMAN_ONLY, needs_robots, screwdriver_world
from tests.support.robot_files import URDF
from tests.support.says import says

pytestmark = pytest.mark.slow


HEIGHTS = {"left": 1.0, "center": 0.9, "right": 1.1}
SEQUENCE = """# the paper's example
grasp(1, baxter.right, screwdriver)
place(2, baxter.right, screwdriver, table.center)

grasp(human.right_hand, screwdriver)
"""


CELL = """
domain = "own.pddl"
initial = ["on_table(box)", "free(human.right_hand)", "free(arm.hand)"]
goal = ["grasped(human.right_hand, box)"]
[human]
[robots.arm]
model = "robots/arm.urdf"
position = [2.0, 0.0, 0.0]
hands.hand = { frame = "hand" }
[tables.near]
position = [0.5, 0.0]
size = [0.4, 0.6]
height = 0.9
[objects.box]
size = [0.1, 0.06, 0.12]
mass = 0.5
on = "table.near"
"""


def human_scene(**changes: object) -> lgp.Scene:
    """A human alone with a box in reach."""
    scene = {**HUMAN_ONLY, "initial": ["on_table(box)", "free(human.right_hand)", "free(human.left_hand)"]}
    return read_scene(scene | changes)


@pytest.fixture(scope="module")
def planned() -> lgp.Plan:
    return lgp.plan(human_scene(), slices=5)


def test_a_human_takes_a_box(planned: lgp.Plan) -> None:
    assert planned.feasible
    assert planned.status == "optimal"
    assert planned.actions == ("grasp(1, human.right_hand, box)",)
    assert planned.path.shape == (5, len(planned.joints))
    assert planned.time.tolist() == pytest.approx([0.4, 0.8, 1.2, 1.6, 2.0])
    terms = [planned.costs[term] for term in ("acceleration", "ergonomics", "time")]
    assert planned.costs["total"] == pytest.approx(sum(terms))
    assert planned.costs["time"] == pytest.approx(planned.weights["time"] * planned.time[-1])
    assert planned.costs["ergonomics"] > 0.0
    assert max(planned.residuals.values()) <= 1e-6
    scores = planned.reba()
    assert scores is not None
    expected = reba.score_array(planned.posture).reba
    assert np.array_equal(scores.reba, expected)
    with pytest.raises(AttributeError):
        planned.status = "other"  # type: ignore[misc]


def test_a_plan_survives_its_files(planned: lgp.Plan, tmp_path: Path) -> None:
    planned.save(tmp_path / "plan")
    again = lgp.Plan.load(tmp_path / "plan")
    assert again.summary() == planned.summary()
    assert np.array_equal(again.path, planned.path)
    assert np.array_equal(again.posture, planned.posture)
    assert again.variables == planned.variables
    assert again.provenance == {"version": reba.__version__}
    former = replace(planned, provenance={"version": "0.0.9"})
    former.save(tmp_path / "former")
    lgp.Plan.load(tmp_path / "former").save(tmp_path / "former")  # who saves a plan did not compute it
    assert json.loads((tmp_path / "former" / "plan.json").read_text())["provenance"] == former.provenance
    assert parquet_provenance(tmp_path / "former" / "path.parquet") == former.provenance
    table = reba.read(tmp_path / "plan" / "postures.parquet")
    assert table.data["trunk_flexion"].to_numpy() == pytest.approx(planned.posture[:, 0])
    text = (tmp_path / "plan" / "plan.json").read_text()
    for damage, *facts in (
        (text.replace('"lgp-plan"', '"other"'), "not a plan"),
        (text.replace('"version": 1', '"version": 99'), "version is 99"),
        (text.replace('"costs"', '"prices"'), "'costs' is missing"),
        (text.replace('"interpolation": "cubic', '"interpolation": "linear'), "between slices", "plan again"),
        ("{", "cannot be read"),
    ):
        (tmp_path / "plan" / "plan.json").write_text(damage)
        with pytest.raises(lgp.LgpError) as error:
            lgp.Plan.load(tmp_path / "plan")
        says(error, *facts)


def test_ergonomics_lowers_what_it_weighs() -> None:
    scene = human_scene()
    without, with_ = lgp.plan(scene, cost=None, slices=5), lgp.plan(scene, slices=5)
    assert without.costs["ergonomics"] == 0.0
    assert without.costs["acceleration"] < with_.costs["acceleration"]


def test_out_of_reach_says_what_fails() -> None:
    far = {"near": {**HUMAN_ONLY["tables"]["near"], "position": [1.9, 0.1]}}  # type: ignore[index]
    found = lgp.plan(human_scene(tables=far), cost=None, slices=5)
    assert not found.feasible
    assert found.status == "infeasible"
    assert "phase 1, grasp(1, human.right_hand, box): human.right_hand cannot reach" in found.reason
    assert "box on table.near" in found.reason
    assert found.reba() is None


def test_a_goal_that_nothing_reaches_names_the_precondition() -> None:
    found = lgp.plan(human_scene(initial=["on_table(box)"]), cost=None)
    assert found.status == "unreachable"
    assert "free(human.right_hand)" in found.reason


@needs_robots
def test_plan_of_the_screwdriver_from_the_command_line(tmp_path: Path) -> None:
    heights = [word for name, height in HEIGHTS.items() for word in ("--height", f"{name}={height}")]
    tree = tmp_path / "tree.svg"
    arguments = ["plan", "screwdriver", *heights, "--json", "-o", str(tmp_path / "plan"), "--tree", str(tree)]
    done = invoke(cli, arguments, catch_exceptions=False)
    result = json.loads(done.stdout)
    assert result["feasible"] is True
    assert result["actions"][0] == "grasp(1, baxter.right, screwdriver)"
    assert result["actions"][-1] == "grasp(3, human.right_hand, screwdriver)"
    assert set(result["cost"]) == {"total", "acceleration", "ergonomics", "time", "terms", "actions"}
    assert len(result["reba"]["per_phase"]) == 3
    assert max(result["residuals"].values()) <= 1e-6
    assert {"expanded", "poses", "sequences", "paths", "seconds"} <= set(result["search"])
    assert result["output"] == str(tmp_path / "plan")
    drawn = ElementTree.parse(tree).getroot()
    words = " ".join(drawn.itertext())
    assert "place(2, baxter.right, screwdriver, table.center)" in words
    assert "human.right_hand cannot reach" in words
    assert list(pd.read_parquet(tmp_path / "plan" / "path.parquet").columns[:2]) == ["time", "phase"]


@needs_robots
def test_a_given_sequence_is_followed() -> None:
    scene = lgp.load_scene("screwdriver").with_heights(HEIGHTS)
    found = lgp.plan(scene, cost=None, sequence=SEQUENCE.splitlines(), slices=8, world=screwdriver_world())
    assert found.actions[1] == "place(2, baxter.right, screwdriver, table.center)"
    assert found.search["paths"] == 1
    # No other sequence was looked at, so nothing is said of the optimum.
    assert (found.status, found.search["bound"], found.search["gap"]) == ("given", 0.0, 1.0)
    bad = ["grasp(1, baxter.left, screwdriver)", *SEQUENCE.splitlines()[2:]]
    with pytest.raises(lgp.LogicError) as error:
        lgp.plan(scene, cost=None, sequence=bad, world=screwdriver_world())
    says(error, "is not applicable", "needs grasped", "correct the sequence")


def test_sequences_are_checked() -> None:
    task = task_of(human_scene())
    assert [str(action) for action in parse_sequence(task, ["grasp(1, human.right_hand, box)"])] == [
        "grasp(human.right_hand, box)"
    ]
    with pytest.raises(lgp.LogicError) as error:
        parse_sequence(task, ["grasp(1, human.left_hand, box)"])
    says(error, "goal is not satisfied", "add the missing actions")
    with pytest.raises(lgp.LogicError) as error:
        parse_sequence(task, ["grasp(1, human.right_hand, bix)"])
    says(error, "does not exist")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["plan", "screwdriwer"], "screwdriver"),
        (["plan", "screwdriver", "--cost", "nothing.json"], "cannot be read"),
        (["plan", "screwdriver", "--cost", "quadratic", "--no-ergonomics"], "leave one"),
        (["plan", "screwdriver", "--height", "left"], "TABLE=METRES"),
        (["plan", "screwdriver", "--height", "top=1"], "no table"),
        (["plan", "screwdriver", "--sequence", "nothing.txt"], "cannot be read"),
        (["plan", "screwdriver", "--sequence", "x", "--tree", "y.svg"], "is not searched"),
        (["plan", "screwdriver", "--sequence", "x", "--depth", "3"], "is not searched"),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], message: str) -> None:
    done = invoke(cli, arguments)
    assert isinstance(done.exception, reba.RebaError)
    assert message in str(done.exception)
    assert "\n" not in str(done.exception)


def test_a_goal_that_holds_is_an_empty_plan(tmp_path: Path) -> None:
    for goal in (["on_table(box)"], []):
        found = lgp.plan(human_scene(goal=goal), cost=None)
        assert (found.feasible, found.status, found.actions, found.costs["total"]) == (True, "optimal", (), 0.0)
    lgp.plan(human_scene(goal=[]), cost=None, sequence=[]).save(tmp_path)
    assert lgp.Plan.load(tmp_path).status == "given"


def test_paths_of_a_scene_start_from_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, elsewhere = tmp_path / "cell", tmp_path / "elsewhere"
    for place in (folder / "robots", elsewhere):
        place.mkdir(parents=True)
    domain = (SHIPPED / "screwdriver.pddl").read_text(encoding="utf-8")
    (folder / "own.pddl").write_text(domain, encoding="utf-8")
    (folder / "robots" / "arm.urdf").write_text(URDF, encoding="utf-8")
    (folder / "cell.toml").write_text(CELL, encoding="utf-8")
    monkeypatch.chdir(elsewhere)
    scene = lgp.load_scene("../cell/cell.toml")
    found = lgp.plan(scene, cost=None, slices=4, collisions=False)
    assert found.feasible
    found.save(tmp_path / "plan")
    monkeypatch.chdir(tmp_path)
    again = lgp.Plan.load("plan").scene
    assert "arm.turn" in World(again).joints
    assert task_of(again).domain.name == task_of(human_scene()).domain.name


def test_bad_starts_are_refused() -> None:
    beyond = World(human_scene()).upper + 0.1
    with pytest.raises(lgp.LgpError) as error:
        lgp.plan(human_scene(), cost=None, start=beyond)
    says(error, "starts at", "expected", "start")
    with pytest.raises(lgp.LgpError) as error:
        lgp.plan(human_scene(), cost=None, start=np.zeros(3))
    says(error, "start has shape")


def test_drawing_holds_every_node_once(planned: lgp.Plan) -> None:
    root = ElementTree.fromstring(draw(planned.tree, planned.tree[1].skeleton))
    boxes = root.findall(".//{http://www.w3.org/2000/svg}rect")
    assert len(boxes) == len(planned.tree)


@needs_robots
def test_time_is_not_rewarded() -> None:
    """A crate is brought in two actions, also where four fit: putting it down on the way only adds time."""
    tables = {side: {"position": [0.6, y], "size": [0.3, 0.3], "height": 0.8} for side, y in (("a", 0.3), ("b", -0.3))}
    values = {
        "domain": "screwdriver",
        "initial": ["on_table(crate)", "free(human.right_hand)", "free(baxter.left)", "free(baxter.right)"],
        "goal": ["placed(crate, table.b)"],
        "human": {"tilt": 100},
        "robots": {"baxter": {"model": "baxter", "position": [1.2, 0.0], "yaw": 180}},
        "tables": tables,
        "objects": {"crate": {"size": [0.2, 0.08, 0.15], "mass": 0.2, "on": "table.a"}},
    }
    plans = {
        (depth, weight): lgp.plan(read_scene(values).with_time_weight(weight), depth=depth, collisions=False, slices=6)
        for depth, weight in ((2, 0.2), (4, 0.2), (4, 0.0))
    }
    assert plans[4, 0.2].actions == plans[2, 0.2].actions
    assert plans[4, 0.2].costs["time"] == pytest.approx(0.2 * 4.0)
    # Without a cost of time the same scene is delivered in four actions.
    assert len(plans[4, 0.0].actions) == 4
