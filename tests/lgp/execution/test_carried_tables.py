"""Objects on a table that a robot carries, in the simulated world and as they are tracked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lgp
from lgp.execution.checkpoint import Checkpoint
from lgp.execution.simulation import SimulatedRobots, SimulatedWorld
from lgp.execution.tracked_scene import scene_now
from lgp.kinematics.world import World
from lgp.scene.scene_file import read_scene
from tests.support.carried_tray import DRIVEN, tray_values
from tests.support.gantry import BOX, HEIGHT

AWAY = np.array([DRIVEN, 0.0, 1.4, 0.0])


def simulated(folder: Path, on: str) -> SimulatedWorld:
    world = World(read_scene(tray_values(folder, objects={"box": BOX | {"on": on, "at": [0.1, 0.05, 20]}})))
    q = np.array([0.0, 0.0, 1.4, 0.0])
    return SimulatedWorld(world, SimulatedRobots(world, q), q)


def drive(simulation: SimulatedWorld) -> None:
    for step in range(1, 11):
        simulation.robots.q = step / 10 * AWAY
        simulation.step(0.05 * step)


def test_a_box_rides_along_and_rests_on_the_tray_that_moves(tmp_path: Path) -> None:
    simulation = simulated(tmp_path, "table.tray")
    before = simulation.view.lies("box")
    drive(simulation)
    after = simulation.view.lies("box")
    assert before is not None
    assert after is not None
    assert before[0] == after[0] == "table.tray"
    np.testing.assert_allclose(before[1].position, after[1].position, atol=1e-12, err_msg="it was not moved there")
    np.testing.assert_allclose(simulation.pose("box").position, [DRIVEN - 0.05, 1.1, HEIGHT + 0.04], atol=1e-12)
    assert simulation.view.table_under("box") == "table.tray"
    assert simulation.view.rests("box"), "on the tray"
    scene = scene_now(simulation.world.scene, simulation.view, frozenset(), ())
    assert scene.objects["box"].on == "table.tray"
    assert scene.objects["box"].at == pytest.approx((0.1, 0.05, 20.0))


def test_a_box_that_is_put_on_a_tray_goes_with_it(tmp_path: Path) -> None:
    simulation = simulated(tmp_path, "table.a")
    simulation.lay("box", "table.tray", 0.0, 0.0)
    drive(simulation)
    np.testing.assert_allclose(simulation.pose("box").position[:2], [DRIVEN, 1.0], atol=1e-12)
    simulation.put("box")
    assert simulation.objects["box"].table == "table.tray"
    simulation.lay("box", "table.b", 0.0, 0.0)
    assert not simulation.objects["box"].table


def test_a_checkpoint_remembers_what_is_on_a_tray(tmp_path: Path) -> None:
    simulation = simulated(tmp_path, "table.tray")
    state = Checkpoint(0.0, 0.0, simulation.q, frozenset(), simulation.objects, 0, ".", 0)
    again = Checkpoint.read(state.record())
    again.check(simulation.world, 1)
    assert again.objects["box"].table == "table.tray"
    with pytest.raises(lgp.LgpError, match="no table that a robot of the scene carries"):
        Checkpoint.read(
            state.record() | {"things": {"box": state.record()["things"]["box"] | {"table": "table.a"}}}
        ).check(simulation.world, 1)
