"""Damaged URDF files end in one error that names file and element."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lgp.errors import WorldError
from lgp.kinematics.robot import robot_model
from lgp.kinematics.urdf import MOST_LINKS, read_urdf
from lgp.page.objects import robot_meshes
from lgp.scene.model import Robot
from tests.support.robot_files import URDF, arm
from tests.support.says import says


def _robot(path: Path) -> Robot:
    return Robot("r", (0.0, 0.0, 0.0), 0.0, (), (), {}, str(path))


def test_a_valid_file_gives_the_model(tmp_path: Path) -> None:
    path = tmp_path / "r.urdf"
    path.write_text(URDF)
    assert list(robot_model(_robot(path)).model.names) == ["universe", "lift", "turn"]


def test_capsules_are_read_and_drawn_about_their_middle(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "r.urdf"
    path.write_text(URDF.replace('<sphere radius="0.05"', '<capsule radius="0.05" length="0.3"'))
    assert robot_model(_robot(path)).model.existBodyName("hand")
    drawn = next(one for one in robot_meshes(_robot(path)) if one.link == "hand")
    ends = np.abs([drawn.mesh.vertices.min(axis=0), drawn.mesh.vertices.max(axis=0)])
    assert np.abs(ends - [0.05, 0.05, 0.2]).max() < 0.002
    assert capfd.readouterr().err == ""


LAUGHS = '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]>'
CHANGES = {
    "empty": (URDF, "", "not XML"),
    "binary": (URDF, "\x01\x02\x7fELF", "not XML"),
    "truncated": (URDF[900:], "", "not XML"),
    "entities": ("<robot", f"{LAUGHS}<robot", "document type"),
    "external": ("<robot", '<!DOCTYPE r SYSTEM "file:///etc/passwd"><robot', "document type"),
    "root": ("robot", "sdf", "<sdf>, expected <robot>"),
    "deep": ("<material", "<a>" * 200 + "</a>" * 200 + "<material", "100 levels"),
    "no_link": (URDF, '<robot name="r"/>', "no <link>"),
    "no_size": ('<box size="0.2 0.3 0.4"/>', "<box/>", "link 'base'", "<box> has no size"),
    "two_sizes": ('size="0.2 0.3 0.4"', 'size="0.2 0.3"', "link 'base'", "size of <box>", "3 numbers"),
    "negative": ('radius="0.05" length', 'radius="-1" length', "link 'upper'", "radius of <cylinder>"),
    "zero": ('<sphere radius="0.05"', '<sphere radius="0"', "link 'hand'", "radius of <sphere>", "above 0"),
    "capsule": ('<sphere radius="0.05"', '<capsule radius="0.05"', "link 'hand'", "<capsule> has no length"),
    "capsule_word": ('<sphere radius="0.05"', '<capsule radius="abc" length="1"', "link 'hand'", "radius of <capsule>"),
    "nan": ('xyz="0 0 0.4"', 'xyz="0 0 nan"', "joint 'lift'", "xyz of <origin>", "3 numbers"),
    "infinite": ('value="2.5"', 'value="inf"', "link 'base'", "value of <mass>"),
    "large": ('value="2.5"', 'value="1e400"', "link 'base'", "value of <mass>"),
    "word": ('rgba="0.5 0.5 0.5 1"', 'rgba="red"', "material 'grey'", "rgba of <color>", "4 numbers"),
    "axis": ('xyz="0 1 0"', 'xyz="0 2 0"', "joint 'turn'", "axis", "length 1"),
    "no_axis": ('xyz="0 1 0"', 'xyz="0 0 0"', "joint 'turn'", "axis", "length 1"),
    "joint_twice": ('name="turn"', 'name="lift"', "joint 'lift'", "twice"),
    "link_twice": ('link name="hand"', 'link name="upper"', "link 'upper'", "twice"),
    "kind": ('type="revolute"', 'type="hinge"', "joint 'turn'", "'hinge'", "revolute"),
    "no_limit": ('<limit lower="0" upper="0.5" effort="100" velocity="1"/>', "", "joint 'lift'", "no <limit>"),
    "no_velocity": ('effort="100" velocity="1"', 'effort="100"', "joint 'lift'", "no velocity", "URDF requires"),
    "no_effort": ('effort="100" velocity="1"', 'velocity="1"', "joint 'lift'", "no effort", "URDF requires"),
    "limits": ('lower="0" upper="0.5"', 'lower="1" upper="0.5"', "joint 'lift'", "lower below upper"),
    "unknown_link": ('<child link="hand"/>', '<child link="hend"/>', "joint 'turn'", "'hend'"),
    "two_parents": ('<child link="hand"/>', '<child link="upper"/>', "joint 'turn'", "child of two joints"),
    "circle": ('<parent link="base"/>', '<parent link="hand"/>', "make no tree"),
    "no_parent": ('<parent link="base"/>', "", "joint 'lift'", "no <parent>"),
    "no_geometry": ("<geometry><sphere", "<geometri><sphere", "not XML"),
    "shape": ('<sphere radius="0.05"/>', "<cone/>", "link 'hand'", "<cone>", "box"),
    "no_shape": ('<sphere radius="0.05"/>', "", "link 'hand'", "nothing"),
    "no_filename": ('<sphere radius="0.05"/>', "<mesh/>", "link 'hand'", "no filename"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_damaged_file_names_the_element(tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]) -> None:
    old, new, *words = CHANGES[name]
    assert old in URDF
    path = tmp_path / "r.urdf"
    path.write_text(URDF.replace(old, new))
    with pytest.raises(WorldError) as error:
        robot_model(_robot(path))
    says(error, path, *words)
    assert capfd.readouterr().err == ""


def test_a_long_chain_and_a_large_file_are_bounded(tmp_path: Path) -> None:
    path = tmp_path / "r.urdf"
    path.write_text(arm(MOST_LINKS - 1))
    assert len(read_urdf(path)[0].findall("link")) == MOST_LINKS
    assert robot_model(_robot(path)).model.njoints > 1
    path.write_text(arm(20_000))
    with pytest.raises(WorldError) as error:
        robot_model(_robot(path))
    says(error, path, "20001 links", str(MOST_LINKS))
    path.write_bytes(b" " * (1 << 25))
    with pytest.raises(WorldError) as error:
        read_urdf(path)
    says(error, path, "larger than")
