"""Two people who hand a rod to each other: planned with and without ergonomics, scored, mirrored, kept and played."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lgp
import reba
from lgp.errors import LgpError
from lgp.execution.replay import Replay
from lgp.execution.simulation import SimulatedRobots
from lgp.kinematics.posture import PostureMap
from lgp.page.page import score_spans
from lgp.path.bounds import PathBounds
from lgp.planner import parse_sequence, task_of
from lgp.scene.scene_file import read_scene
from lgp.search.records import BoundResult
from reba.posture.columns import INDEX
from tests.support.says import says
from tests.support.two_people import two_people

pytestmark = pytest.mark.slow
SEQUENCE = (
    "grasp(anna.right_hand, rod)",
    "handover(anna.right_hand, rod, bert.left_hand)",
    "place(bert.left_hand, rod, table.bert)",
)


def planned(values: dict[str, Any], cost: str | None, sequence: tuple[str, ...] = SEQUENCE) -> lgp.Plan:
    plan = lgp.plan(read_scene(values, "two"), cost=cost, sequence=sequence, collisions=False)
    assert plan.feasible, plan.reason
    return plan


@pytest.fixture(scope="module")
def plan() -> lgp.Plan:
    return planned(two_people(), "convex")


def test_both_are_scored_and_both_scores_are_in_the_cost(plan: lgp.Plan) -> None:
    assert list(plan.people) == ["anna", "bert"]
    expected = {name: reba.score_array(one.angles, {"load": one.carried}).reba for name, one in plan.people.items()}
    for name, scores in expected.items():
        own = plan.reba(person=name)
        assert own is not None
        assert np.array_equal(own.reba, scores)
    assert plan.people["anna"].carried.max() == plan.people["bert"].carried.max() == 1.5
    figures = plan.summary()["reba"]
    assert {name: one["max"] for name, one in figures["people"].items()} == {
        name: int(scores.max()) for name, scores in expected.items()
    }
    assert figures["max"] == max(one["max"] for one in figures["people"].values())
    assert figures["mean"] == pytest.approx(np.mean([one["mean"] for one in figures["people"].values()]))
    ergonomics = lgp.Ergonomics(lgp.World(plan.scene), _model())
    loads = np.stack([one.carried for one in plan.people.values()], axis=1)
    points = ergonomics.value(plan.path, loads) + ergonomics.payload(loads)
    assert plan.costs["ergonomics"] == pytest.approx(float(points @ np.diff(plan.time, prepend=0.0)), rel=1e-6)
    with pytest.raises(LgpError) as error:
        plan.reba(person="ann")
    says(error, "no person 'ann'", "anna")


def _model() -> Any:
    import dreba

    return dreba.load("convex")


def test_ergonomics_make_the_postures_of_both_better(plan: lgp.Plan) -> None:
    plain = planned(two_people(), None)
    assert plain.costs["acceleration"] < plan.costs["acceleration"]
    means = [sum(one["mean"] for one in each.summary()["reba"]["people"].values()) for each in (plan, plain)]
    assert means[0] <= means[1] + 1e-9


def _other_side(value: Any) -> Any:
    text = json.dumps(value).replace("left_", "LEFT_").replace("right_", "left_").replace("LEFT_", "right_")
    return json.loads(text)


def _pose_costs(values: dict[str, Any], sequence: Sequence[str]) -> list[float]:
    """Return the costs of the poses after each action, with both people in them."""
    scene = read_scene(values, "two")
    world = lgp.World(scene)
    bounds = PathBounds(world, lgp.Ergonomics(world, _model()), collisions=False)
    actions = parse_sequence(task_of(scene), sequence)
    results = [BoundResult(True, 0.0)]
    for end in range(len(actions)):
        results.append(bounds.solve("pose", actions[: end + 1], results[-1]))
    return [result.cost for result in results]


def test_the_mirror_image_costs_the_same() -> None:
    values = _other_side(two_people())
    for part in (*values["humans"].values(), *values["tables"].values()):
        x, y = part.get("position", [0.0, 0.0])
        part |= {"position": [x, -y], "yaw": -part.get("yaw", 0.0)}
    costs = _pose_costs(two_people(), SEQUENCE)
    assert np.isfinite(costs).all()
    assert _pose_costs(values, _other_side(SEQUENCE)) == pytest.approx(costs, rel=1e-3)


def test_a_saved_plan_keeps_both(plan: lgp.Plan, tmp_path: Path) -> None:
    plan.save(tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {
        "plan.json", "plan.txt", "path.parquet", "postures.parquet", "postures-bert.parquet",
    }  # fmt: skip
    again = lgp.Plan.load(tmp_path)
    for name, one in plan.people.items():
        assert np.array_equal(again.people[name].angles, one.angles)
        assert np.array_equal(again.people[name].carried, one.carried)
    table = reba.read(tmp_path / "postures-bert.parquet").data
    np.testing.assert_allclose(table["trunk_flexion"], plan.people["bert"].angles[:, 0])
    (tmp_path / "postures-bert.parquet").write_bytes((tmp_path / "path.parquet").read_bytes())
    with pytest.raises(LgpError) as error:
        lgp.Plan.load(tmp_path)
    says(error, tmp_path, "plan again")


def test_the_run_plays_both_and_logs_each(plan: lgp.Plan, tmp_path: Path) -> None:
    plan.save(tmp_path)
    summary = lgp.run_plan(tmp_path)
    assert summary["state"] == "finished", summary["why"]
    topics = {topic["name"] for topic in reba.info(tmp_path / "run.mcap").topics}
    assert {"/human/joint_states", "/ergonomics/posture", "/bert/joint_states", "/ergonomics/bert/posture"} <= topics
    of_first, of_second = (
        reba.read(tmp_path / "run.mcap", topic=topic).data["trunk_flexion"].to_numpy()
        for topic in ("/ergonomics/posture", "/ergonomics/bert/posture")
    )
    with pytest.raises(reba.RebaError) as error:
        reba.read(tmp_path / "run.mcap")
    says(error, "/ergonomics/posture, /ergonomics/bert/posture", "choose one with")
    assert not np.allclose(of_first, of_second, atol=0.5)
    # Joints of both have the same names: a recording is followed by the topics of each.
    world = lgp.World(plan.scene)
    replay = Replay(tmp_path / "run.mcap", world, SimulatedRobots(world, world.initial_configuration, frozenset()))
    replay.time = replay.seconds
    q = replay.observe().q[None]
    for person, recorded in zip(world.scene.humans.values(), (of_first, of_second), strict=True):
        assert PostureMap(world, person).angles(q)[0, INDEX["trunk_flexion"]] == pytest.approx(recorded[-1], abs=0.1)


def test_the_page_has_the_scores_and_the_sentences_of_both(plan: lgp.Plan) -> None:
    from lgp.page.sentences import sentences

    assert list(score_spans(plan)) == ["anna", "bert"]
    lines = sentences(plan.scene, lgp.Motion(plan).phases.switches)
    assert [line.who for line in lines] == ["Anna", "Anna", "Bert"]
    assert lines[1].text == "Anna, hand over the rod to Bert's left hand with your right hand."
