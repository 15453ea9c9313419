"""The page of a plan without a browser: sentences, ribbon, camera, shots, the person's shape, packed data, files."""

from __future__ import annotations

import base64
import importlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lgp
from lgp.errors import LgpError
from lgp.kinematics.modes import ROLES, KinematicSwitch
from lgp.motion import Motion
from lgp.page.camera import ANGLE, Subject, framed, occluded_share, shots
from lgp.page.page import check_packages, score_spans, write_page
from lgp.page.sentences import humanised, sentences
from lgp.scene.model import Scene
from lgp.scene.scene_file import load_scene, read_scene
from reba.posture import columns as columns_
from tests.support.lgp_worlds import HUMAN_ONLY, needs_robots
from tests.support.says import says

pytestmark = pytest.mark.slow


needs_page = pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in ("pyvista", "trimesh", "collada")),
    reason="the extra `page` is not installed",
)


@pytest.fixture(scope="module")
def plan() -> lgp.Plan:
    return lgp.plan(read_scene(HUMAN_ONLY, "box"), cost=None, slices=4)


@pytest.fixture(scope="module")
def page(plan: lgp.Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_page(plan, tmp_path_factory.mktemp("page")).parent


def scene_with(*robots: str) -> Scene:
    scene = load_scene("screwdriver")
    first = scene.robots["baxter"]
    found = {}
    for name in robots:
        hands = tuple(replace(hand, agent=name) for hand in first.hands)
        found[name] = replace(first, name=name, hands=hands)
    parts = {name: replace(scene.things["screwdriver"], name=name) for name in ("toolbox/handle", "toolbox/side.left")}
    return replace(scene, robots=found, things={**scene.things, **parts})


def said(scene: Scene, *switches: KinematicSwitch) -> list[str]:
    return [line.text for line in sentences(scene, switches)]


def test_the_sentence_of_the_paper() -> None:
    handle, right = "toolbox/handle", "human.right_hand"
    lines = said(scene_with("baxter"), KinematicSwitch("handover", right, handle, giver="baxter.left"))
    assert lines == ["The robot, using its left arm, hands over the toolbox handle to your right hand."]


def test_a_worker_is_told_what_to_do() -> None:
    hand, screwdriver = "human.right_hand", "screwdriver"
    assert said(
        scene_with("baxter"),
        KinematicSwitch("grasp", "baxter.left", screwdriver),
        KinematicSwitch("place", "baxter.left", screwdriver, "table.left"),
        KinematicSwitch("grasp", hand, screwdriver),
        KinematicSwitch("handover", "baxter.right", screwdriver, giver=hand),
        KinematicSwitch("hold", "baxter.right", "toolbox/handle"),
        KinematicSwitch("screw", hand, "toolbox/handle", other="toolbox/side.left"),
    ) == [
        "The robot, using its left arm, picks up the screwdriver from the start table.",
        "The robot, using its left arm, puts the screwdriver on the left table.",
        "Pick up the screwdriver from the left table with your right hand.",
        "Hand over the screwdriver to the robot's right arm with your right hand.",
        "The robot, using its right arm, holds the toolbox handle still for you.",
        "Screw the toolbox handle and the left toolbox side together with your right hand.",
    ]


@pytest.mark.parametrize("kind", list(ROLES))
@pytest.mark.parametrize("actor", ["human.right_hand", "baxter.left"])
@pytest.mark.parametrize("robots", [("baxter",), ("baxter", "panda")])
def test_every_kind_of_action_has_words(kind: str, actor: str, robots: tuple[str, ...]) -> None:
    fields = {"hand": actor, "thing": "toolbox/handle"}
    fields |= {
        "handover": {"hand": "baxter.right", "giver": actor},
        "place": {"table": "table.center"},
        "screw": {"other": "toolbox/side.left"},
    }.get(kind, {})
    (line,) = sentences(scene_with(*robots), [KinematicSwitch(kind, **fields)])
    assert line.you == actor.startswith("human")
    assert line.text.endswith(".")
    assert line.text[0].isupper()
    assert "toolbox handle" in line.text
    assert not set("{}_/") & set(line.text + line.short)
    assert ("the robot baxter" in line.text.lower()) == (len(robots) > 1 and not (line.you and kind != "handover"))


def test_names_are_humanised() -> None:
    names = ["tableCenter", "toolbox/side.left", "table.start", "right_hand", "box"]
    assert [humanised(name) for name in names] == [
        "table Center", "left toolbox side", "start table", "right hand", "box",
    ]  # fmt: skip


def test_the_ribbon_holds_every_true_score(plan: lgp.Plan) -> None:
    posture = plan.posture.copy()
    posture[1:3, 0] = 50.0  # bent forward for two slices
    bent = replace(plan, posture=posture)
    ribbon = score_spans(bent)
    scores = bent.reba()
    assert scores is not None
    time = np.concatenate([[0.0], plan.time])
    assert ribbon[0].start == 0.0
    assert ribbon[-1].end == pytest.approx(plan.time[-1])
    assert [run.end for run in ribbon[:-1]] == [run.start for run in ribbon[1:]]
    assert len(ribbon) >= 3
    for number, score in enumerate(np.asarray(scores.reba, dtype=int)):
        middle = (time[number] + time[number + 1]) / 2.0
        assert [run.score for run in ribbon if run.start < middle < run.end] == [score]
    assert score_spans(replace(plan, posture=np.zeros((0, 0)))) == ()


corners = st.lists(st.tuples(*[st.floats(-2.0, 2.0)] * 3), min_size=2, max_size=20)


@given(corners, st.floats(0.0, 6.3), st.floats(-0.2, 1.2), st.floats(0.3, 3.0))
@settings(max_examples=60, deadline=None)
def test_the_camera_sees_all_points(points: list[Any], around: float, above: float, aspect: float) -> None:
    towards = np.array([np.cos(around) * np.cos(above), np.sin(around) * np.cos(above), np.sin(above)])
    spread = np.array(points) + np.arange(len(points))[:, None] * 1e-3
    eye, target = framed(spread, towards, aspect)
    np.testing.assert_allclose(np.cross(eye - target, towards), 0.0, atol=1e-9)
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    depth = (eye - spread) @ towards
    assert (depth > 0).all()
    tall = np.tan(np.radians(ANGLE) / 2.0)
    assert (np.abs((spread - eye) @ np.cross(towards, right)) <= tall * depth * 1.0001).all()
    assert (np.abs((spread - eye) @ right) <= tall * aspect * depth * 1.0001).all()


def test_a_shot_leaves_the_side_where_something_stands_before_it() -> None:
    spots, box = np.zeros((1, 3)), np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    free = shots([Subject(box, spots, np.zeros((0, 3)))], 0.0)[0].towards
    wall = 0.5 * free + 0.2 * np.random.default_rng(0).normal(size=(2000, 3))
    chosen = shots([Subject(box, spots, wall)], 0.0)[0].towards
    assert occluded_share(spots, wall, free) == 1.0
    assert occluded_share(spots, wall, chosen) == 0.0


@needs_page
def test_a_person_stands_on_the_floor_and_is_as_tall_as_said() -> None:
    import pinocchio as pin

    from lgp.kinematics import human
    from lgp.page.person import figure

    stature, sex = 1.55, "female"
    shape = figure(stature, sex)
    np.testing.assert_allclose(shape.skin.weight.sum(axis=1), 1.0)
    model = human.human_model(stature, sex)
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    place = {name: data.oMi[number] for number, name in enumerate(model.names)}
    tops = {joint: mesh.vertices @ place[joint].rotation.T + place[joint].translation for joint, mesh in shape.parts}
    assert tops["middle_cervical_Y"][:, 2].max() == pytest.approx(stature, abs=0.06)
    for side in columns_.SIDES:
        assert tops[f"{side}_ankle_X"][:, 2].min() == pytest.approx(0.0, abs=0.01)
    left, right = (next(mesh for joint, mesh in shape.parts if joint == f"{side}_wrist_X") for side in columns_.SIDES)
    np.testing.assert_allclose(left.vertices * (1, 1, -1), right.vertices, atol=1e-12)


@needs_page
def test_colours_meet_without_a_gap_and_face_outwards() -> None:
    from lgp.page.mesh import Solid, painted, surface

    axes = np.eye(3)
    ball = Solid("a", "red", np.zeros(3), np.zeros(3), (0.1, 0.1, 0.1), axes)
    limb = Solid("b", "blue", np.array([0.1, 0.0, 0.0]), np.array([0.4, 0.0, 0.0]), (0.05, 0.04), axes)
    mesh = painted(surface([ball, limb], 0.01, 0.02), [ball, limb], {"red": "#ff0000", "blue": "#0000ff"}, 0.1)
    assert {tuple(row) for row in mesh.colours.tolist()} == {(255, 0, 0), (0, 0, 255)}
    corners = mesh.vertices[mesh.faces]
    # The divergence theorem: faces that look outwards and leave no gap enclose the volume of ball and limb.
    volume = np.einsum("ki,ki->k", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    alone = 4 / 3 * np.pi * 0.1**3 + np.pi * 0.3 * (0.05**2 + 0.05 * 0.04 + 0.04**2) / 3
    assert 0.85 * alone < volume < 1.05 * alone


@needs_page
@needs_robots
def test_a_robot_is_seen_as_its_urdf_says_in_few_triangles() -> None:
    from lgp.page.objects import FACES, robot_meshes

    robot = load_scene("screwdriver_panda").robots["panda"]
    visuals = robot_meshes(robot)
    links = [part.link for part in visuals]
    assert set(links) == {f"panda_link{number}" for number in range(8)} | {
        "panda_hand", "panda_leftfinger", "panda_rightfinger",
    }  # fmt: skip
    assert all(len(part.mesh.faces) <= 1.2 * FACES for part in visuals)
    arm = np.ptp(visuals[links.index("panda_link5")].mesh.vertices, axis=0)
    np.testing.assert_allclose(arm, [0.11, 0.18, 0.31], atol=0.02)
    assert len(np.unique(visuals[links.index("panda_hand")].mesh.colours, axis=0)) >= 2
    # One mesh for both fingers, turned.
    left, right = visuals[links.index("panda_leftfinger")], visuals[links.index("panda_rightfinger")]
    assert left.key == right.key
    np.testing.assert_allclose(np.abs(np.diag(right.place)[:2]), 1.0)


def data_of(page: Path) -> dict[str, Any]:
    text = (page / "assets" / "plan.js").read_text(encoding="utf-8")
    found: dict[str, Any] = json.loads(text.removeprefix("window.PLAN = ").removesuffix(";\n"))
    return found


@needs_page
def test_packed_motion_is_that_of_the_plan(plan: lgp.Plan, page: Path) -> None:
    view = data_of(page)["view"]
    count = len(view["frames"])
    raw = np.frombuffer(base64.b64decode(view["position"]["data"]), "<i2").reshape(-1, count, 3)
    position = raw * view["position"]["scale"] + view["position"]["middle"]
    time = np.array(view["time"])
    motion = Motion(plan)
    at = [int(np.abs(time - moment).argmin()) for moment in motion.time]
    np.testing.assert_allclose(time[at], motion.time, atol=1e-6)
    np.testing.assert_allclose(position[at, view["frames"].index("box")], motion.thing("box").position, atol=2e-4)
    wrist = motion.frames(["human.right_wrist_X"])["human.right_wrist_X"].position
    np.testing.assert_allclose(position[at, view["frames"].index("human.right_wrist_X")], wrist, atol=2e-4)
    turns = np.frombuffer(base64.b64decode(view["rotation"]), "<i2").reshape(-1, count, 4) / 32767
    np.testing.assert_allclose(np.linalg.norm(turns, axis=2), 1.0, atol=1e-3)
    assert ((turns[1:] * turns[:-1]).sum(axis=2) > 0).all()


@needs_page
def test_the_same_plan_gives_the_same_files(plan: lgp.Plan, page: Path, tmp_path: Path) -> None:
    again = write_page(plan, tmp_path).parent
    files = {file.relative_to(page): file.read_bytes() for file in sorted(page.rglob("*")) if file.is_file()}
    assert files == {file.relative_to(again): file.read_bytes() for file in sorted(again.rglob("*")) if file.is_file()}
    assert sum(map(len, files.values())) < 10e6
    names = {str(name) for name in files}
    assert {"index.html", "pictures/start.webp", "pictures/action-1.webp", "pictures/action-1-film.webp"} <= names


@needs_page
def test_films_move_and_stills_show_something(page: Path) -> None:
    from PIL import Image

    film = Image.open(page / "pictures" / "action-1-film.webp")
    frames = []
    for number in range(film.n_frames):
        film.seek(number)
        frames.append(np.asarray(film.convert("RGB"), dtype=int))
    assert len(frames) >= 5
    assert np.abs(frames[0] - frames[-1]).max() > 60
    still = np.asarray(Image.open(page / "pictures" / "action-1.webp").convert("RGB"), dtype=int)
    assert still.std() > 15


@needs_page
def test_nothing_is_asked_from_elsewhere(page: Path) -> None:
    own = ["index.html", "assets/page.css", "assets/stage.js", "assets/player.js", "assets/live.js"]
    for name in own:
        text = (page / name).read_text(encoding="utf-8")
        assert "http://" not in text
        assert "https://" not in text
        assert "import " not in text.replace("!important", "")


def test_a_missing_package_is_one_line() -> None:
    with pytest.raises(LgpError) as error:
        check_packages({"no_such_module": "such-package"})
    says(error, "such-package", 'pip install "dreba[page]"')


@needs_page
def test_a_plan_that_is_none_has_no_page(plan: lgp.Plan, tmp_path: Path) -> None:
    with pytest.raises(LgpError) as error:
        write_page(replace(plan, feasible=False, reason="out of reach"), tmp_path / "page")
    says(error, "box", "not feasible", "out of reach")
    (tmp_path / "file").write_text("")
    with pytest.raises(LgpError) as error:
        write_page(plan, tmp_path / "file" / "page", pictures=False)
    says(error, tmp_path / "file" / "page", "another folder")
