"""The table of assumptions: every row is what scoring the changed recording gives."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest

import reba
from reba.analysis.exposure import durations, level_shares
from reba.report.what_if import AS_RECORDED, LOADS, SUPPORTS, what_if
from tests.reba.report.test_report import frames
from tests.support.paths import DATASETS, RECORDINGS

LIMITS = {"within 20 deg": (-20.0, 20.0), "up to 45 deg": (-180, 45.0), "up to 60 deg": (-180, 60.0),
          "up to 90 deg": (-180, 90.0)}  # fmt: skip


@pytest.mark.parametrize("without", ["^$", "wrist|neck_twist"])
def test_every_row_is_that_of_the_changed_recording(without: str) -> None:
    data = frames(120, without=without)
    kinds = {kind: getattr(reba.score(data).factors, kind) for kind in ("static", "repeated", "unstable")}
    scores = reba.score(data, load=6.0, **kinds)
    table = what_if(scores, durations(scores.time))
    assert [values[0] for values in table.settings.values()] == [AS_RECORDED] * 5
    combinations = list(itertools.product(*table.settings.values()))
    assert len(combinations) == len(table.shares)
    np.testing.assert_allclose(table.shares[:, :6].sum(axis=1), 1.0)
    rng = np.random.default_rng(3)
    for row in [0, *rng.choice(len(combinations), 40, replace=False)]:
        trunk, arms, load, grip, support = combinations[row]
        changed = data.copy()
        if trunk != AS_RECORDED:
            changed["trunk_flexion"] = changed["trunk_flexion"].clip(*LIMITS[trunk])
        for side in ("left", "right") if arms != AS_RECORDED else ():
            changed[f"upper_arm_flexion_{side}"] = changed[f"upper_arm_flexion_{side}"].clip(*LIMITS[arms])
        factors = {
            "load": 6.0 if load == AS_RECORDED else LOADS[load],
            "coupling": "good" if grip == AS_RECORDED else grip,
            "support": "bilateral" if support == AS_RECORDED else SUPPORTS[support],
        }
        again = reba.score(changed, **factors, **kinds)
        high = [durations(again.time)[again.data[f"reba_{end}"] >= 8].sum() / 12 for end in ("low", "high")]
        expected = [*level_shares(again).values(), *high]
        np.testing.assert_allclose(table.shares[row], expected, atol=1e-9, err_msg=str(combinations[row]))


def test_the_page_gets_the_table_in_whole_numbers() -> None:
    scores = reba.score(frames(50), activity="none")
    table = what_if(scores, durations(scores.time))
    packed = table.packed()
    assert [name for name, _ in packed["settings"]] == list(table.settings)
    assert dataclasses.asdict(table)["settings"] == table.settings


@pytest.mark.parametrize(
    ("path", "load", "coupling"),
    [
        (DATASETS / "simulated_palletising.mcap", 8.0, "fair"),
        (RECORDINGS / "box_lift_xsens_bvh" / "MotionBox_XSens.bvh", 9.0, "good"),
        (RECORDINGS / "irsst_box_lift" / "markers_analogs.c3d", 7.0, "good"),
    ],
    ids=lambda value: getattr(value, "stem", ""),
)
def test_states_of_the_sliders_are_the_scores_of_changed_recordings(path: Path, load: float, coupling: str) -> None:
    if not path.exists():
        pytest.skip(f"{path.name} is not on this machine")
    postures = reba.read(path)
    scores = reba.score(postures, load=load, coupling=coupling)
    weights = durations(scores.time)
    table = what_if(scores, weights)
    kinds = {kind: getattr(scores.factors, kind) for kind in ("static", "repeated", "unstable")}
    combinations = list(itertools.product(*table.settings.values()))
    rng = np.random.default_rng(11)
    for row in [0, *rng.choice(len(combinations), 24, replace=False)]:
        trunk, arms, mass, grip, support = combinations[row]
        changed = postures.data.copy()
        limited = {"trunk_flexion": trunk, "upper_arm_flexion_left": arms, "upper_arm_flexion_right": arms}
        for column, limit in limited.items():
            if column in changed and limit != AS_RECORDED:
                changed[column] = changed[column].clip(*LIMITS[limit])
        again = reba.score(
            changed.assign(**{kind: np.broadcast_to(flags, len(changed)) for kind, flags in kinds.items()}),
            load=load if mass == AS_RECORDED else LOADS[mass],
            coupling=coupling if grip == AS_RECORDED else grip,
            support=scores.factors.support if support == AS_RECORDED else SUPPORTS[support],
        )
        high = [weights[again.data[f"reba_{end}"] >= 8].sum() / weights.sum() for end in ("low", "high")]
        np.testing.assert_allclose(table.shares[row, 6:], high, atol=1e-9, err_msg=str(combinations[row]))
