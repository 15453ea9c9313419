"""Obstacles, shelves and covered tables: what scene files say, and that bodies keep out of them."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.audit.audit import bodies_of
from lgp.audit.replay import replay
from lgp.audit.samples import Samples
from lgp.collision.distances import Collisions
from lgp.errors import SceneError
from lgp.page.objects import obstacle_mesh
from lgp.scene.consistency import check_first_facts
from lgp.scene.scene_file import load_scene, read_scene
from lgp.scene.surroundings import fixed_bodies
from tests.support.gantry import HEIGHT, START, made_plan, scene_values
from tests.support.page_packages import needs_page
from tests.support.robot_files import STL
from tests.support.says import says

OBSTACLES = {
    "pillar": {"radius": 0.05, "length": 1.0, "position": [0.5, 0.0, 1.2]},
    "crate": {"size": [0.1, 0.2, 0.3], "position": [0.5, 0.5, 0.9], "yaw": 30},
}


def scene_of(folder: Path, **changes: Any) -> lgp.Scene:
    return read_scene(scene_values(folder, **changes))


def test_obstacles_are_boxes_cylinders_and_meshes(tmp_path: Path) -> None:
    (tmp_path / "part.stl").write_bytes(STL)
    file = tmp_path / "cell.toml"
    file.write_text(
        'domain = "screwdriver"\ninitial = []\ngoal = []\n[human]\n'
        "[obstacles]\npillar = { radius = 0.05, length = 1.0, position = [0.5, 0.0, 1.2] }\n"
        "crate = { size = [0.1, 0.2, 0.3], position = [0.5, 0.5, 0.9], yaw = 30 }\n"
        'part = { mesh = "part.stl", position = [0, 0, 0] }\n'
    )
    scene = load_scene(file)
    assert list(scene.obstacles) == ["obstacle.pillar", "obstacle.crate", "obstacle.part"]
    assert scene.obstacles["obstacle.pillar"].size == (0.1, 0.1, 1.0)
    assert scene.obstacles["obstacle.crate"].rotation == (0.0, 0.0, 30.0)
    assert scene.obstacles["obstacle.part"].file == str(tmp_path / "part.stl"), "from the folder of the scene"
    assert read_scene(scene.values).obstacles == scene.obstacles


@pytest.mark.parametrize(
    ("entry", "facts"),
    [
        ({"position": [0, 0, 0]}, ("obstacles.x", "gives neither", "size, radius with length, and mesh")),
        ({"size": [1, 1, 1], "radius": 1, "position": [0, 0, 0]}, ("obstacles.x", "box and cylinder")),
        ({"radius": 0.1, "position": [0, 0, 0]}, ("obstacles.x", "length is missing")),
        ({"mesh": "no.stl", "position": [0, 0, 0]}, ("obstacles.x", "'no.stl'", ".obj")),
        ({"size": [1, 1, 1], "position": [0, 0]}, ("obstacles.x", "position", "3 numbers")),
        ({"size": [1, 1, 1], "position": [0, 0, 0], "yaw": 3, "rotation": [0, 0, 1]}, ("yaw and rotation",)),
        ({"size": [1, 1, 1], "position": [0, 0, 0], "mass": 3}, ("unknown key 'mass'",)),
    ],
)
def test_wrong_obstacles_are_refused(tmp_path: Path, entry: dict[str, Any], facts: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as error:
        scene_of(tmp_path, obstacles={"x": entry})
    says(error, *facts)


@pytest.mark.parametrize(("scale", "sides"), [(0.001, (0.001,) * 3), (2, (2.0,) * 3), ([1, 2, 3], (1.0, 2.0, 3.0))])
def test_a_mesh_is_scaled_by_one_number_or_by_one_for_each_axis(tmp_path: Path, scale: Any, sides: Any) -> None:
    (tmp_path / "part.stl").write_bytes(STL)
    part = {"mesh": str(tmp_path / "part.stl"), "position": [0, 0, 0], "scale": scale}
    assert scene_of(tmp_path, obstacles={"part": part}).obstacles["obstacle.part"].size == sides
    for wrong, fact in (("mm", "3 numbers, or one for all"), (0, "expected 1e-06"), (True, "finite number")):
        with pytest.raises(SceneError) as error:
            scene_of(tmp_path, obstacles={"part": part | {"scale": wrong}})
        says(error, "obstacles.part: scale", fact)


@pytest.mark.parametrize("name", ["pillar", "obstacle.pillar"])
def test_no_action_names_an_obstacle(tmp_path: Path, name: str) -> None:
    with pytest.raises(SceneError) as error:
        scene_of(tmp_path, obstacles=OBSTACLES, goal=[f"placed(box, {name})"])
    says(error, f"the obstacle '{name}'", "[tables]")


def test_a_shelf_is_tables_with_space_above_and_walls(tmp_path: Path) -> None:
    shelf = {"position": [1, 2], "yaw": 90, "size": [0.4, 0.8], "boards": [0.4, 0.9], "thickness": 0.02}
    scene = scene_of(tmp_path, shelves={"rack": shelf | {"walls": ["+x", "-y"]}})
    low, high = scene.tables["table.rack.1"], scene.tables["table.rack.2"]
    assert (low.height, high.height, high.clearance) == (0.4, 0.9, np.inf)
    assert low.clearance == pytest.approx(0.48)
    back, side = scene.obstacles["obstacle.rack.+x"], scene.obstacles["obstacle.rack.-y"]
    np.testing.assert_allclose(back.position, [1.0, 2.21, 0.45], atol=1e-12)
    np.testing.assert_allclose(side.position, [1.41, 2.0, 0.45], atol=1e-12)
    assert (back.size, side.size) == ((0.02, 0.8, 0.9), (0.4, 0.02, 0.9))
    assert fixed_bodies(scene) == scene.obstacles, "the next board bounds the space above one"
    again = scene.with_heights({"a": 0.7})
    assert [one.height for one in read_scene(again.values).tables.values()] == [0.7, 0.8, 0.4, 0.9]


@pytest.mark.parametrize(
    ("change", "facts"),
    [
        ({"boards": []}, ("boards is empty",)),
        ({"boards": [0.9, 0.4]}, ("boards is [0.9, 0.4]", "rising heights")),
        ({"boards": [0.4, 0.41]}, ("0.03 m above the one before",)),
        ({"walls": ["back"]}, ("'back'", "+x, -x, +y, -y")),
    ],
)
def test_wrong_shelves_are_refused(tmp_path: Path, change: dict[str, Any], facts: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as error:
        scene_of(tmp_path, shelves={"rack": {"position": [1, 2], "size": [0.4, 0.8], "boards": [0.4]} | change})
    says(error, "shelves.rack", *facts)


def test_a_covered_table_has_a_board_above_it(tmp_path: Path) -> None:
    values = scene_values(tmp_path)
    tables = copy.deepcopy(values["tables"])
    tables["b"] |= {"clearance": 0.2, "yaw": 20}
    scene = read_scene(values | {"tables": tables})
    (cover,) = fixed_bodies(scene).values()
    assert cover.position == (1.0, 0.0, pytest.approx(HEIGHT + 0.2 + 0.015))
    assert cover.size == (0.4, 0.4, 0.03)
    assert fixed_bodies(scene.with_heights({"b": 0.5}))[cover.full].position[2] == pytest.approx(0.715)


def test_a_saved_plan_says_where_boards_and_covers_are(tmp_path: Path) -> None:
    rack = {"position": [2.0, 0.0], "size": [0.3, 0.5], "boards": [0.4, 0.9], "walls": ["+x"]}
    covered = {"position": [1.0, 0.0], "size": [0.4, 0.4], "height": HEIGHT, "clearance": 0.5}
    tables = {**scene_values(tmp_path)["tables"], "b": covered}
    made_plan(scene_values(tmp_path, shelves={"rack": rack}, tables=tables), [], np.zeros((0, 4)), START).save(
        tmp_path / "plan"
    )
    saved = json.loads((tmp_path / "plan" / "plan.json").read_text())["scene"]
    assert saved["tables"]["table.rack.1"]["height"] == 0.4
    assert saved["tables"]["table.rack.1"]["clearance"] == pytest.approx(0.47)
    assert saved["tables"]["table.rack.2"]["clearance"] is None
    assert saved["obstacles"]["obstacle.b.cover"]["position"] == pytest.approx([1.0, 0.0, HEIGHT + 0.515])
    assert list(saved["obstacles"]) == ["obstacle.rack.+x", "obstacle.b.cover"]
    assert "tables" not in lgp.Plan.load(tmp_path / "plan").scene.values["shelves"], "the scene itself is as written"


def test_what_is_higher_than_the_space_is_not_put_there(tmp_path: Path) -> None:
    values = scene_values(tmp_path, goal=["placed(box, table.b)"])
    tables = copy.deepcopy(values["tables"])
    tables["b"]["clearance"] = 0.07
    plan = lgp.plan(read_scene(values | {"tables": tables}), cost=None, depth=2)
    assert not plan.feasible
    says(plan.reason, "place(2, gantry.hand, box, table.b)", "box is 0.08 m high", "above table.b are 0.07 m")
    tables["a"]["clearance"] = 0.05
    with pytest.raises(SceneError) as error:
        check_first_facts(read_scene(values | {"tables": tables}))
    says(error, "objects.box is 0.08 m high on table.a", "0.05 m")


def test_an_object_in_a_hand_at_first_needs_no_table(tmp_path: Path) -> None:
    box = {"size": [0.1, 0.06, 0.08], "mass": 1.0, "hand": "gantry.hand", "in_hand": [0, 0, 0, 180, 0, 0]}
    scene = scene_of(
        tmp_path, objects={"box": box}, initial=["grasped(gantry.hand, box)"], goal=["placed(box, table.b)"]
    )
    plan = lgp.plan(scene, cost=None, depth=1)
    assert plan.actions == ("place(1, gantry.hand, box, table.b)",)
    with pytest.raises(SceneError) as error:
        scene_of(tmp_path, objects={"box": {key: box[key] for key in ("size", "mass")}})
    says(error, "objects.box", "on is missing")


@pytest.mark.slow
def test_the_planner_and_the_audit_keep_bodies_out_of_obstacles(tmp_path: Path) -> None:
    (tmp_path / "part.stl").write_bytes(STL)
    part = {"mesh": str(tmp_path / "part.stl"), "position": [0.45, -0.05, 0.8], "scale": [2, 2, 2]}
    for obstacles in ({"pillar": OBSTACLES["pillar"]}, {"part": part}):
        slow = {"phase_seconds": 3.0, "slices": 15}
        values = scene_values(tmp_path, goal=["placed(box, table.b)"], obstacles=obstacles, **slow)
        pair = "box", f"obstacle.{next(iter(obstacles))}"
        straight = lgp.plan(read_scene(values), cost=None, collisions=False)
        assert pair in [one.pair for one in lgp.audit_plan(straight).contacts], "a straight way leads through it"
        around = lgp.plan(read_scene(values), cost=None)
        assert around.feasible
        assert pair not in [one.pair for one in lgp.audit_plan(around).contacts]


def test_obstacles_stand_where_both_have_them(tmp_path: Path) -> None:
    (tmp_path / "part.stl").write_bytes(STL)
    part = {"mesh": str(tmp_path / "part.stl"), "position": [0.3, 0.2, 1.0], "rotation": [10, 20, 30]}
    values = scene_values(tmp_path, obstacles=OBSTACLES | {"part": part})
    plan = made_plan(values, [], np.zeros((0, 4)), np.array(START))
    run = replay(Samples.of(plan))
    bodies, rotation, position, _ = bodies_of(run)
    shapes = {one.name: one for one in Collisions(lgp.World(plan.scene)).shapes if one.kind == "obstacle"}
    assert set(shapes) == set(plan.scene.obstacles)
    for number, body in enumerate(bodies):
        if body.name in shapes:
            np.testing.assert_allclose(position[number, 0], shapes[body.name].position, atol=1e-12)
            np.testing.assert_allclose(rotation[number, 0], shapes[body.name].rotation, atol=1e-12)
            np.testing.assert_allclose(body.shape.half, shapes[body.name].half, atol=1e-3)  # a prism is wider


@needs_page
@pytest.mark.parametrize("shape", ["flat", "line", "cone"])
def test_meshes_of_any_shape_are_in_the_way(tmp_path: Path, shape: str) -> None:
    around = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    points = {
        "flat": np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.3], [0.0, 0.3, 0.0]]),
        "line": np.array([[0.0, 0.0, 0.0], [0.3, 0.3, 0.0], [0.1, 0.1, 0.0], [0.2, 0.2, 0.001]]),
        "cone": np.array([[0.0, 0.0, 0.3], *np.stack([0.1 * np.cos(around), 0.1 * np.sin(around), 0 * around], 1)]),
    }[shape]
    corners = [f"v {x} {y} {z}" for x, y, z in points]
    faces = [f"f 1 {number} {number + 1}" for number in range(2, len(points))]
    (tmp_path / "part.obj").write_text("\n".join([*corners, *faces]))
    part = {"mesh": str(tmp_path / "part.obj"), "position": [0.4, -0.6, 0.8]}
    plan = lgp.plan(scene_of(tmp_path, obstacles={"part": part}), cost=None, start=np.array(START))
    assert plan.feasible
    assert plan.audit["samples"] > 0


@needs_page
def test_obstacles_are_drawn(tmp_path: Path) -> None:
    (tmp_path / "part.stl").write_bytes(STL)
    part = {"mesh": str(tmp_path / "part.stl"), "position": [0.3, 0.2, 1.0], "scale": [2, 2, 2]}
    scene = scene_of(tmp_path, obstacles=OBSTACLES | {"part": part})
    spans = {name: np.ptp(obstacle_mesh(body).vertices, axis=0) for name, body in scene.obstacles.items()}
    np.testing.assert_allclose(spans["obstacle.pillar"], [0.1, 0.1, 1.0], atol=1e-3)
    np.testing.assert_allclose(spans["obstacle.crate"], [0.1, 0.2, 0.3], atol=1e-6)
    np.testing.assert_allclose(spans["obstacle.part"], 0.2, atol=1e-6)
