"""Meshes of robots: inside the package only, and damaged ones end in one error."""

from __future__ import annotations

import io
import os
import struct
import zipfile
from pathlib import Path

import pytest

from lgp.audit.agents import robot_model
from lgp.errors import WorldError
from lgp.kinematics.mesh_file import MissingMeshError, mesh_path, read_mesh
from lgp.page.objects import robot_meshes
from lgp.scene.model import Robot
from tests.support.page_packages import needs_page
from tests.support.robot_files import DAE, DAE_NODES, STL, STL_TEXT, dae, with_mesh
from tests.support.says import says


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Return the URDF of a package with a mesh, beside a file that does not belong to it."""
    folder = tmp_path / "arm"
    (folder / "urdf").mkdir(parents=True)
    (folder / "meshes").mkdir()
    (folder / "package.xml").write_text("<package/>")
    (folder / "meshes" / "a.stl").write_bytes(STL)
    (tmp_path / "outside.stl").write_bytes(STL)
    (folder / "meshes" / "link.stl").symlink_to(tmp_path / "outside.stl")
    (folder / "meshes" / "inner.stl").symlink_to(folder / "meshes" / "a.stl")
    (folder / "meshes" / "circle.stl").symlink_to(folder / "meshes" / "circle.stl")
    urdf = folder / "urdf" / "arm.urdf"
    urdf.write_text(with_mesh("package://arm/meshes/a.stl"))
    return urdf


def test_meshes_of_the_package_are_found(package: Path) -> None:
    mesh = package.parents[1] / "meshes" / "a.stl"
    names = ("package://arm/meshes/a.stl", "../meshes/a.stl", f"file://{mesh}", str(mesh), "../meshes/inner.stl")
    assert {mesh_path(name, package) for name in names} == {mesh.resolve()}


@pytest.mark.parametrize(
    "name",
    [
        "../../outside.stl",
        "../meshes/link.stl",
        "package://arm/../outside.stl",
        "package://arm/meshes/link.stl",
        "package://../outside.stl",
        "package://../../outside.stl",
        "package://tmp/outside.stl",
        "package:///etc/passwd",
        "package://etc/passwd",
        "file:///etc/passwd",
        "/etc/passwd",
        "http://example.org/a.stl",
        "../meshes/circle.stl",
        "",
        "a\0.stl",
    ],
)
def test_no_other_file_is_followed(package: Path, name: str) -> None:
    with pytest.raises(WorldError) as error:
        read_mesh(mesh_path(name, package))
    says(error, package.parents[1])


def test_without_a_package_the_folder_of_the_urdf_is_the_bound(tmp_path: Path) -> None:
    (tmp_path / "scene").mkdir()
    (tmp_path / "a.stl").write_bytes(STL)
    (tmp_path / "scene" / "a.stl").write_bytes(STL)
    urdf = tmp_path / "scene" / "r.urdf"
    assert mesh_path("a.stl", urdf) == (tmp_path / "scene" / "a.stl").resolve()
    with pytest.raises(WorldError) as error:
        mesh_path("../a.stl", urdf)
    says(error, urdf, "outside", "keep the meshes")


@needs_page
@pytest.mark.parametrize(
    ("name", "data"),
    [("a.stl", STL), ("b.stl", STL_TEXT.encode()), ("a.dae", DAE.encode()), ("b.dae", DAE_NODES.encode())],
)
def test_valid_meshes_are_read(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    ((vertices, faces, _),) = read_mesh(tmp_path / name)
    assert faces.shape == (4, 3)
    assert abs(float(vertices.max() - vertices.min())) < 1.2


def _zip() -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.dae", DAE + " " * 10_000_000)
    return buffer.getvalue()


MANY = "".join(f'<node id="n{at}">' + f'<instance_node url="#n{at + 1}"/>' * 10 + "</node>" for at in range(12))
CIRCLE = '<node id="a"><instance_node url="#b"/></node><node id="b"><instance_node url="#a"/></node>'
DAMAGED = {
    "empty.stl": b"",
    "empty.dae": b"",
    "short.dae": b"<COLLADA",
    "cut.dae": DAE[:900].encode(),
    "count.stl": bytes(80) + struct.pack("<I", 0xFFFF_FFFF) + STL[84:],
    "cut.stl": STL[:-7],
    "head.stl": STL[:84],
    "nan.stl": STL[:96] + struct.pack("<f", float("nan")) + STL[100:],
    "large.stl": STL[:96] + struct.pack("<f", 1e30) + STL[100:],
    "text.stl": STL_TEXT.replace("0.1", "1e400").encode(),
    "word.stl": STL_TEXT.replace("vertex 0.1", "vertex abc").encode(),
    "nan.dae": DAE.replace("0.1", "nan").encode(),
    "large.dae": DAE.replace("0.1", "1e400").encode(),
    "index.dae": DAE.replace("<p>0", "<p>999999").encode(),
    "scene.dae": DAE.replace('url="#s"', 'url="#t"').encode(),
    "entities.dae": DAE.replace("<COLLADA", '<!DOCTYPE c [<!ENTITY a "aa">]><COLLADA').encode(),
    "external.dae": DAE.replace("<COLLADA", '<!DOCTYPE c SYSTEM "/etc/passwd"><COLLADA').encode(),
    "circle.dae": dae(CIRCLE, '<node><instance_node url="#a"/></node>').encode(),
    "many.dae": dae(f'{MANY}<node id="n12"/>', '<node><instance_node url="#n0"/></node>').encode(),
    "archive.dae": _zip(),
    "a.zae": _zip(),
    "a.gltf": b"{}",
    "binary.obj": bytes(range(256)),
    "far.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99\n",
}


@needs_page
@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_mesh_names_the_file(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(DAMAGED[name])
    with pytest.raises(WorldError) as error:
        read_mesh(tmp_path / name)
    says(error, tmp_path / name)


@needs_page
def test_a_pipe_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.stl")
    for name in ("a.stl", "b.stl"):
        with pytest.raises(WorldError) as error:
            read_mesh(tmp_path / name)
        says(error, tmp_path / name, "cannot be read")


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """Return a workspace with a package in src/REPOSITORY, one that is installed, and links to its files."""
    for folder in (tmp_path / "ws" / "src" / "ours" / "arm", tmp_path / "ws" / "share" / "gripper"):
        (folder / "meshes").mkdir(parents=True)
        (folder / "package.xml").write_text("<package/>")
        (folder / "meshes" / "a.stl").write_bytes(STL)
    (tmp_path / "ws" / "secret.stl").write_bytes(STL)
    (tmp_path / "ws" / "share" / "gripper" / "meshes" / "link.stl").symlink_to(tmp_path / "ws" / "secret.stl")
    (tmp_path / "cell").mkdir()
    return tmp_path


@pytest.mark.parametrize("variable", ["", "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"])
def test_packages_are_looked_for_in_the_scene_and_the_environment(
    elsewhere: Path, variable: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    urdf, ws = elsewhere / "cell" / "arm.urdf", elsewhere / "ws"
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)
    folders = [str(ws / "src"), str(ws)]
    if variable:
        monkeypatch.setenv(variable, os.pathsep.join(folders))
    packages = () if variable else folders
    assert mesh_path("package://arm/meshes/a.stl", urdf, packages) == ws / "src" / "ours" / "arm" / "meshes" / "a.stl"
    for name in ("a.stl", "link.stl"):  # an installation may be links to the sources
        assert mesh_path(f"package://gripper/meshes/{name}", urdf, packages).name == name
    for name in ("package://gripper/../../secret.stl", "package://gripper/meshes/../../../secret.stl"):
        with pytest.raises(WorldError) as error:
            mesh_path(name, urdf, packages)
        says(error, urdf, "outside")
    with pytest.raises(MissingMeshError) as missing:
        mesh_path("package://gripper/meshes/b.stl", urdf, packages)
    says(missing, "package://gripper/meshes/b.stl", "does not exist", "install the whole package")


def test_a_package_that_is_nowhere_says_where_it_was_looked_for(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(elsewhere / "ws"))
    with pytest.raises(MissingMeshError) as error:
        mesh_path("package://grippr/meshes/a.stl", elsewhere / "cell" / "arm.urdf", [str(elsewhere / "cell")])
    says(error, "package 'grippr'", elsewhere / "ws", elsewhere / "cell", "`packages`", "ROS_PACKAGE_PATH")


@needs_page
def test_page_and_audit_read_the_meshes_of_other_packages(elsewhere: Path) -> None:
    urdf = elsewhere / "cell" / "arm.urdf"
    shape = '<geometry><mesh filename="package://gripper/meshes/a.stl"/></geometry>'
    urdf.write_text(
        f'<robot name="m"><link name="base"><visual>{shape}</visual><collision>{shape}</collision></link></robot>'
    )
    packages = (str(elsewhere / "ws"),)
    robot = Robot("r", (0.0, 0.0, 0.0), 0.0, (), (), {}, str(urdf), packages=packages)
    assert [part.link for part in robot_meshes(robot)] == ["base"]
    assert [body.name for body, _ in robot_model(robot).parts] == ["r.base"]
