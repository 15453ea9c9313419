"""Analysis and conclusions of studies with known effects."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from lgp.study.analysis import analyse
from lgp.study.labels import Label
from lgp.study.recordings import Failure, Sources
from lgp.study.scoring import (
    PARTS,
    TOTAL,
    Scored,
    cells,
)
from lgp.study.study import summarise
from tests.support.studies import CONDITIONS, table


def summary_of(recordings: pd.DataFrame, failed: tuple[Failure, ...] = (), **extra: Any) -> dict[str, Any]:
    """Return the summary of scored recordings, as `run_study` makes it."""
    labels = [Label(one.participant, one.condition, one.trial) for one in recordings.itertuples()]
    sources = Sources(tuple(zip(recordings["input"], labels, strict=True)), **extra)
    scored = Scored(recordings, {}, dict.fromkeys(recordings["input"], ()), (), {"name": "measured"}, failed)
    order = list(dict.fromkeys([*recordings["condition"]]))
    return summarise(sources, scored, cells(recordings), order)


def test_a_known_effect_is_found_and_none_is_not() -> None:
    found = summary_of(table(1.0, same=("coupling",)))
    (pair,) = found[TOTAL]["pairs"]
    assert pair["low"] < -1.0 < pair["high"] < 0.0
    assert pair["p"] < 1e-4
    assert pair["wilcoxon_p"] == pytest.approx(2 / 2**10)
    assert pair["lower"] == 10
    assert found["verdict"].startswith("The mean REBA score is ")
    assert " lower with ergonomic than with non-ergonomic" in found["verdict"]
    assert found["parts"]["coupling"]["constant"]
    assert found["parts"]["coupling"]["pairs"][0]["p_holm"] is None
    assert "without any difference and not tested: coupling" in found["parts_verdict"]
    assert found[TOTAL]["anova"]["f"] == pytest.approx(pair["t"] ** 2)


def test_differences_that_cancel_are_none() -> None:
    recordings = table(0.0)
    first = recordings["condition"] == CONDITIONS[0]
    recordings.loc[first, TOTAL] = recordings.loc[~first, TOTAL].to_numpy() + np.resize([0.2, -0.2, 0.1, -0.1], 10)
    found = summary_of(recordings)
    assert found["verdict"].startswith("No difference is shown: the mean REBA score is 0.")
    assert found[TOTAL]["pairs"][0]["p"] > 0.5


def test_p_values_of_parts_are_corrected_together() -> None:
    found = analyse(cells(table(0.2, same=("legs",))), CONDITIONS)
    family = [found["parts"][name]["pairs"][0] for name in PARTS if name != "legs"]
    ordered = sorted(family, key=lambda pair: pair["p"])
    assert ordered[0]["p_holm"] == pytest.approx(min(1.0, ordered[0]["p"] * len(family)))
    assert ordered[1]["p_holm"] == pytest.approx(max(ordered[0]["p_holm"], ordered[1]["p"] * (len(family) - 1)))
    reference = stats.ttest_rel(*(by(found, name) for name in CONDITIONS))
    assert found[TOTAL]["pairs"][0]["p"] == pytest.approx(reference.pvalue)


def by(found: dict[str, Any], condition: str) -> list[float]:
    """Return the total of every participant in a condition."""
    return [row[condition] for row in found[TOTAL]["participants"].values()]


def test_three_conditions_with_their_assumptions() -> None:
    names = ("a", "b", "c")
    found = summary_of(table(1.0, conditions=names))
    assert len(found[TOTAL]["pairs"]) == 3
    assert found["verdict"].startswith("The mean REBA score differs between the 3 conditions")
    assert "a below c" in found["verdict"]
    assert found[TOTAL]["sphericity"]["p"] > 0.05
    values = np.array([list(row.values()) for row in found[TOTAL]["participants"].values()])
    assert found[TOTAL]["friedman"]["p"] == pytest.approx(stats.friedmanchisquare(*values.T).pvalue)
    assert 0.5 <= found[TOTAL]["anova"]["epsilon"] <= 1.0


def test_who_lacks_a_condition_is_left_out_and_named() -> None:
    recordings = table(1.0)
    gone = (recordings["participant"] == "p03") & (recordings["condition"] == CONDITIONS[1])
    failure = Failure("x.mcap", "x.mcap: damaged", Label("p04", CONDITIONS[0]))
    lost = (recordings["participant"] == "p04") & (recordings["condition"] == CONDITIONS[0])
    found = summary_of(recordings[~gone & ~lost], (failure,), absent=(Label("p11", CONDITIONS[0]),))
    (pair,) = found[TOTAL]["pairs"]
    assert pair["n"] == 8
    assert pair["left_out"] == ["p03", "p04"]
    assert found["incomplete"] == ["p03", "p04", "p11"]
    why = {(one["participant"], one["condition"]): one["why"] for one in found["missing"]}
    assert why["p03", CONDITIONS[1]] == "no recording"
    assert why["p04", CONDITIONS[0]] == "cannot be used: x.mcap: damaged"
    assert why["p11", CONDITIONS[0]] == "planned, no recording given"
    assert found[TOTAL]["conditions"][CONDITIONS[0]]["n"] == 9


def test_few_people() -> None:
    alone = summary_of(table(1.0, people=1))
    assert alone["verdict"].startswith("No test can be made: 1 participant ")
    assert alone[TOTAL]["pairs"][0]["p"] is None
    five = summary_of(table(1.0, people=5))
    assert any("5 pairs" in warning and "cannot reach p < 0.05" in warning for warning in five["warnings"])


def test_one_condition_and_zero_variance() -> None:
    recordings = table(0.0)
    alone = summary_of(recordings[recordings["condition"] == CONDITIONS[0]])
    assert alone["verdict"].startswith("There is only one condition, ergonomic")
    assert alone[TOTAL]["anova"] is None
    recordings[TOTAL] = 3.0
    assert "is the same with" in summary_of(recordings)["verdict"]
    recordings.loc[recordings["condition"] == CONDITIONS[1], TOTAL] = 4.0
    assert "zero variance" in summary_of(recordings)["verdict"]
