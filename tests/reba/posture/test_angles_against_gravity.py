"""Upper arm angles against the vertical."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import reba
from reba.posture.angles import against_gravity
from reba.posture.columns import INDEX

FORWARD, UP, RIGHT = np.eye(3)  # x, y, z


def turned(**angles: float) -> dict[str, float]:
    """Return the upper arm angles against gravity of a posture given by some of its angles."""
    columns = np.zeros((len(reba.COLUMNS), 1))
    for name, value in angles.items():
        columns[INDEX[name], 0] = value
    against_gravity(columns)
    names = [column for column in reba.COLUMNS if column.startswith(("upper_arm_flexion", "upper_arm_abduction"))]
    return {name.removeprefix("upper_arm_"): float(columns[INDEX[name], 0]) for name in names}


@pytest.mark.parametrize("inclination", [-40.0, 0.0, 20.0, 60.0, 90.0, 120.0])
def test_arms_that_hang(inclination: float) -> None:
    arms = {"upper_arm_flexion_left": inclination, "upper_arm_flexion_right": inclination}
    assert list(turned(trunk_flexion=inclination, **arms).values()) == pytest.approx([0.0] * 4, abs=1e-9)


def test_arms_along_a_bent_trunk() -> None:
    found = turned(trunk_flexion=60.0)
    assert found == pytest.approx(
        {"flexion_left": -60.0, "flexion_right": -60.0, "abduction_left": 0.0, "abduction_right": 0.0}
    )


def test_side_bend_abducts_the_lower_arm_of_the_other_side() -> None:
    """Bent 30 deg to the right, arms along the trunk: the left arm points to the body's left of the vertical."""
    found = turned(trunk_side_bend=30.0)
    assert found["abduction_left"] == pytest.approx(30.0)
    assert found["abduction_right"] == pytest.approx(-30.0)


def test_upright_trunk_changes_nothing() -> None:
    rng = np.random.default_rng(5)
    for twist in (0.0, 35.0, -80.0):
        columns = np.zeros((len(reba.COLUMNS), 50))
        columns[INDEX["trunk_twist"]] = twist
        for side in ("left", "right"):
            columns[INDEX[f"upper_arm_flexion_{side}"]] = rng.uniform(-170, 170, 50)
            columns[INDEX[f"upper_arm_abduction_{side}"]] = rng.uniform(-80, 80, 50)
        before = columns.copy()
        against_gravity(columns)
        np.testing.assert_allclose(columns, before, atol=1e-9)


@pytest.mark.parametrize("side", ["left", "right"])
def test_against_rotation_matrices(side: str) -> None:
    """The angle to the vertical, which needs no axis convention, is that of the turned arm."""
    rng = np.random.default_rng(6)
    outward = -RIGHT if side == "left" else RIGHT
    for _ in range(200):
        flexion, bend, twist, raised, abducted = rng.uniform(-70, 70, 5)
        # Twist about the trunk's own axis, then bend to the right, then incline forward (all in world axes).
        trunk = Rotation.from_rotvec(-np.radians(flexion) * RIGHT) * Rotation.from_rotvec(np.radians(bend) * FORWARD)
        trunk = trunk * Rotation.from_rotvec(np.radians(twist) * UP)
        f, a = np.radians(raised), np.radians(abducted)
        arm = np.cos(a) * (np.sin(f) * FORWARD - np.cos(f) * UP) + np.sin(a) * outward
        world = trunk.apply(arm)
        angles = {"trunk_flexion": flexion, "trunk_side_bend": bend, "trunk_twist": twist}
        angles |= {f"upper_arm_flexion_{side}": raised, f"upper_arm_abduction_{side}": abducted}
        found = turned(**angles)
        f, a = np.radians(found[f"flexion_{side}"]), np.radians(found[f"abduction_{side}"])
        assert np.cos(a) * np.cos(f) == pytest.approx(-world @ UP, abs=1e-9)


def test_unmeasured_angles_stay_unmeasured() -> None:
    found = turned(trunk_flexion=np.nan)
    assert all(np.isnan(value) for value in found.values())
    found = turned(upper_arm_flexion_left=np.nan)
    assert np.isnan(found["flexion_left"])
    assert found["flexion_right"] == pytest.approx(0.0)


def test_rules_use_it() -> None:
    row = np.zeros((1, len(reba.COLUMNS)))
    for name in ("trunk_flexion", "upper_arm_flexion_left", "upper_arm_flexion_right"):
        row[0, INDEX[name]] = 60.0
    assert reba.score_array(row).upper_arm_left[0] == 3
    gravity = reba.Rules(upper_arm_reference="gravity")
    assert reba.score_array(row, None, gravity).upper_arm_left[0] == 1
    row[0, INDEX["trunk_flexion"]] = np.nan
    arrays = reba.score_array(row, None, gravity)
    assert arrays.upper_arm_left[0] == 255
    assert arrays.reba_low[0] <= arrays.reba_high[0]
