"""Targets of fuzzing: for each reader and loader its seeds, its mutations, and the use of the file."""

from __future__ import annotations

import random
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import mutate
import planner_seeds
import seeds


@dataclass(frozen=True)
class Target:
    """One reader or loader.

    Attributes:
        name: of the target.
        file: name of the input file.
        make: returns the valid seeds.
        mutation: damages one of them.
        use: reads the file and uses it as a command would; raises the errors of the reader.
    """

    name: str
    file: str
    make: Callable[[], list[bytes]]
    mutation: mutate.Mutation
    use: Callable[[Path], object]

    @cached_property
    def seeds(self) -> list[bytes]:
        """Valid inputs."""
        return self.make()

    def input(self, seed: int, number: int) -> bytes:
        """Input `number` of a seed; the first ones are the valid seeds themselves."""
        if number < len(self.seeds):
            return self.seeds[number]
        rng = random.Random(zlib.crc32(self.name.encode()) + (seed << 32) + (number << 64))
        return self.mutation(rng, rng.choice(self.seeds), self.seeds)


def read(path: Path) -> object:
    """Decode every stream of a recording, then read it as postures and score them."""
    import reba
    from reba.readers.formats import open_recording

    for stream in open_recording(path).streams:
        for _ in stream.blocks():
            pass
        if stream.table is not None:
            stream.table()
    return reba.score(reba.read(path), load=3.0).summary()


def load_idl(path: Path) -> object:
    from reba.errors import ReadError
    from reba.readers.mcap import idl
    from reba.readers.mcap.ros import BadSchema

    text = path.read_bytes().decode(errors="replace")
    name = "a::All" if "All" in text else "sensor_msgs/msg/JointState"
    try:
        return idl.parse(text, name)
    except BadSchema as error:  # the reason why a topic is not used
        raise ReadError(path, str(error)) from error


def load_rules(path: Path) -> object:
    import reba

    return reba.score_array([[0.0] * 22], None, reba.Rules.load(path))


def load_error(path: Path) -> object:
    import reba

    return reba.score_array([[0.0] * 22], error=reba.MeasurementError.of(path))


def load_profile(path: Path) -> object:
    from reba.readers.recording.profile import load_profile

    return load_profile(path).slots


def load_domain(path: Path) -> object:
    import dreba

    domain = dreba.domain_of(path)
    return dreba.Domain.from_dict(domain.to_dict()), [domain.bins_of(column) for column in domain.columns]


def load_model(path: Path) -> object:
    import dreba

    model = dreba.load(path)
    return model.value([5.0] * len(model.joints_)), model.gradient([5.0] * len(model.joints_))


def load_poses(path: Path) -> object:
    import dreba

    return dreba.Poses.load(path)


def load_scene(path: Path) -> object:
    import lgp
    from lgp.planner import task_of

    return task_of(lgp.load_scene(path))


def load_pddl(path: Path) -> object:
    from lgp.logic.pddl import load_domain

    return load_domain(path)


def load_plan(path: Path) -> object:
    import lgp

    if not (path.parent / "postures.parquet").exists() or path.name == "path.parquet":
        data = path.read_bytes()
        planner_seeds.write_plan(path.parent)
        path.write_bytes(data)
    return lgp.Plan.load(path.parent).summary()


def load_study(path: Path) -> object:
    from lgp.study.labels import read_manifest

    return read_manifest(path)


def load_dataset(path: Path) -> object:
    from reba.batch.dataset import Dataset

    with Dataset(path.parent) as dataset:
        return [dataset.manifest.line(entry) for entry in dataset.manifest.entries.values()]


def load_robot(path: Path) -> object:
    from lgp.kinematics.robot import robot_model
    from lgp.page.objects import robot_meshes
    from lgp.scene.model import Robot

    robot = Robot("r", (0.0, 0.0, 0.0), 0.0, (), (), {}, str(path))
    return robot_model(robot).model.njoints, len(robot_meshes(robot))


def load_mesh(path: Path) -> object:
    from lgp.kinematics.mesh_file import read_mesh
    from lgp.page.objects import reduced

    return reduced([(vertices, faces, planner_seeds.GREY) for vertices, faces, _ in read_mesh(path)])


def load_runs(path: Path) -> object:
    from lgp.experiments.runs import RunStore

    return RunStore(path.parent, {"seed": 0}).finish()


def load_log(path: Path) -> object:
    from lgp.execution.log_reader import interrupted_run

    run = interrupted_run(path)
    return run.check(*planner_seeds.plan_and_world(), simulated=True)


TARGETS: dict[str, Target] = {
    target.name: target
    for target in (
        Target("mcap", "fuzz.mcap", seeds.mcap, mutate.mutate_mcap, read),
        Target("bag", "fuzz.bag", seeds.bags, mutate.mutate_bytes, read),
        Target("db3", "fuzz.db3", seeds.databases, mutate.mutate_bytes, read),
        Target("idl", "fuzz.idl", seeds.definitions, mutate.mutate_text, load_idl),
        Target("c3d", "fuzz.c3d", seeds.c3d, mutate.mutate_bytes, read),
        Target("bvh", "fuzz.bvh", seeds.bvh, mutate.mutate_text, read),
        Target("opensim", "fuzz.mot", seeds.opensim, mutate.mutate_text, read),
        Target("trc", "fuzz.trc", seeds.trc, mutate.mutate_text, read),
        Target("mvnx", "fuzz.mvnx", seeds.mvnx, mutate.mutate_text, read),
        Target("csv", "fuzz.csv", seeds.table, mutate.mutate_text, read),
        Target("parquet", "fuzz.parquet", seeds.parquet, mutate.mutate_bytes, read),
        Target("smpl", "fuzz.npz", seeds.smpl, mutate.mutate_zip, read),
        Target("xlsx", "fuzz.xlsx", seeds.xlsx, mutate.mutate_zip, read),
        Target("gzip", "fuzz.csv.gz", seeds.packed, mutate.mutate_gzip, read),
        Target("rules", "fuzz.toml", seeds.rules, mutate.mutate_text, load_rules),
        Target("error", "fuzz.toml", seeds.errors, mutate.mutate_text, load_error),
        Target("profile", "fuzz.toml", seeds.profiles, mutate.mutate_text, load_profile),
        Target("dataset", "_manifest.jsonl", seeds.datasets, mutate.mutate_json_lines, load_dataset),
        Target("domain", "fuzz.toml", seeds.domains, mutate.mutate_text, load_domain),
        Target("model", "fuzz.json", seeds.models, mutate.mutate_json, load_model),
        Target("poses", "fuzz.parquet", seeds.poses, mutate.mutate_bytes, load_poses),
        Target("scene", "fuzz.toml", planner_seeds.scenes, mutate.mutate_text, load_scene),
        Target("pddl", "fuzz.pddl", planner_seeds.pddl, mutate.mutate_text, load_pddl),
        Target("plan", "plan.json", planner_seeds.plans, mutate.mutate_json, load_plan),
        Target("motion", "path.parquet", planner_seeds.motions, mutate.mutate_bytes, load_plan),
        Target("study", "study.csv", seeds.study, mutate.mutate_text, load_study),
        Target("robot", "fuzz.urdf", planner_seeds.robots, mutate.mutate_text, load_robot),
        Target("dae", "fuzz.dae", planner_seeds.dae, mutate.mutate_text, load_mesh),
        Target("stl", "fuzz.stl", planner_seeds.stl, mutate.mutate_bytes, load_mesh),
        Target("log", "run.mcap", planner_seeds.logs, mutate.mutate_mcap, load_log),
        Target("runs", "unfinished.jsonl", planner_seeds.runs, mutate.mutate_json_lines, load_runs),
    )
}
"""Every target by name."""
