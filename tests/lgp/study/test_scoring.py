"""Measures of recordings and cells: time weights, sided parts, missing cells, warnings."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from lgp.study.analysis import analyse
from lgp.study.labels import Label
from lgp.study.recordings import Sources
from lgp.study.scoring import SIDED, TOTAL, Scored, cells, limitations, missing_cells, part_scores, row
from reba.scores import score
from tests.support.studies import CONDITIONS, table


def test_trials_weigh_by_their_seconds_and_people_do_not() -> None:
    recordings = table(0.0, people=2)
    again = recordings.iloc[[0]].assign(trial="2", seconds=3 * recordings["seconds"].iloc[0], reba=10.0)
    found = cells(pd.concat([recordings, again]))
    first = found.iloc[0]
    assert first[TOTAL] == pytest.approx((recordings[TOTAL].iloc[0] + 3 * 10.0) / 4)
    assert first["trials"] == 2
    assert first["seconds"] == pytest.approx(4 * recordings["seconds"].iloc[0])
    assert len(found) == 4


def test_warnings_name_short_unlike_and_mixed_recordings() -> None:
    recordings = table(0.5)
    recordings.loc[0, "seconds"] = 1.0
    recordings.loc[0, "simulated"] = True
    unmeasured = {name: ("neck_flexion",) if name == recordings["input"][3] else () for name in recordings["input"]}
    truncated = {recordings["input"][2]: "at byte 12"}
    scored = Scored(recordings, {}, unmeasured, (), {}, (), truncated)
    text = " | ".join(limitations(scored, analyse(cells(recordings), CONDITIONS), cells(recordings)))
    assert "1 of 20 recordings are simulated" in text
    assert "1 of 20 recordings lack neck_flexion" in text
    assert "p00_ergonomic: 1.0 s, less than half" in text
    assert "p01_ergonomic: the recording is truncated: at byte 12" in text


def test_no_missing_cells() -> None:
    recordings = table(0.0, people=2)
    labels = [(one.input, Label(one.participant, one.condition)) for one in recordings.itertuples()]
    assert missing_cells(Sources(tuple(labels)), Scored(recordings, {}, {}, (), {}, ()), CONDITIONS) == []


def test_a_row_is_weighted_by_time() -> None:
    frames = pd.DataFrame({"time": [0.0, 0.1, 0.2, 0.3, 0.7], "trunk_flexion": [0, 0, 0, 70.0, 0], "load": 7.0})
    found = row("x", Label("p", "c"), score(frames, missing="neutral", activity="none"))
    # The fourth frame stands for 0.4 of 0.8 s, the last for one period of 0.1 s.
    assert found["seconds"] == pytest.approx(0.8)
    assert found["trunk"] == pytest.approx((0.4 * 1 + 0.4 * 4), abs=0.6)
    scores = score(frames, missing="neutral", activity="none").data
    weights = np.array([0.1, 0.1, 0.1, 0.4, 0.1])
    assert found[TOTAL] == pytest.approx(np.average(scores["reba"].to_numpy(float), weights=weights))
    assert found["trunk"] == pytest.approx(np.average(scores["trunk"].to_numpy(float), weights=weights))
    assert found["load_force"] == pytest.approx(1.0)
    assert found["reba_low"] < found["reba_high"]
    assert found["determined"] == 0.0


def test_parts_are_those_of_the_arm_that_gives_the_total() -> None:
    columns = {name: np.ones(3) for name in ("load_force", "trunk", "neck", "legs", "activity")}
    for name in SIDED:
        columns |= {f"{name}_left": np.array([1.0, 1.0, 1.0]), f"{name}_right": np.array([3.0, 3.0, 3.0])}
    columns |= {"reba_left": np.array([5.0, 2.0, 4.0]), "reba_right": np.array([2.0, 5.0, 4.0])}
    assert part_scores(columns)["wrist"].tolist() == [1.0, 3.0, 2.0]
    assert part_scores(columns, "right")["wrist"].tolist() == [3.0, 3.0, 3.0]
    assert part_scores(columns, "left")["wrist"].tolist() == [1.0, 1.0, 1.0]
