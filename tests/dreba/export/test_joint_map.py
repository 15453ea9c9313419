"""Exports of a caller's own joints: order, signs, units, held columns, on human.urdf and on a made-up arm."""

from __future__ import annotations

import importlib.util
import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import dreba
import reba
from dreba.export.casadi import casadi_function
from dreba.export.joint_map import read_map
from reba.posture.columns import COLUMNS
from tests.dreba.export.test_export import check_refusals, compiled
from tests.support.paths import ROOT
from tests.support.says import says
from tests.support.urdf_chain import human_urdf, read_joints

HUMAN = ROOT / "examples" / "human_urdf.toml"
NAMES = ("quadratic", "convex", "soft")
ARM = """
unit = "deg"
joints = ["slide", "elbow", "turn"]
[columns]
lower_arm_flexion_right = ["-elbow", 10]
upper_arm_flexion_right = ["+turn", "-elbow"]
[hold]
trunk_flexion = 20
"""


@cache
def model(name: str) -> dreba.Surrogate:
    return dreba.load(name)


def postures(joints: tuple[str, ...], q: np.ndarray, folder: Path) -> np.ndarray:
    """The posture table (n, 22) [deg] of joints (n, m) [rad] as `reba.read` gives it by the profile of human.urdf."""
    frames = pd.DataFrame(q, columns=list(joints))
    frames.insert(0, "time", np.arange(len(q)) / 10)
    frames.to_csv(folder / "joints.csv", index=False)
    return reba.angle_table(reba.read(folder / "joints.csv", profile="human_description"))


def sagittal(joints: tuple[str, ...], n: int) -> np.ndarray:
    """Random joints [rad] of movements in which the trunk and the upper arms turn about one axis only."""
    rng = np.random.default_rng(8)
    moved = ("_lumbar_Z", "_thoracic_Z", "_cervical_", "_knee_", "_shoulder_Z", "_elbow_", "_wrist_")
    q = rng.uniform(-0.5, 0.6, (n, len(joints)))
    q[:, [not any(word in joint for word in moved) for joint in joints]] = 0.0
    q[:, ["elbow_Z" in joint or "knee" in joint for joint in joints]] += 0.5
    return q


def test_the_map_of_human_urdf_is_that_of_the_reader(tmp_path: Path) -> None:
    own = read_map(HUMAN, COLUMNS)
    q = sagittal(own.joints, 10)  # few frames: joints that never move would count as not measured
    assert own.offset + q @ own.matrix.T == pytest.approx(postures(own.joints, q, tmp_path), abs=1e-6)


def test_the_joints_of_the_map_are_those_of_human_urdf() -> None:
    urdf = human_urdf()
    if urdf is None:
        pytest.skip("example-robot-data is not installed")
    assert sorted(read_map(HUMAN, COLUMNS).joints) == sorted(joint.name for joint in read_joints(urdf))
    pinocchio = pytest.importorskip("pinocchio", reason="pinocchio is not installed")
    assert list(pinocchio.buildModelFromUrdf(str(urdf)).names)[1:] == list(read_map(HUMAN, COLUMNS).joints)


@pytest.mark.parametrize("name", NAMES)
def test_c_takes_the_joints_of_human_urdf(name: str, tmp_path: Path) -> None:
    hessian = "gauss-newton"
    source = dreba.export_model(model(name), tmp_path / "cost", to="c", joint_map=HUMAN, hessian=hessian)
    evaluate, own = compiled(source), read_map(HUMAN, COLUMNS)
    q = sagittal(own.joints, 10)
    angles = postures(own.joints, q, tmp_path)
    given = {"load": 6.0, "coupling": (1, 2), "activity": 1}
    for joints, pose in zip(q, angles, strict=True):
        value, gradient = evaluate(joints, **given)
        expected, slope = model(name).value_and_gradient(pose, **given)
        factor = model(name).gauss_newton(pose, **given) @ own.matrix
        assert value == pytest.approx(expected, abs=1e-6)
        assert gradient == pytest.approx(slope @ own.matrix, abs=1e-4)
        assert evaluate.hessian(joints, **given) == pytest.approx(factor.T @ factor, rel=1e-4, abs=1e-4)
    check_refusals(evaluate, len(own.joints))
    assert np.isnan(evaluate.hessian(np.full(len(own.joints), np.nan))).all()
    header = source.with_suffix(".h").read_text()
    assert "radians" in header
    assert "35 right_ankle_X" in header
    assert "held [deg]: trunk_side_bend 0" in header


@pytest.mark.skipif(importlib.util.find_spec("casadi") is None, reason="CasADi is not installed")
@pytest.mark.parametrize("name", NAMES)
def test_casadi_takes_the_joints_of_human_urdf(name: str, tmp_path: Path) -> None:
    import casadi

    own = read_map(HUMAN, COLUMNS)
    function = casadi_function(model(name), joint_map=own, hessian="gauss-newton")
    joints = casadi.SX.sym("q", len(own.joints))
    derived = casadi.Function("own", [joints], [casadi.gradient(function(joints, 6.0, [1, 2], 1.0)[0], joints)])
    q = sagittal(own.joints, 10)
    for row, pose in zip(q, postures(own.joints, q, tmp_path), strict=True):
        value, gradient, hessian = function(row, 6.0, [1, 2], 1.0)
        expected, slope = model(name).value_and_gradient(pose, load=6.0, coupling=(1, 2), activity=1)
        factor = model(name).gauss_newton(pose, load=6.0, coupling=(1, 2), activity=1) @ own.matrix
        assert float(value) == pytest.approx(expected, abs=1e-6)
        assert np.array(gradient).ravel() == pytest.approx(slope @ own.matrix, abs=1e-4)
        assert np.array(derived(row)).ravel() == pytest.approx(slope @ own.matrix, abs=1e-4)
        assert np.array(hessian) == pytest.approx(factor.T @ factor, rel=1e-4, abs=1e-4)
    written = dreba.export_model(model(name), tmp_path / "cost", to="casadi", joint_map=HUMAN)
    assert written.read_text().splitlines()[-2].startswith("joints [rad]: left_hip_Z, ")


def test_signs_degrees_sums_and_held_columns(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text(ARM)
    columns = ("trunk_flexion", "upper_arm_flexion_right", "lower_arm_flexion_right")
    own = read_map(tmp_path / "arm.toml", columns)
    assert own.offset.tolist() == [20.0, 0.0, 10.0]
    assert own.matrix.tolist() == [[0.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, -1.0, 0.0]]
    poses = dreba.sample(2000, rng=1)
    fitted = dreba.QuadraticModel(joints=columns).fit(poses, poses.reba)
    evaluate = compiled(dreba.export_model(fitted, tmp_path / "arm", to="c", joint_map=tmp_path / "arm.toml"))
    value, gradient = evaluate(np.array([3.0, -40.0, 5.0]))
    expected, slope = fitted.value_and_gradient(np.array([20.0, 45.0, 50.0]))
    assert value == pytest.approx(expected)
    assert gradient == pytest.approx([0.0, -slope[1] - slope[2], slope[1]])


@pytest.mark.parametrize(
    ("change", "facts"),
    [
        (("joints = [", "joints = [3, "), ("joints",)),
        (('"slide", ', '"elbow", '), ("each name once",)),
        (('unit = "deg"', 'unit = "grad"'), ("unit", "rad")),
        (('"-elbow", 10', '"-ellbow", 10'), ("'ellbow'", "did you mean 'elbow'")),
        (("trunk_flexion = 20", "trunk_flexion = 2000"), ("trunk_flexion", "2000")),
        (('"-elbow", 10', '"-elbow", nan'), ("term nan", "a number of degrees")),
        (('"-elbow", 10', '"-elbow", 1e9'), ("lower_arm_flexion_right", "1e+09", "360")),
        (("trunk_flexion = 20", ""), ("trunk_flexion", "neither")),
        (("trunk_flexion = 20", "trunk = 20"), ("'trunk'",)),
        (("[hold]", "[hold]\nlower_arm_flexion_right = 3"), ("lower_arm_flexion_right", "leave out one")),
        (("[hold]", "[held]"), ("held", "unknown")),
        (("upper_arm_flexion_right =", "upper_arm_flexoin_right ="), ("upper_arm_flexoin_right",)),
        (("[hold]", "[[hold"), ("cannot be read",)),
    ],
)
def test_wrong_maps_are_refused_in_one_line(change: tuple[str, str], facts: tuple[str, ...], tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(ARM.replace(*change))
    with pytest.raises(dreba.ModelError) as error:
        read_map(path, ("trunk_flexion", "upper_arm_flexion_right", "lower_arm_flexion_right"))
    says(error, "arm.toml", *facts)


def test_the_map_of_the_documentation_is_whole(tmp_path: Path) -> None:
    (written,) = re.findall(
        r"(?s)```toml\n(unit = .*?)```", (ROOT / "docs" / "surrogates.md").read_text(encoding="utf-8")
    )
    (tmp_path / "my_robot.toml").write_text(written)
    own = read_map(tmp_path / "my_robot.toml", COLUMNS)
    assert own.offset + own.matrix @ [0.5, 0.1, 0.2] == pytest.approx(
        [float(np.degrees(0.5)), *([0.0] * 13), *(90.0 - np.degrees([0.1, 0.2])), *([0.0] * 6)]
    )
    assert len(own.held) == 19
    (tmp_path / "arm.toml").write_text(ARM[: ARM.index("[hold]")].replace("joints", 'hold = "neutral"\njoints', 1))
    assert read_map(tmp_path / "arm.toml", COLUMNS).held["lower_arm_flexion_left"] == 80.0
    (tmp_path / "arm.toml").write_text(ARM[: ARM.index("[hold]")].replace("joints", 'hold = "rest"\njoints', 1))
    with pytest.raises(dreba.ModelError) as error:
        read_map(tmp_path / "arm.toml", COLUMNS)
    says(error, "arm.toml", "'rest'", "neutral")


def test_a_side_of_its_own_takes_the_place_of_both_wherever_it_stands(tmp_path: Path) -> None:
    text = 'joints = ["a", "b"]\n[columns]\nknee_flexion_left = ["+b"]\nknee_flexion = ["+a"]\n'
    (tmp_path / "knees.toml").write_text(text + "[hold]\nwrist_twist_left = 5\nwrist_twist = 1\n")
    knees, wrists = (tuple(c for c in COLUMNS if c.startswith(name)) for name in ("knee", "wrist_twist"))
    own = read_map(tmp_path / "knees.toml", (*knees, *wrists))
    assert own.matrix.astype(bool).tolist() == [[False, True], [True, False], [False, False], [False, False]]
    assert own.offset.tolist() == [0.0, 0.0, 5.0, 1.0]


@pytest.mark.parametrize("name", ["a*/ int x; /*", "/*/", "a\nb"])
def test_the_name_of_a_joint_stays_inside_its_comment(name: str, tmp_path: Path) -> None:
    held = 'hold = "neutral"\n[columns]\ntrunk_flexion = ["+b"]\n'
    (tmp_path / "own.toml").write_text(f'joints = [{json.dumps(name)}, "b"]\n{held}')
    written = dreba.export_model(model("quadratic"), tmp_path / "cost", to="c", joint_map=tmp_path / "own.toml")
    compiled(written)
    comment, rest = written.read_text().split("*/", 1)
    assert "1 b" in comment
    assert rest.startswith("\n#include")


def test_all_columns_without_joints_or_degrees_are_named_at_once(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text(ARM)
    with pytest.raises(dreba.ModelError) as error:
        read_map(tmp_path / "arm.toml", COLUMNS)
    says(error, "trunk_side_bend", "wrist_twist_right", 'hold = "neutral"')


def test_a_map_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(dreba.ModelError) as error:
        dreba.export_model(model("convex"), tmp_path / "cost", to="c", joint_map=tmp_path / "none.toml")
    says(error, "none.toml", "cannot be read")
    assert list(tmp_path.iterdir()) == []
