"""False positive rate and power of the tests of a study, without an effect and with effects of known size.

Usage: python benchmarks/study_nulls.py [--studies 1000] [--files 40] [--people 10] [--seed 0] [--json FILE]

Simulated studies of a planned motion (screwdriver scene, planned without ergonomics): persons of varying stature,
habit, speed and motor noise. Without an effect both conditions follow the same plan, and a test at 5 % must be
significant in 5 % of the studies. With an effect one condition has some degrees more trunk flexion in every frame; the
true difference of the mean REBA score is that of all simulated persons. `--files` studies include MCAP logs and `lgp
study`; the others score postures and loads without files and without activity points, whose criteria of a minute are
not met in these seconds. Intervals are Wilson's at 95 %.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # small matrices: threads only cost time
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from itertools import combinations, islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from machine import machine, stamp
from scipy.stats import binomtest
from statsmodels.stats.power import TTestPower

import lgp
import reba
from lgp.statistics.effect_sizes import friedman
from lgp.statistics.paired_tests import anova, compare
from lgp.study.retarget import Retarget
from lgp.study.scoring import PARTS, TOTAL, by_condition, part_scores
from lgp.study.simulate import simulate, simulated
from lgp.study.study import run_study

ALPHA = 0.05
RATE = 10.0
BATCH = 400
"""Recordings scored at once."""
LEANS = (4.0, 8.0, 16.0, 24.0)
"""Known effects: additional trunk flexion [deg]."""
FILE_LEAN = 24.0
"""Effect of the studies through files [deg]."""
HEIGHTS = {"left": 1.55, "center": 1.5, "right": 1.5}
"""High tables [m]: postures with scores above the minimum."""


def planned() -> lgp.Plan:
    """Plan that all participants follow."""
    return lgp.plan(lgp.load_scene("screwdriver").with_heights(HEIGHTS), None)


def population(retarget: Retarget, people: int, seed: int, leans: Mapping[str, float]) -> pd.DataFrame:
    """Participants x (measure, condition) of many persons, scored without files and without activity points.

    Args:
        retarget: the plan.
        people: number of persons.
        seed: of all draws.
        leans: condition -> degrees that the trunk leans forward more.
    """
    offsets = {name: {"trunk_flexion": degrees} for name, degrees in leans.items() if degrees}
    logs = simulated(dict.fromkeys(leans, retarget), participants=people, seed=seed, rate=RATE, offsets=offsets)
    rows: list[dict[str, Any]] = []
    while batch := list(islice(logs, BATCH)):
        angles = np.concatenate([log.movement.angles for log in batch])
        load = np.concatenate([log.movement.load for log in batch])
        scores = reba.score_array(angles, {"load": load}, "measured", "neutral")
        values = {TOTAL: np.asarray(scores[TOTAL], float), **part_scores(scores)}
        # Frames are equidistant: the mean over frames is the time-weighted mean.
        starts = np.cumsum([0, *(len(log.movement.time) for log in batch)])
        means = {name: np.diff(np.r_[0.0, np.cumsum(of)][starts]) / np.diff(starts) for name, of in values.items()}
        rows += [
            {"participant": log.label.participant, "condition": log.label.condition}
            | {name: of[index] for name, of in means.items()}
            for index, log in enumerate(batch)
        ]
    table = pd.DataFrame(rows)
    return pd.concat({name: by_condition(table, name, list(leans)) for name in (TOTAL, *PARTS)}, axis=1)


def split(table: pd.DataFrame, people: int) -> list[pd.DataFrame]:
    """Disjoint studies of `people` participants each."""
    return [table.iloc[first : first + people] for first in range(0, len(table) - people + 1, people)]


def decide(one: pd.DataFrame, conditions: Sequence[str]) -> dict[str, float]:
    """P values of a study by test, and difference and interval of the first pair."""
    pairs = list(combinations(conditions, 2))
    total = [compare(one[TOTAL], [pair])[0] for pair in pairs]
    first = total[0]
    decision = {"t": first.p, "ranks": first.wilcoxon_p, "difference": first.difference}
    decision |= {"low": first.low, "high": first.high, "any pair": least([pair.p for pair in total])}
    of_parts = [compare(one[part], [pair])[0] for part in PARTS for pair in pairs]
    decision["any part"] = least([pair.p for pair in of_parts if pair.ties < pair.n])
    if len(conditions) > 2:
        ranks = friedman(one[TOTAL].to_numpy(float))
        decision |= {"anova": anova(one[TOTAL]).p_corrected, "friedman": ranks.p if ranks else np.nan}
    return decision


def least(p: Sequence[float]) -> float:
    """Smallest p value after Holm: the smallest one times the number of tests; 1 without any test."""
    known = [value for value in p if np.isfinite(value)]
    return min([1.0, *(value * len(known) for value in known)])


def rate(p: Sequence[float]) -> dict[str, Any]:
    """Share of p values below 5 % with its interval."""
    return share(int(np.sum(np.asarray(p, float) < ALPHA)), len(p))


def share(count: int, n: int) -> dict[str, Any]:
    """Count as a share with its interval."""
    interval = binomtest(count, n).proportion_ci(method="wilson")
    return {"studies": n, "rate": count / n, "low": float(interval.low), "high": float(interval.high)}


def nulls(retarget: Retarget, studies: int, people: int, seed: int, conditions: int) -> dict[str, Any]:
    """False positive rates by test if all conditions are equal."""
    names = [f"c{number}" for number in range(conditions)]
    table = population(retarget, studies * people, seed, dict.fromkeys(names, 0.0))
    decisions = pd.DataFrame([decide(one, names) for one in split(table, people)])
    tests = ("anova", "friedman", "any pair", "any part") if conditions > 2 else ("t", "ranks", "any part")
    return {name: rate(decisions[name].tolist()) for name in tests}


def effects(retarget: Retarget, studies: int, people: int, seed: int) -> list[dict[str, Any]]:
    """Power, coverage of the interval and theoretical power by size of the effect."""
    rows = []
    for lean in LEANS:
        table = population(retarget, studies * people, seed, {"lean": lean, "plan": 0.0})
        differences = table[TOTAL]["lean"] - table[TOTAL]["plan"]
        true, dz = float(differences.mean()), float(differences.mean() / differences.std())
        decisions = pd.DataFrame([decide(one, ["lean", "plan"]) for one in split(table, people)])
        covered = int(((decisions["low"] <= true) & (true <= decisions["high"])).sum())
        rows.append(
            {
                "lean": lean, "true": true, "dz": dz, "t": rate(decisions["t"].tolist()),
                "ranks": rate(decisions["ranks"].tolist()), "theory": float(TTestPower().power(dz, people, ALPHA)),
                "coverage": share(covered, len(decisions)),
            }
        )  # fmt: skip
    return rows


def through_files(plan: lgp.Plan, studies: int, people: int, seed: int, lean: float) -> dict[str, Any]:
    """Rates over studies through MCAP logs and `lgp.study.study.run_study`."""
    offsets = {"lean": {"trunk_flexion": lean}}
    p, ranks = [], []
    for number in range(studies):
        with TemporaryDirectory() as folder:
            plans = {"lean": plan, "plan": plan}
            simulate(plans, folder, participants=people, seed=seed + number, rate=RATE, offsets=offsets)
            pair = run_study([folder]).summary[TOTAL]["pairs"][0]
            p.append(pair["p"])
            ranks.append(pair["wilcoxon_p"])
    return {"t": rate(p), "ranks": rate(ranks)}


def line(name: str, rates: Mapping[str, Any]) -> str:
    return f"{name:34}{rates['studies']:8d}{rates['rate']:8.3f}   {rates['low']:.3f} to {rates['high']:.3f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--studies", type=int, default=1000)
    parser.add_argument("--files", type=int, default=40)
    parser.add_argument("--people", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    begin = time.perf_counter()
    plan = planned()
    retarget = Retarget(plan)
    print(stamp())
    print(f"{options.people} people a study, {RATE:g} frames a second, tests at {ALPHA:.0%}\n")
    print(f"{'no effect: share that finds one':34}{'studies':>8}{'share':>8}   95 % interval")
    result: dict[str, Any] = {"machine": machine(), "people": options.people, "seed": options.seed, "null": {}}
    for conditions in (2, 3):
        rates = nulls(retarget, options.studies, options.people, options.seed, conditions)
        result["null"][conditions] = rates
        for name, one in rates.items():
            print(line(f"  {conditions} conditions, {name}", one))
    for lean in (0.0, FILE_LEAN) if options.files else ():
        rates = through_files(plan, options.files, options.people, options.seed + 10_000, lean)
        result[f"files_{lean:g}"] = rates
        for name, one in rates.items():
            print(line(f"  through MCAP, {lean:g} deg, {name}", one))
    print("\nknown effect: trunk leans forward more")
    print(f"{'deg':>5}{'true':>8}{'d_z':>7}{'power t':>9}{'theory':>8}{'ranks':>7}   truth in 95 % interval")
    result["effects"] = effects(retarget, options.studies, options.people, options.seed + 20_000)
    for one in result["effects"]:
        inside = one["coverage"]
        print(
            f"{one['lean']:5.1f}{one['true']:8.3f}{one['dz']:7.2f}{one['t']['rate']:9.3f}{one['theory']:8.3f}"
            f"{one['ranks']['rate']:7.3f}   {inside['rate']:.3f} ({inside['low']:.3f} to {inside['high']:.3f})"
        )
    result["seconds"] = time.perf_counter() - begin
    print(f"\n{result['seconds']:.0f} s")
    if options.json:
        options.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
