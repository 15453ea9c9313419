"""The verdict: one pattern, its figures those of the scores, ties told as ties, and open shares as ranges."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest

import reba
from reba.analysis.exposure import durations
from reba.posture.columns import BEST, COLUMNS
from tests.support.paths import DATASETS


def still(n: int, hz: float = 1.0, **angles: float | np.ndarray) -> pd.DataFrame:
    """Return n neutral frames with some angles changed."""
    data = {"time": np.arange(n) / hz} | {name: np.full(n, BEST[name]) for name in COLUMNS}
    return pd.DataFrame(data | {name: np.broadcast_to(value, n) for name, value in angles.items()})


def text_of(frames: pd.DataFrame, **factors: object) -> str:
    return str(reba.score(frames, activity="none", **factors).summary()["verdict"]["text"])


def test_the_demo() -> None:
    scores = reba.score(reba.read(DATASETS / "simulated_palletising.mcap"), load=8, coupling="fair")
    verdict = scores.summary()["verdict"]
    assert verdict["text"] == (
        "High risk. 90th percentile REBA 9; 34 s (19 %) at REBA 8 or more; worst at 28 s, 65 s, 103 s; "
        "main cause: trunk bent over 60 degrees."
    )
    seconds = durations(scores.time)[scores.data["reba"].to_numpy(float) >= 8].sum()
    assert verdict["high_seconds"] == pytest.approx([seconds, seconds])


def test_causes_that_tie_are_told_as_a_tie() -> None:
    # A(3, 2, 1) = 4 and 1 for the load: C(5, 1) = 4, medium. Without any one of the three it is low.
    text = text_of(still(20, trunk_flexion=30.0, neck_flexion=30.0), load=6.0)
    causes = "trunk bent 20 to 60 degrees, neck bent over 20 degrees and a load of 6 kg"
    assert f"main causes, equal: {causes} (of REBA 4 or more)." in text


@pytest.mark.parametrize(
    ("angles", "factors", "cause"),
    [
        (
            {"trunk_flexion": -30.0, "knee_flexion_left": 70.0, "neck_twist": 30.0},
            {"load": 12.0},
            "trunk bent backwards",
        ),
        ({"lower_arm_flexion_left": 20.0}, {"load": 12.0, "coupling": "poor"}, "a load of 12 kg"),
        ({"knee_flexion_right": 80.0, "trunk_flexion": 15.0}, {"support": "unilateral"}, "knees bent over 60 degrees"),
        ({"trunk_flexion": 70.0}, {}, "trunk bent over 60 degrees"),
        ({}, {"load": 12.0, "shock": True}, "a load of 12 kg"),
    ],
)
def test_the_cause_is_named_by_its_class(angles: dict[str, float], factors: dict[str, object], cause: str) -> None:
    assert cause in text_of(still(20, **angles), **factors)


def test_times_below_high_risk_are_not_named_beside_it() -> None:
    frames = still(200, trunk_flexion=30.0)
    bent = np.repeat([0.0, 1.0, 0.0, 0.5, 0.0], 40)
    frames["trunk_flexion"] = 10.0 + 60.0 * bent
    frames["upper_arm_flexion_left"] = 100.0 * (bent == 1.0)
    frames["knee_flexion_left"] = 70.0 * (bent == 1.0)
    found = re.search(r"at REBA 8 or more; worst at ([\d., s]+);", text_of(frames, load=12.0))
    assert found is not None
    assert len(found[1].split(",")) == 1, found[1]


def test_without_high_risk_the_pattern_stays() -> None:
    text = text_of(still(20, trunk_flexion=30.0, neck_flexion=30.0))
    assert re.fullmatch(
        r"(Low|Medium) risk\. 90th percentile REBA \d; no time at REBA 8 or more; worst at [\d, s]+; "
        r"main causes?.*: .+ \(of REBA \d or more\)\.", text
    ), text  # fmt: skip
    assert text_of(still(20)).startswith("Negligible risk. 90th percentile REBA 1; no time at REBA 8 or more")
    assert text_of(still(0)) == "No frames, so there is no score."


def test_what_is_open_is_part_of_every_share() -> None:
    frames = still(100, trunk_flexion=65.0, neck_flexion=30.0, knee_flexion_left=70.0, upper_arm_flexion_left=50.0)
    frames = frames.drop(columns=[name for name in COLUMNS if name.startswith("wrist")])
    frames.loc[60:, "trunk_flexion"] = 0.0
    verdict = reba.score(frames, load=6.0, activity="none").summary()["verdict"]
    low, high = verdict["high_seconds"]
    ends = reba.score(frames, load=6.0, activity="none").data
    assert (low, high) == (float((ends["reba_low"] >= 8).sum()), float((ends["reba_high"] >= 8).sum()))
    assert verdict["text"].endswith("Ranges are what unmeasured angles leave.")
    for missing in ("neutral", "worst"):
        assert reba.score(frames, load=6.0, activity="none", missing=missing).summary()["verdict"] == verdict
