"""The table of assumptions: every row is what scoring the changed recording gives."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

import reba
from reba.analysis.exposure import durations, level_shares
from reba.report.what_if import AS_RECORDED, LOADS, SUPPORTS, what_if
from tests.reba.report.test_report import frames

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
