"""The log of a run: one MCAP file, written in small chunks, so that it is readable up to the moment of a crash.

Topics, times in seconds since the run began plus its first wall-clock time:
    /plan                     JSON  the plan in force, as plan.json holds it
    /scene                    JSON  the scene it is for
    /events                   JSON  what happened (`Event`)
    /predicates               JSON  start or end predicates of the current action, whenever one changes
    /state                    JSON  what a restart needs, see `checkpoint.Checkpoint`
    /comparison               JSON  cost of retargeting against a new plan, see `retarget_cost`
    /ergonomics/posture       JSON  posture angles [deg] and carried load [kg] of the human; `reba score` reads them
    /human/joint_states       sensor_msgs/JointState, joints of human.urdf
    /ergonomics/<name>/posture  JSON  the same of each further person
    /<name>/joint_states      sensor_msgs/JointState of each further person
    /<robot>/joint_states     sensor_msgs/JointState, joints of its URDF
    /<robot>/trajectory       trajectory_msgs/JointTrajectory, each motion as commanded
    /tf                       tf2_msgs/TFMessage: tracked objects and the pelvis (`middle_pelvis`) in `world`
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from lgp.errors import LgpError
from lgp.execution.events import Event
from lgp.execution.predicates import PredicateState
from lgp.execution.ros_messages import (
    DEFINITIONS,
    JOINT_STATE,
    TRAJECTORY,
    TRANSFORMS,
    encode,
    encoder,
    joint_state_message,
    trajectory_message,
    transforms_message,
)
from lgp.execution.tracked_scene import carrier
from lgp.execution.tracking import TrackedWorld
from lgp.execution.trajectory import JointTrajectory
from lgp.kinematics.human import ISB
from lgp.kinematics.posture import PostureMap
from lgp.kinematics.world import World
from lgp.logic.task import Atom
from lgp.motion import human_joints
from lgp.plan_record import Plan
from lgp.scene.model import Scene
from lgp.scene.people import SHORT
from reba.files import as_json, plain_data
from reba.posture.columns import COLUMNS
from reba.provenance import MEMBER, generator, provenance

CHUNK: Final = 16_384
"""[bytes] Size at which a chunk is written: about 0.25 s of a run."""
_TEXT, _WHOLE, _NUMBER = {"type": "string"}, {"type": "integer"}, {"type": "number"}
_TEXTS, _NUMBERS = {"type": "array", "items": _TEXT}, {"type": "array", "items": _NUMBER}
_COSTS = dict.fromkeys(("greedy", "anew", "extra", "share"), _NUMBER)
_AT = {"number": _WHOLE, "time": _NUMBER, "action": _WHOLE}
POSTURE: Final = "/ergonomics/posture"
"""Topic of the first person; those of the others hold the same."""
JSON_SCHEMAS: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "/plan": ("lgp.Plan", {"folder": _TEXT, "digest": _TEXT, "actions": _TEXTS, "columns": _TEXTS, "time": _NUMBERS}),
    "/scene": ("lgp.Scene", {"name": _TEXT}),
    "/events": ("lgp.Event", {**_AT, "state": _TEXT, "kind": _TEXT, "text": _TEXT, "plan": _WHOLE}),
    "/predicates": ("lgp.Predicates", {"time": _NUMBER, "action": _WHOLE}),
    "/state": ("lgp.Checkpoint", {"time": _NUMBER, "q": _NUMBERS, "closed": _TEXTS, "replans": _WHOLE}),
    "/comparison": (
        "lgp.Comparison",
        {"action": _TEXT, **_COSTS, "actions": _TEXTS, "same_actions": {"type": "boolean"}},
    ),
    POSTURE: ("reba.Posture", dict.fromkeys(("time", *COLUMNS, "load"), _NUMBER)),
}
"""Topic -> type and the properties that viewers can show; each has one plain type, see `reba.writers.json_messages`."""


class RunLog:
    """Writer of the log of a run.

    Args:
        file: replaced if it exists.
        epoch: wall-clock time at which the run began [s].
        about: metadata `run`.
        profile: "ros2" where every topic holds ROS 2 messages.

    Raises:
        LgpError: the file cannot be written, or mcap-ros2-support is not installed.
    """

    def __init__(self, file: Path, epoch: float, about: Mapping[str, str], profile: str = "") -> None:
        from mcap.writer import CompressionType, Writer

        encoder(JOINT_STATE)  # a missing package is reported before the file is replaced
        self.epoch, self.file = epoch, file
        try:
            self._stream: IO[bytes] = file.open("wb")
        except OSError as error:
            raise LgpError(f"{file}: cannot be written ({error.strerror or error}); give another folder") from error
        self._writer = Writer(self._stream, chunk_size=CHUNK, compression=CompressionType.ZSTD)
        self._writer.start(profile=profile, library=generator())
        self._writer.add_metadata("run", {**about, MEMBER: as_json(provenance())})
        self._channels: dict[tuple[str, str], int] = {}

    def __enter__(self) -> RunLog:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def json(self, topic: str, time: float, value: Mapping[str, Any], kind: str = "") -> None:
        """Write plain data, without members that have no value, of the kind of a JSON topic: by default its own."""
        name, properties = JSON_SCHEMAS[kind or topic]
        schema = json.dumps({"title": name, "type": "object", "properties": properties})
        channel = self._channel(topic, "json", name, "jsonschema", schema)
        known = {key: item for key, item in plain_data(value).items() if item is not None}
        self.raw(channel, self.stamp(time), as_json(known).encode())

    def message(self, topic: str, kind: str, time: float, value: dict[str, Any]) -> None:
        """Write a ROS 2 message of a type in `ros_messages.DEFINITIONS`."""
        channel = self._channel(topic, "cdr", kind, "ros2msg", DEFINITIONS[kind])
        self.raw(channel, self.stamp(time), encode(kind, value))

    def copy(self, topic: str, encoding: str, schema: tuple[str, str, bytes], stamp: int, data: bytes) -> None:
        """Write a message of another log unchanged."""
        name, kind, text = schema
        self.raw(self._channel(topic, encoding, name, kind, text.decode()), stamp, data)

    def stamp(self, time: float) -> int:
        """Return a time of the run in nanoseconds since 1970."""
        return round((self.epoch + time) * 1e9)

    def raw(self, channel: int, stamp: int, data: bytes) -> None:
        """Write one message."""
        with self._writing():
            self._writer.add_message(channel, stamp, data, stamp)

    def flush(self) -> None:
        """Hand finished chunks to the operating system, so that they survive a crash of the process."""
        with self._writing():
            self._stream.flush()

    def close(self) -> None:
        """Write the last chunk and the summary."""
        if self._stream.closed:
            return
        with self._writing():
            try:
                self._writer.finish()
            finally:
                self._stream.close()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            why = error.strerror or error
            raise LgpError(f"{self.file}: cannot be written ({why}); make room, then run with --resume") from error

    def _channel(self, topic: str, encoding: str, name: str, kind: str, text: str) -> int:
        if (topic, name) not in self._channels:
            schema = self._writer.register_schema(name, kind, text.encode())
            self._channels[topic, name] = self._writer.register_channel(topic, encoding, schema)
        return self._channels[topic, name]


PELVIS = "middle_pelvis"
"""Name of the pelvis frame in ISB axes in the profile human_description of `reba`."""


def joint_topic(scene: Scene, agent: str) -> str:
    """Return the topic of the joints of an agent: the same for the first person, whatever the name."""
    return f"/{SHORT if is_first(scene, agent) else agent}/joint_states"


def is_first(scene: Scene, agent: str) -> bool:
    """Return whether an agent is the first person, whose topics and pelvis frame are the same in every run."""
    return agent == next(iter(scene.humans), None)


class Recorder:
    """Writes observations, events and commands of a run into its log."""

    def __init__(self, log: RunLog, world: World) -> None:
        self.log, self.world = log, world
        self._people = [
            (person, PostureMap(world, person), "" if is_first(world.scene, name) else f"{name}/")
            for name, person in world.scene.humans.items()
        ]
        self._columns = {name: world.columns(name) for name in world.scene.robots}
        self._predicate_states: dict[str, PredicateState] = {}

    def plan(self, time: float, plan: Plan, folder: str) -> None:
        """Write the plan in force from now on, and its scene."""
        steps = {"actions": list(plan.actions), "columns": list(plan.joints), "costs": plan.costs}
        motion = {"time": plan.time, "path": plan.path, "digest": plan.digest}
        self.log.json("/plan", time, {"folder": folder, **steps, **motion})
        self.log.json("/scene", time, {"name": plan.scene.name, "values": plan.scene.values})

    def event(self, event: Event) -> None:
        """Write an event."""
        self.log.json("/events", event.time, event.record())

    def predicates(self, time: float, number: int, states: dict[str, PredicateState]) -> None:
        """Write the states of the predicates of an action if any changed."""
        if states and states != self._predicate_states:
            self._predicate_states = dict(states)
            predicates = {
                name: {"holds": one.holds, "why": "" if one.holds else one.why} for name, one in states.items()
            }
            self.log.json("/predicates", time, {"time": time, "action": number, "predicates": predicates})

    def command(self, time: float, trajectory: JointTrajectory) -> None:
        """Write the motion that is commanded to the robots."""
        for name, columns in self._columns.items():
            message = trajectory_message(self.log.stamp(time), self._joints(name), trajectory, columns)
            self.log.message(f"/{name}/trajectory", TRAJECTORY, time, message)

    def moment(self, view: TrackedWorld, nominal: AbstractSet[Atom]) -> None:
        """Write joints, tracked poses and posture of the last observation.

        The atoms that hold by the plan, `nominal`, decide where a hand is at an object on a table.
        """
        now = view.now
        stamp = self.log.stamp(now.time)
        poses = {name: (at.rotation, at.position) for name, at in now.objects.items() if view.seen(name)}
        for person, posture, prefix in self._people:
            joints = {name: float(values[0]) for name, values in human_joints(self.world, now.q[None], person).items()}
            message = joint_state_message(stamp, list(joints), np.array(list(joints.values())))
            self.log.message(joint_topic(self.world.scene, person.name), JOINT_STATE, now.time, message)
            at = self.world.at(now.q[None], [f"{person.name}.pelvis_tilt"])
            poses[prefix + PELVIS] = at.rotation[0, 0] @ ISB, at.position[0, 0]
            angles = dict(zip(COLUMNS, posture.angles(now.q[None])[0].tolist(), strict=True))
            carried = load(view, nominal, person.name)
            self.log.json(
                f"/ergonomics/{prefix}posture", now.time, {"time": now.time, **angles, "load": carried}, POSTURE
            )
        for name, columns in self._columns.items():
            message = joint_state_message(stamp, self._joints(name), now.q[columns])
            self.log.message(joint_topic(self.world.scene, name), JOINT_STATE, now.time, message)
        self.log.message("/tf", TRANSFORMS, now.time, transforms_message(stamp, poses))
        self.log.flush()

    def _joints(self, robot: str) -> list[str]:
        return [self.world.joints[column].partition(".")[2] for column in self._columns[robot]]


def load(view: TrackedWorld, nominal: AbstractSet[Atom], person: str) -> float:
    """Return the mass that a person holds [kg]."""
    scene = view.world.scene
    hands = {name: carrier(view, name, nominal) for name in scene.objects}
    own = [name for name, hand in hands.items() if hand and scene.hands[hand].agent == person]
    return float(sum(scene.objects[name].mass for name in own))
