"""Robot models: files, packages and locked joints."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

import pytest

from lgp.errors import WorldError
from lgp.kinematics import robot
from lgp.kinematics.world import World
from lgp.scene.model import Robot
from lgp.scene.scene_file import load_scene
from reba.extras import MissingPackageError
from tests.support.lgp_worlds import needs_robots
from tests.support.robot_files import LIFT_ARM
from tests.support.says import says


def test_without_the_package_the_command_to_install_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> metadata.Distribution:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(robot.metadata, "distribution", absent)
    with pytest.raises(MissingPackageError) as error:
        World(load_scene("screwdriver"))
    says(error, 'pip install "dreba[robots]"')


def test_unknown_robots_are_refused() -> None:
    with pytest.raises(WorldError) as error:
        robot.urdf_of("baxtr")
    says(error, "did you mean 'baxter'")


@pytest.mark.parametrize("model", ["../robots/arm.urdf", "/cells/arm.urdf"])
def test_a_path_that_leads_nowhere_is_no_matter_of_packages(model: str) -> None:
    with pytest.raises(WorldError) as error:
        robot.urdf_of(model)
    says(error, repr(model), "no such file", "folder of the scene")
    assert "example-robot-data" not in str(error.value)


@needs_robots
def test_wrong_locked_joints_are_refused() -> None:
    with pytest.raises(WorldError) as error:
        robot.robot_model(Robot("b", (0, 0, 0), 0, (), ("left_x*",), {}, "baxter"))
    says(error, "no joint matches 'left_x*'")
    with pytest.raises(WorldError) as error:
        robot.robot_model(Robot("b", (0, 0, 0), 0, (), (), {"left_s9": 1.0}, "baxter"))
    says(error, "no joint 'left_s9'", "did you mean 'left_s")


def test_a_robot_of_a_package_is_looked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "ws" / "lift_arm"
    (package / "urdf").mkdir(parents=True)
    (package / "package.xml").write_text("<package/>")
    (package / "urdf" / "arm.urdf").write_text(LIFT_ARM)
    monkeypatch.setenv("ROS_PACKAGE_PATH", "")
    scene = tmp_path / "cell" / "scene.toml"
    scene.parent.mkdir()
    scene.write_text(
        'domain = "screwdriver"\ninitial = []\ngoal = []\n[robots.arm]\nmodel = "package://lift_arm/urdf/arm.urdf"\n'
        'packages = ["../ws"]\nposition = [0, 0, 0]\nhands.tcp = { frame = "tcp" }\n'
    )
    assert len(World(load_scene(scene)).joints) == 7
    with pytest.raises(WorldError) as error:
        robot.urdf_of("package://lift_arm/urdf/arm.urdf")
    says(error, "package 'lift_arm'", "no folder", "ROS_PACKAGE_PATH")


def test_a_xacro_file_is_to_be_expanded() -> None:
    with pytest.raises(WorldError) as error:
        robot.urdf_of("robots/arm.urdf.xacro")
    says(error, "robots/arm.urdf.xacro", "path of a .urdf file", "xacro arm.urdf.xacro > arm.urdf")
