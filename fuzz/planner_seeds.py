"""Small valid inputs of the planner: scenes, domains, plans, journals of experiments, logs of runs, robots, meshes."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from seeds import shipped

HUMAN_ONLY = """
domain = "screwdriver"
initial = ["on_table(box)", "free(human.right_hand)"]
goal = ["grasped(human.right_hand, box)"]
[human]
hands = ["right_hand"]
position = [0.0, 0.1]
stature = 1.7
[tables.near]
position = [0.5, 0.1]
size = [0.6, 0.4]
height = 0.8
[objects.box]
size = [0.3, 0.1, 0.2]
mass = 2.0
on = "table.near"
"""


def scenes() -> list[bytes]:
    """All that come with `lgp`, and a human alone."""
    return [HUMAN_ONLY.encode(), *shipped("lgp/scenes/*.toml")]


def pddl() -> list[bytes]:
    """All domains that come with `lgp`."""
    return shipped("lgp/domains/*.pddl")


def write_plan(folder: Path) -> None:
    import tomllib

    from lgp.plan_record import PersonPostures, Plan
    from lgp.scene.scene_file import read_scene
    from reba.posture.columns import COLUMNS

    scene = read_scene(tomllib.loads(scenes()[0].decode()), "lift")
    Plan(
        scene=scene,
        feasible=True,
        status="optimal",
        reason="",
        joints=("a", "b"),
        start=np.zeros(2),
        search={"expanded": 1, "seconds": 0.5, "gap": float("inf"), "levels": {"pose": {"solved": 2}}},
        actions=("grasp(1, human.right_hand, box)",),
        time=np.arange(3.0),
        phase=np.zeros(3, np.intp),
        path=np.zeros((3, 2)),
        variables={"box.x": 0.1},
        people={"human": PersonPostures(np.full((3, len(COLUMNS)), 5.0), np.zeros(3))},
        costs={"total": 1.0, "acceleration": 0.5, "ergonomics": 0.5},
        residuals={"equality": 1e-9, "inequality": 0.0},
        solver={"status": "solved", "iterations": 3},
    ).save(folder)


def logs() -> list[bytes]:
    """The log of a run that stopped in the only action of the plan."""
    from lgp.execution.checkpoint import Checkpoint
    from lgp.execution.events import Event
    from lgp.execution.log import RunLog
    from lgp.execution.simulation import Placement

    plan, world = plan_and_world()
    box = {"box": Placement("human.right_hand", np.eye(3), np.zeros(3))}
    with TemporaryDirectory() as folder:
        file = Path(folder) / "run.mcap"
        with RunLog(file, 1.7e9, {"plan": "lift", "seed": "0"}) as log:
            log.json("/plan", 0.0, {"folder": ".", "digest": plan.digest})
            log.json("/events", 0.0, Event(1, 0.0, 0, "running", "started", "Grasp.").record())
            log.json("/state", 0.25, Checkpoint(1.7e9, 0.25, np.zeros(world.nq), frozenset(), box, 0, ".", 0).record())
        return [file.read_bytes()]


@cache
def plan_and_world() -> tuple[Any, Any]:
    """Return the plan of `write_plan` and its world."""
    from lgp.kinematics.world import World
    from lgp.plan_record import Plan

    with TemporaryDirectory() as folder:
        write_plan(Path(folder))
        plan = Plan.load(folder)
    return plan, World(plan.scene)


def _of_plan(name: str) -> bytes:
    with TemporaryDirectory() as folder:
        write_plan(Path(folder))
        return (Path(folder) / name).read_bytes()


def plans() -> list[bytes]:
    """The `plan.json` of a plan of one action."""
    return [_of_plan("plan.json")]


def motions() -> list[bytes]:
    """The `path.parquet` of the same plan."""
    return [_of_plan("path.parquet")]


def runs() -> list[bytes]:
    """The journal of an experiment: an infeasible and a feasible run."""
    from lgp.experiments.runs import CONDITIONS, PATH_COLUMNS, RUN_COLUMNS, TABLES
    from reba.provenance import with_provenance

    def cell(kind: str, number: int) -> object:
        return {"int64": number, "float64": 1.0 + number / 10, "bool": True}.get(kind, "")

    lines = []
    for number in range(2):
        row = {name: [cell(kind, number)] for name, kind in RUN_COLUMNS.items()}
        row |= {"condition": [CONDITIONS[0]], "table": [TABLES[0]], "initial": ["rest"]}
        path = {name: [cell(kind, number)] for name, kind in PATH_COLUMNS.items()}
        path |= {"condition": [CONDITIONS[0]], "initial": ["rest"], "reba": [3.0], "slice": [0], "phase": [0]}
        lines.append(json.dumps(with_provenance({"runs": row, "paths": path})) + "\n")
    return ["".join(lines).encode()]


GREY = np.array([120, 120, 120], np.uint8)
"""Colour of meshes without one."""


def robots() -> list[bytes]:
    """A base with a sliding and a turning joint and every simple shape, and an arm without shapes."""
    from tests.support.robot_files import URDF, arm

    return [URDF.encode(), arm(3).encode()]


def dae() -> list[bytes]:
    """A tetrahedron, used once and by nodes that use each other."""
    from tests.support.robot_files import DAE, DAE_NODES

    return [DAE.encode(), DAE_NODES.encode()]


def stl() -> list[bytes]:
    """A tetrahedron in binary and as text."""
    from tests.support.robot_files import STL, STL_TEXT

    return [STL, STL_TEXT.encode()]
