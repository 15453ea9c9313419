"""Small valid URDF, DAE and STL files."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from lgp.kinematics.world import World
from lgp.scene.scene_file import read_scene

URDF = """<?xml version="1.0"?>
<robot name="r">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="base">
    <inertial>
      <origin xyz="0 0 0.1" rpy="0 0 0"/><mass value="2.5"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>
    </inertial>
    <visual>
      <origin xyz="0 0 0.1" rpy="0 0 1.57"/>
      <geometry><box size="0.2 0.3 0.4"/></geometry><material name="grey"/>
    </visual>
    <collision><geometry><box size="0.2 0.3 0.4"/></geometry></collision>
  </link>
  <link name="upper"><visual><geometry><cylinder radius="0.05" length="0.3"/></geometry></visual></link>
  <link name="hand"><visual><geometry><sphere radius="0.05"/></geometry></visual></link>
  <joint name="lift" type="prismatic">
    <origin xyz="0 0 0.4" rpy="0 0 0"/><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.5" effort="100" velocity="1"/>
  </joint>
  <joint name="turn" type="revolute">
    <parent link="upper"/><child link="hand"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="10" velocity="2"/>
  </joint>
</robot>
"""


def arm(count: int) -> str:
    """Return a URDF of links in a chain of turning joints."""
    links = "".join(f'<link name="l{at}"/>' for at in range(count + 1))
    joints = "".join(
        f'<joint name="j{at}" type="revolute"><parent link="l{at}"/><child link="l{at + 1}"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for at in range(count)
    )
    return f'<robot name="a">{links}{joints}</robot>'


def with_mesh(name: str) -> str:
    """Return a URDF whose one link has a mesh."""
    shape = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
    return f'<robot name="m"><link name="base">{shape}</link></robot>'


CORNERS = ((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1))
FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
STL = bytes(80) + struct.pack("<I", len(FACES)) + b"".join(
    struct.pack("<12fH", 0, 0, 0, *CORNERS[a], *CORNERS[b], *CORNERS[c], 0) for a, b, c in FACES
)  # fmt: skip
STL_TEXT = (
    "solid t\n"
    + "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*CORNERS[corner]) for corner in face)
        + "endloop\nendfacet\n"
        for face in FACES
    )
    + "endsolid t\n"
)
_NUMBERS = " ".join(str(value) for corner in CORNERS for value in corner)
_INDICES = " ".join(str(index) for face in FACES for index in face)


def dae(nodes: str = "", scene: str = '<node id="n"><instance_geometry url="#g"/></node>') -> str:
    """Return a DAE of a tetrahedron with library nodes and the nodes of its scene."""
    library = f"<library_nodes>{nodes}</library_nodes>" if nodes else ""
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="meter" meter="1"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">{_NUMBERS}</float_array>
<technique_common><accessor source="#pa" count="4" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>{_INDICES}</p></triangles>
</mesh></geometry></library_geometries>{library}
<library_visual_scenes><visual_scene id="s">{scene}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""


DAE = dae()
DAE_NODES = dae(
    '<node id="a"><instance_geometry url="#g"/></node><node id="b"><instance_node url="#a"/></node>',
    '<node id="n"><translate>1 0 0</translate><instance_node url="#b"/></node>',
)

LIFT_ARM = """<robot name="lift_arm">
  <link name="base"/><link name="l0"/><link name="l1"/><link name="l2"/><link name="l3"/><link name="l4"/>
  <link name="l5"/><link name="tcp"/><link name="fl"/><link name="fr"/>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="l0"/><origin xyz="0 0 0.5"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="0.4" effort="1" velocity="0.2"/></joint>
  <joint name="pan" type="continuous"><parent link="l0"/><child link="l1"/><axis xyz="0 0 1"/></joint>
  <joint name="shoulder" type="revolute"><parent link="l1"/><child link="l2"/><axis xyz="0 1 0"/>
    <limit lower="-2.5" upper="2.5" effort="1" velocity="1.5"/></joint>
  <joint name="elbow" type="revolute"><parent link="l2"/><child link="l3"/><origin xyz="0.45 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="1" velocity="1.5"/></joint>
  <joint name="level" type="revolute"><parent link="l3"/><child link="l4"/><origin xyz="0.40 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="1" velocity="1.5"/></joint>
  <joint name="wrist" type="continuous"><parent link="l4"/><child link="l5"/><origin xyz="0.05 0 0"/>
    <axis xyz="1 0 0"/><limit effort="1" velocity="3"/></joint>
  <joint name="tcp_joint" type="fixed"><parent link="l5"/><child link="tcp"/>
    <origin xyz="0.12 0 0" rpy="0 1.5707963267948966 0"/></joint>
  <joint name="f1" type="prismatic"><parent link="l5"/><child link="fl"/><origin xyz="0.08 0.02 0"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.04" effort="1" velocity="1"/></joint>
  <joint name="f2" type="prismatic"><parent link="l5"/><child link="fr"/><origin xyz="0.08 -0.02 0"/>
    <axis xyz="0 -1 0"/><limit lower="0.002" upper="0.034" effort="1" velocity="0.4"/>
    <mimic joint="f1" multiplier="0.8" offset="0.002"/></joint>
</robot>
"""
"""An arm on a lift that slides, with a turret and a wrist that turn without end and a finger that follows the other."""


def arm_world(folder: Path, urdf: str = LIFT_ARM, **robot: Any) -> World:
    """Return a world with a robot from a URDF, its hand at the link `tcp`."""
    file = folder / "arm.urdf"
    file.write_text(urdf)
    values = {"model": str(file), "position": [0.4, -0.3, 0.2], "yaw": 30, "hands": {"tcp": {"frame": "tcp"}}}
    return World(read_scene({"domain": "screwdriver", "initial": [], "goal": [], "robots": {"arm": values | robot}}))
