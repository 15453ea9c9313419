"""Scene files: what they may say, and one clear line for what they may not."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lgp.errors import SceneError
from lgp.logic.pddl import load_domain
from lgp.scene.scene_file import load_scene, read_scene, shipped_scenes
from tests.support.lgp_worlds import HUMAN_ONLY
from tests.support.says import says


def _with(path: str, value: Any) -> dict[str, Any]:
    values = copy.deepcopy(HUMAN_ONLY)
    *parents, last = path.split(".")
    inner: Any = values
    for key in parents:
        inner = inner.setdefault(key, {})
    inner[last] = value
    return values


@pytest.mark.parametrize("name", shipped_scenes())
def test_shipped_scenes_speak_of_what_their_domain_knows(name: str) -> None:
    scene = load_scene(name)
    domain = load_domain(scene.domain)
    assert set(scene.object_types.values()) <= set(domain.supertypes) | {"object"}
    for atom in (*scene.initial, *scene.goal):
        assert atom.partition("(")[0] in domain.predicates


def test_the_screwdriver_scene_gives_a_reason_for_each_free_choice() -> None:
    scene = load_scene("screwdriver")
    keys = {key for choice in scene.choices for key in choice.keys}
    assert {"robots.baxter.position", "tables.start.position", "tables.left.position", "phase_seconds"} <= keys
    assert all(len(choice.reason) > 20 for choice in scene.choices)
    # Every one of these keys can be changed, as a study of their influence needs.
    for key in keys:
        held = {"position": [0.5, 0.5], "size": [0.2, 0.2]}.get(key.rpartition(".")[2], 1.0)
        assert load_scene("screwdriver", {key: held}) != scene


def test_a_second_costs_what_the_scene_says() -> None:
    assert read_scene(HUMAN_ONLY).cost.time_weight == 0.2
    scene = read_scene(_with("cost.time_weight", 1.5))
    assert scene.cost.time_weight == 1.5
    other = read_scene(HUMAN_ONLY).with_time_weight(0.0)
    assert read_scene(other.values) == other
    assert other.cost.time_weight == 0.0
    for key, value in {"cost.time_weight": -1.0, "cost.time": 1.0}.items():
        with pytest.raises(SceneError) as error:
            read_scene(_with(key, value))
        says(error, "cost", "time")


def test_heights_are_drawn_from_their_ranges_alone() -> None:
    scene = load_scene("screwdriver")
    drawn = np.array(
        [
            [table.height for table in scene.draw_heights(np.random.default_rng(seed)).tables.values()]
            for seed in range(200)
        ]
    )
    assert list(scene.tables) == ["table.left", "table.center", "table.right", "table.start"]
    assert drawn[:, :3].min() >= 0.6
    assert drawn[:, :3].max() <= 1.6
    assert np.ptp(drawn[:, :3]) > 0.9
    assert np.all(drawn[:, 3] == 0.9)
    again = scene.draw_heights(np.random.default_rng(7))
    assert again == scene.draw_heights(np.random.default_rng(7))


@pytest.mark.parametrize(
    ("path", "value", "facts"),
    [
        ("human.statur", 1.7, ("human: unknown key 'statur'", "did you mean 'stature'")),
        ("humn", {}, ("unknown key 'humn'", "did you mean 'human'")),
        ("humans", {"bert": {"statur": 1.7}}, ("humans.bert: unknown key 'statur'", "did you mean 'stature'")),
        ("humans", 3, ("humans is 3", "expected a table")),
        ("slices", 2.5, ("slices is 2.5", "whole number")),
        ("depth", 2.5, ("depth is 2.5", "whole number")),
        ("human.stature", "tall", ("stature is 'tall'", "expected a finite number")),
        ("human.stature", float("nan"), ("stature is nan", "expected a finite number")),
        ("human.stature", 0.5, ("stature is 0.5", "expected 1.4 to 2.1")),
        ("human.sex", "mal", ("sex is 'mal'", "expected one of male", "female", "did you mean 'male'")),
        ("human.hands", ["third_hand"], ("no hand 'third_hand'",)),
        ("human.legs", "none", ("legs is 'none'", "expected one of planted", "solved", "locked")),
        ("tables.near.size", [1.0], ("tables.near: size is [1.0]", "expected 2 numbers")),
        ("tables.near.height", [1.6, 0.6], ("height is [1.6, 0.6]", "expected [lowest, highest]")),
        (
            "objects.box.on",
            "table.nar",
            ("on is 'table.nar'", "expected one of table.near", "did you mean 'table.near'"),
        ),
        ("objects.box.mass", -1, ("mass is -1", "expected 0 to 1000")),
        ("objects.box.at", [0.5, 0.0, 0.0], ("off table.near",)),
        ("objects.box.grips", {"human_hnad": {}}, ("objects.box", "no kind of hand 'human_hnad'", "'human_hand'")),
        ("initial", ["on_table(bx)"], ("unknown 'bx'",)),
        ("goal", "grasped", ("goal is 'grasped'", "expected a list of texts")),
        ("domain", None, ("domain is missing",)),
        ("robots.table", {"model": "panda", "position": [0, 0, 0]}, ("'table' is reserved",)),
        ("robots.arm", {"position": [0, 0, 0]}, ("robots.arm: model is missing",)),
        ("human", 3, ("human is 3", "expected a table")),
    ],
)
def test_wrong_entries_are_refused_in_one_line(path: str, value: Any, facts: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as error:
        read_scene(_with(path, value))
    says(error, *facts)


def test_a_scene_needs_an_agent() -> None:
    values = {"domain": "screwdriver", "initial": [], "goal": []}
    with pytest.raises(SceneError) as error:
        read_scene(values)
    says(error, "no agent", "[human]", "[robots.NAME]")


def test_unknown_and_broken_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError) as error:
        load_scene("screwdrivr")
    says(error, "did you mean 'screwdriver'")
    broken = tmp_path / "broken.toml"
    broken.write_text("a = [1,")
    with pytest.raises(SceneError) as error:
        load_scene(broken)
    says(error, "not TOML")
    broken.write_bytes(b"\xff\xfe")
    with pytest.raises(SceneError) as error:
        load_scene(broken)
    says(error, "cannot be read")


def test_changes_touch_only_keys_of_the_file() -> None:
    assert load_scene("screwdriver", {"human.stature": 1.6}).human.stature == 1.6
    with pytest.raises(SceneError) as error:
        load_scene("screwdriver", {"human.weight": 70})
    says(error, "human", "unknown key 'weight'")
    with pytest.raises(SceneError) as error:
        load_scene("screwdriver").with_heights({"middle": 1.0})
    says(error, "no table 'middle'")
    with pytest.raises(SceneError) as error:
        load_scene("screwdriver").with_heights({"left": 9.0})
    says(error, "height of table.left is 9.0, expected 0 to 3 m")


def test_a_robot_without_hands_that_is_to_act_is_told_how_to_get_one() -> None:
    values = _with("robots", {"arm": {"model": "ur_description/urdf/ur5_robot.urdf", "position": [1.0, 0.0, 0.6]}})
    values["initial"] = [*values["initial"], "free(arm.tool)"]
    with pytest.raises(SceneError) as error:
        read_scene(values)
    says(error, "'free(arm.tool)' contains unknown 'arm.tool'", "arm has no hands: add hands.tool = { frame = ... }")


@pytest.mark.parametrize("height", [float("nan"), float("inf"), "high", None, -0.1, 3.5])
def test_a_height_that_is_none_is_named_with_its_table(height: Any) -> None:
    with pytest.raises(SceneError, match=rf"height of table\.left is {re.escape(repr(height))}, expected 0 to 3 m"):
        load_scene("screwdriver").with_heights({"left": height})
