"""A run without faults: order, log, scores, commands, and a recording of it watched again."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lgp
import reba
from lgp.errors import LgpError
from lgp.execution.faults import parse_fault
from lgp.execution.log_reader import messages
from lgp.execution.ros_messages import DEFINITIONS
from lgp.execution.server import Address, run_live
from lgp.execution.session import TICK, ExecutionRun, RunOptions, retarget_cost
from lgp.execution.trajectory_export import write_trajectories
from lgp.execution.worker import EXACT, WorkerBehaviour
from lgp.kinematics.posture import PostureMap
from lgp.motion import Motion
from tests.support.execution_plans import kinds, saved, small_plan, went
from tests.support.lgp_worlds import needs_robots
from tests.support.says import says

pytestmark = [pytest.mark.slow, needs_robots]


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], list[Any]]:
    folder = saved(tmp_path_factory.mktemp("run"))
    return folder, *went(folder)


def of_topic(file: Path, topic: str) -> list[dict[str, Any]]:
    return [json.loads(message.data) for message in messages(file) if message.topic == topic]


def decoded(file: Path, topic: str) -> list[Any]:
    """Return the messages of a topic as the official reader decodes them."""
    reader = pytest.importorskip("mcap.reader")
    decoder = pytest.importorskip("mcap_ros2.decoder")
    with file.open("rb") as stream:
        made = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        return [message for _, _, _, message in made.iter_decoded_messages(topics=[topic])]


def test_the_actions_are_done_in_order(ran: tuple[Path, dict[str, Any], list[Any]]) -> None:
    _, summary, events = ran
    assert summary["state"] == "finished"
    assert summary["actions"] == list(small_plan().actions)
    assert kinds(events) == ["started", "ended", "started", "ended", "told", "ended", "finished"]
    assert [event.number for event in events] == list(range(1, 8))
    assert summary["retargeted"] == summary["replanned"] == summary["slowed"] == 0


def test_nobody_is_late_for_an_action_before_its_motion_is_over(ran: tuple[Path, dict[str, Any], list[Any]]) -> None:
    _, _, events = ran
    planned = small_plan().scene.phase_seconds
    for begin, end in zip(events[:-1:2], events[1:-1:2], strict=True):
        assert planned <= end.time - begin.time <= planned + 1.0


def test_the_log_scores_as_the_executed_path_does(tmp_path: Path) -> None:
    """Angles by the posture table of the log, by its joint states and by the configurations themselves agree."""
    folder = saved(tmp_path)
    went(folder, behaviour=WorkerBehaviour(), seed=4)
    states = of_topic(folder / "run.mcap", "/state")
    times, q = np.array([one["time"] for one in states]), np.array([one["q"] for one in states])
    truth = PostureMap(Motion(small_plan()).world).angles(q)
    rows = np.rint(times / TICK).astype(int) - 1
    knees = np.array([column.startswith("knee") for column in reba.COLUMNS])
    for topic in (None, "/human/joint_states"):
        table = reba.read(folder / "run.mcap", topic=topic)
        assert not table.unmeasured
        found = table.data[list(reba.COLUMNS)].to_numpy()[rows]
        # A little beyond the reach of a leg its joints are straight, where the flexion of the posture fades out.
        straight = knees & (found == 0.0) & (truth < 2.0)
        np.testing.assert_allclose(np.where(straight, truth, found), truth, atol=1e-4)
        exact = reba.score_array(truth, {"load": table.data["load"].to_numpy()[rows] if topic is None else 0.0})
        scores = reba.score_array(found, {"load": table.data["load"].to_numpy()[rows] if topic is None else 0.0})
        np.testing.assert_array_equal(scores.reba, exact.reba)


def test_the_load_is_in_the_log(ran: tuple[Path, dict[str, Any], list[Any]]) -> None:
    rows = of_topic(ran[0] / "run.mcap", "/ergonomics/posture")
    mass = small_plan().scene.objects["screwdriver"].mass
    assert rows[0]["load"] == 0.0
    assert {row["load"] for row in rows} <= {0.0, mass}
    scores = reba.score(reba.read(ran[0] / "run.mcap"))
    assert scores.summary()["reba"]["max"] >= 1


def test_predicates_and_plan_are_logged(ran: tuple[Path, dict[str, Any], list[Any]]) -> None:
    log = ran[0] / "run.mcap"
    assert of_topic(log, "/plan")[0]["actions"] == list(small_plan().actions)
    assert of_topic(log, "/scene")[0]["values"] == json.loads(json.dumps(small_plan().scene.values))
    last = of_topic(log, "/predicates")[-1]
    assert last["predicates"] == {"grasped(human.right_hand, screwdriver)": {"holds": True, "why": ""}}


def test_commands_are_trajectories_of_the_robot(ran: tuple[Path, dict[str, Any], list[Any]]) -> None:
    commands = decoded(ran[0] / "run.mcap", "/baxter/trajectory")
    states = decoded(ran[0] / "run.mcap", "/baxter/joint_states")
    assert len(commands) == 3
    assert set(commands[0].joint_names) == set(states[0].name) >= {"left_s0", "right_w2"}
    for command in commands:
        ends = [command.points[at].velocities for at in (0, -1)]
        np.testing.assert_allclose(ends, 0.0, atol=1e-9)
        times = [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in command.points]
        assert (np.diff(times) > 0).all()
        # Positions are where the velocities lead to.
        q, v = np.array([p.positions for p in command.points]), np.array([p.velocities for p in command.points])
        steps = np.diff(times)[:, None] * (v[1:] + v[:-1]) / 2
        np.testing.assert_allclose(np.diff(q, axis=0), steps, atol=2e-3)
    end = dict(zip(states[-1].name, states[-1].position, strict=True))
    final = dict(zip(commands[-1].joint_names, commands[-1].points[-1].positions, strict=True))
    assert end == pytest.approx(final, abs=1e-9)


def test_every_ros_message_is_what_ros_writes(ran: tuple[Path, dict[str, Any], list[Any]]) -> None:
    typestores = pytest.importorskip("rosbags.typesys")
    store = typestores.get_typestore(typestores.Stores.ROS2_HUMBLE)
    logged = [message for message in messages(ran[0] / "run.mcap") if message.encoding == "cdr"]
    assert {message.schema[0] for message in logged} == set(DEFINITIONS)
    for message in logged:
        kind = message.schema[0]
        assert bytes(store.serialize_cdr(store.deserialize_cdr(message.data, kind), kind)) == message.data


def test_the_same_seed_gives_the_same_run(ran: tuple[Path, dict[str, Any], list[Any]], tmp_path: Path) -> None:
    folder = saved(tmp_path)
    _, again = went(folder)
    assert [(e.time, e.text) for e in ran[2]] == [(e.time, e.text) for e in again]
    _, other = went(folder, behaviour=WorkerBehaviour())
    assert [e.time for e in other] != [e.time for e in again]


def test_a_recorded_run_is_followed_again(ran: tuple[Path, dict[str, Any], list[Any]], tmp_path: Path) -> None:
    summary, events = went(saved(tmp_path), replay=ran[0] / "run.mcap")
    assert summary["state"] == "finished"
    assert kinds(events) == kinds(ran[2])


def test_a_recording_without_the_objects_is_refused(tmp_path: Path) -> None:
    from lgp.execution.log import RunLog
    from lgp.execution.ros_messages import TRANSFORMS, transforms_message

    with RunLog(tmp_path / "other.mcap", 1.0, {}) as log:
        log.message("/tf", TRANSFORMS, 0.0, transforms_message(0, {"screw": (np.eye(3), np.zeros(3))}))
    with pytest.raises(lgp.LgpError) as error:
        went(saved(tmp_path / "plan"), replay=tmp_path / "other.mcap")
    says(error, "other.mcap", "'screwdriver'", "screw")


def test_moving_a_motion_is_compared_with_a_new_plan(tmp_path: Path) -> None:
    run = RunOptions(speed=0.0, compare=False, behaviour=EXACT, faults=(parse_fault("moved@1"),))
    session = ExecutionRun(saved(tmp_path), run)
    session.go()
    (retargeted,) = session.executive.retargeted
    comparison = retarget_cost(session.planner, retargeted, 3.0)
    assert comparison["action"].startswith("grasp(1,")
    assert comparison["greedy"] > 0.0
    assert comparison["extra"] == pytest.approx(comparison["greedy"] - comparison["anew"])
    # A hand draws back within an action only, so retargeted motions may cost less than a plan of all of them.
    assert comparison["share"] > -0.5


def test_exported_trajectories_are_the_planned_motion(tmp_path: Path) -> None:
    found = write_trajectories(small_plan(), tmp_path / "robot.mcap")
    assert [row["factor"] for row in found["actions"]] == [1.0] * 3
    assert found["limits"] == []
    rosbags = pytest.importorskip("rosbags.highlevel")
    with rosbags.AnyReader([tmp_path / "robot.mcap"]) as reader:
        connection, _, data = next(reader.messages())
        other = reader.deserialize(data, connection.msgtype)
    command = decoded(tmp_path / "robot.mcap", "/baxter/trajectory")[0]
    assert list(other.joint_names) == list(command.joint_names)
    assert [list(point.positions) for point in other.points] == [list(point.positions) for point in command.points]
    plan = small_plan()
    end = dict(zip(command.joint_names, command.points[-1].positions, strict=True))
    for name, value in end.items():
        assert value == pytest.approx(plan.path[3, plan.joints.index(f"baxter.{name}")])


def test_no_run_loses_a_former_log(tmp_path: Path) -> None:
    folder = saved(tmp_path)
    options = RunOptions(speed=0.0, compare=False, behaviour=EXACT)
    logs = []
    for _ in range(3):
        ExecutionRun(folder, options).go()
        logs.append((folder / "run.mcap").read_bytes())
    former = [(folder / name).read_bytes() for name in ("run-1.mcap", "run-2.mcap")]
    assert former == logs[:2]
    # A run that cannot start, for its port is taken or another is in progress, changes no file.
    running = ExecutionRun(folder, options)
    running.start()
    before = {path.name: path.read_bytes() for path in folder.glob("*.mcap")}
    with pytest.raises(LgpError) as error:
        ExecutionRun(folder, options).go()
    says(error, folder, "in progress", "wait")
    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(LgpError) as error:
        run_live(folder, options, None, Address("127.0.0.1", taken.getsockname()[1]))
    says(error, "cannot listen", "--port")
    running.close()
    assert {path.name: path.read_bytes() for path in folder.glob("*.mcap") if path.name != "run.mcap"} == {
        name: data for name, data in before.items() if name != "run.mcap"
    }
