"""Tests, effect sizes and assumptions against known answers and against their definitions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize, stats
from statsmodels.stats.power import TTestPower

from lgp.statistics.effect_sizes import effect_size, friedman, normality, sphericity, within_errors
from lgp.statistics.formatting import p_text
from lgp.statistics.paired_tests import compare
from lgp.study.analysis import analyse
from lgp.study.labels import Label
from lgp.study.recordings import Failure, Sources
from lgp.study.scoring import (
    DEMANDING,
    LEVELS,
    PARTS,
    SIDED,
    TOTAL,
    Scored,
    cells,
    missing_cells,
    part_scores,
    row,
    warnings,
)
from lgp.study.study import summarise
from reba.scores import score

CONDITIONS = ("ergonomic", "non-ergonomic")


def table(
    gap: float, people: int = 10, seed: int = 0, conditions: tuple[str, ...] = CONDITIONS, same: tuple[str, ...] = ()
) -> pd.DataFrame:
    """Return scored recordings whose last condition is `gap` points worse in everything but the parts in `same`."""
    rng = np.random.default_rng(seed)
    rows = []
    for person in range(people):
        base = rng.normal(4.0, 1.0)
        for place, condition in enumerate(conditions):
            worse = gap * (place == len(conditions) - 1)
            values = {name: 2.0 if name in same else base + worse + rng.normal(0, 0.3) for name in (TOTAL, *PARTS)}
            rows.append(
                {
                    "participant": f"p{person:02}", "condition": condition, "trial": "", "simulated": False,
                    "input": f"p{person:02}_{condition}", "frames": 100, "seconds": rng.uniform(8, 10), **values,
                    "reba_low": values[TOTAL], "reba_high": values[TOTAL], "determined": 1.0, DEMANDING: 0.5,
                    **dict.fromkeys(LEVELS, 0.2), "level_undetermined": 0.0,
                }
            )  # fmt: skip
    return pd.DataFrame(rows)


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


def test_interval_of_the_effect_size_is_that_of_the_noncentral_t() -> None:
    differences = np.random.default_rng(1).normal(0.7, 1.0, 12)
    found = effect_size(differences)
    t = found.dz * np.sqrt(12)
    for end, tail in ((found.dz_low, 0.975), (found.dz_high, 0.025)):
        centre = optimize.brentq(lambda nc, tail=tail: stats.nct.cdf(t, 11, nc) - tail, -20, 20)
        assert end == pytest.approx(centre / np.sqrt(12), abs=1e-6)
    assert found.g / found.dz == pytest.approx(1 - 3 / (4 * 11 - 1), abs=1e-3)
    assert found.g_low / found.dz_low == pytest.approx(found.g / found.dz)


def test_effect_sizes_that_cannot_be_given() -> None:
    assert np.isnan(effect_size(np.array([1.0])).dz)
    assert np.isnan(effect_size(np.full(5, 2.0)).dz)
    assert effect_size(np.zeros(5)).dz == 0.0
    assert effect_size(np.array([1.0, 2.0])).g == 0.0


@settings(max_examples=30, deadline=None)
@given(st.integers(3, 12), st.integers(0, 10_000))
def test_within_errors_ignore_who_is_high(people: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(people, 2))
    raised = values + rng.normal(0, 50, (people, 1))
    expected = np.std(values[:, 0] - values[:, 1], ddof=1) / np.sqrt(2 * people)
    assert within_errors(values) == pytest.approx([expected] * 2)
    assert within_errors(raised) == pytest.approx(within_errors(values), rel=1e-6)


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


def test_sphericity_is_mauchlys() -> None:
    rng = np.random.default_rng(5)
    values = rng.normal(size=(15, 3)) * [1.0, 1.0, 6.0]
    contrasts = np.array([[1, -1, 0], [1, 1, -2]]) / np.sqrt([[2], [6]])
    covariance = np.cov(values @ contrasts.T, rowvar=False)
    w = np.linalg.det(covariance) / (np.trace(covariance) / 2) ** 2
    chi = -(14 - (2 * 4 + 2 + 2) / 12) * np.log(w)
    found = sphericity(values)
    assert found is not None
    assert found.statistic == pytest.approx(chi)
    assert found.p == pytest.approx(stats.chi2.sf(chi, 2))
    assert found.p < 0.001
    assert sphericity(values[:, :2]) is None
    assert friedman(values[:, :2]) is None


def test_checks_without_data_say_nan() -> None:
    assert np.isnan(normality(np.array([1.0, 2.0])).p)
    assert np.isnan(normality(np.full(8, 1.0)).p)
    flat = sphericity(np.ones((8, 3)))
    assert flat is not None
    assert np.isnan(flat.p)
    ranks = friedman(np.ones((8, 3)))
    assert ranks is not None
    assert np.isnan(ranks.p)


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
    assert any("5 pairs" in warning and "cannot reach p < .05" in warning for warning in five["warnings"])


def test_one_condition_and_zero_variance() -> None:
    recordings = table(0.0)
    alone = summary_of(recordings[recordings["condition"] == CONDITIONS[0]])
    assert alone["verdict"].startswith("There is only one condition, ergonomic")
    assert alone[TOTAL]["anova"] is None
    recordings[TOTAL] = 3.0
    assert "is the same with" in summary_of(recordings)["verdict"]
    recordings.loc[recordings["condition"] == CONDITIONS[1], TOTAL] = 4.0
    assert "zero variance" in summary_of(recordings)["verdict"]


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
    text = " | ".join(warnings(scored, analyse(cells(recordings), CONDITIONS), cells(recordings)))
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


def test_p_values_in_words() -> None:
    assert [p_text(p) for p in (0.5, 0.0451, 1e-9, None)] == ["p = .500", "p = .045", "p < .001", "p not defined"]


@pytest.mark.parametrize("gap", [0.0, 0.35])
def test_error_rates_over_many_studies(gap: float) -> None:
    """5 % without an effect, the power that theory gives with one, by both tests."""
    studies, deviation = 300, 0.3 * np.sqrt(2)
    rng = np.random.default_rng(11)
    p = []
    for differences in rng.normal(-gap, deviation, (studies, 10)):
        base = rng.normal(4.0, 1.0, 10)
        one = compare(pd.DataFrame({"a": base + differences, "b": base}), [("a", "b")])[0]
        p.append((one.p, one.wilcoxon_p))
    expected = TTestPower().power(gap / deviation, 10, 0.05) if gap else 0.05
    found = (np.array(p) < 0.05).sum(axis=0)
    assert stats.binomtest(int(found[0]), studies, expected).pvalue > 0.001
    # Signed ranks of ten pairs come in steps: at most 5 %, and with an effect a few per cent less power.
    assert stats.binomtest(int(found[1]), studies, expected - (0.05 if gap else 0.0)).pvalue > 0.001
