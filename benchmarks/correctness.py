"""Share of postures for which another package's REBA score differs from the tables of the paper, and their angles.

    python benchmarks/correctness.py [--json FILE] [--postures 20000] [--seed 20260101]

Postures are drawn uniformly over the joint limits of the domain `human`, with a load of 0, 5 or 12 kg. Both get the
same binary inputs (twisted, raised, abducted), no coupling and no activity; both arms are scored, and the worse one is
the result. A score is counted as different if it differs from both interpretations of "upright" in the paper: within 5
degrees, as in the preset `measured`, and exactly 0 degrees. `ergonomics-metrics` is the only package with a REBA score
that pip installs.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from machine import machine, stamp
from numpy.typing import NDArray

import dreba
import reba

SIDES = ("left", "right")
READINGS = (reba.Rules(), reba.Rules(trunk_upright=0.0, neck_upright=0.0))
LOADS = (0.0, 5.0, 12.0)
PARTS = {
    "neck": ("neck_flexion",),
    "trunk": ("trunk_flexion",),
    "legs": ("knee_flexion_left", "knee_flexion_right"),
    "load_force": ("load",),
    "upper_arm": ("upper_arm_flexion",),
    "lower_arm": ("lower_arm_flexion",),
    "wrist": ("wrist_flexion",),
}
"""Part -> columns of its score besides the binary inputs, which are equal for both."""

Array = NDArray[np.float64]


def main() -> None:
    """Score random postures with both packages and print the differences."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--postures", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=20260101)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    domain = dreba.domain_of("human")
    angles = rng.uniform(domain.low, domain.high, (options.postures, len(reba.COLUMNS)))
    load = rng.choice(LOADS, options.postures)
    table = compare(angles, load)
    if table is None:
        parser.exit(1, "ergonomics-metrics is not installed; pip install ergonomics-metrics\n")
    print(f"{stamp()}; {options.postures:,} postures, ergonomics-metrics against reba")
    print(f"{'score':12}{'differs':>9}  where")
    for row in table:
        print(f"{row['score']:12}{row['share']:9.1%}  {row['where']}")
    if options.json:
        figures = {"machine": machine(), "postures": options.postures, "seed": options.seed, "rows": table}
        options.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


def compare(angles: Array, load: Array) -> list[dict[str, Any]] | None:
    """One row for the final score and each part: share of differences and their angles; None without the package."""
    theirs = peer(angles, load)
    if theirs is None:
        return None
    values = {name: angles[:, column] for column, name in enumerate(reba.COLUMNS)} | {"load": load}
    ours = [exact(angles, load, rules) for rules in READINGS]
    rows = []
    for name in ("reba", *PARTS):
        differs = np.all([one[name] != theirs[name] for one in ours], axis=0)
        where = "" if name == "reba" else _where(name, differs, values, theirs[name], ours[0][name])
        rows.append({"score": name, "share": float(differs.mean()), "where": where})
    return rows


def exact(angles: Array, load: Array, rules: reba.Rules) -> dict[str, Array]:
    """Final score and part scores of `reba`, (n,) or (n, 2) for both arms."""
    scores = reba.score_array(angles, {"load": load}, rules)
    columns: dict[str, Array] = {"reba": np.asarray(scores.reba)}
    for part in PARTS:
        sided = [f"{part}_{side}" for side in SIDES]
        columns[part] = scores[part] if part in ("neck", "trunk", "legs", "load_force") else _both(scores, sided)
    return columns


def _both(scores: Any, names: list[str]) -> Array:
    return np.stack([scores[name] for name in names], axis=1)


def peer(angles: Array, load: Array) -> dict[str, Array] | None:
    """The same of ergonomics-metrics; its load score is the difference of Score A with and without load."""
    try:
        from ergonomics.reba import RebaScore
    except ImportError:
        return None
    at = {name: column for column, name in enumerate(reba.COLUMNS)}
    rules = READINGS[0]
    bent = {
        part: (np.abs(angles[:, at[f"{part}_twist"]]) > getattr(rules, f"{part}_twist"))
        | (np.abs(angles[:, at[f"{part}_side_bend"]]) > getattr(rules, f"{part}_side_bend"))
        for part in ("neck", "trunk")
    }
    score = RebaScore()
    count = len(angles)
    columns: dict[str, Array] = {name: np.zeros(count) for name in ("reba", "neck", "trunk", "legs", "load_force")}
    columns |= {name: np.zeros((count, 2)) for name in ("upper_arm", "lower_arm", "wrist")}
    for row, posture in enumerate(angles):
        knee = max(posture[at["knee_flexion_left"]], posture[at["knee_flexion_right"]])
        body = [posture[at["neck_flexion"]], bent["neck"][row], posture[at["trunk_flexion"]], bent["trunk"][row]]
        score.set_body([*body, False, knee, 0.0])
        without, parts = score.compute_score_a()
        score.set_body([*body, False, knee, load[row]])
        score_a, _ = score.compute_score_a()
        columns["neck"][row], columns["trunk"][row], columns["legs"][row] = parts
        columns["load_force"][row] = score_a - without
        finals = []
        for number, side in enumerate(SIDES):
            arm = {name: posture[at[f"{name}_{side}"]] for name in ARM}
            raised, abducted = (
                arm["shoulder_elevation"] > rules.shoulder_elevation,
                arm["upper_arm_abduction"] > rules.abduction,
            )
            turned = abs(arm["wrist_deviation"]) > rules.wrist_deviation or abs(arm["wrist_twist"]) > rules.wrist_twist
            score.set_arms(
                [
                    arm["upper_arm_flexion"],
                    raised,
                    abducted,
                    False,
                    arm["lower_arm_flexion"],
                    arm["wrist_flexion"],
                    turned,
                ]
            )
            score_b, parts = score.compute_score_b()
            for name, value in zip(("upper_arm", "lower_arm", "wrist"), parts, strict=True):
                columns[name][row, number] = value
            finals.append(score.compute_score_c(score_a, score_b)[0])
        columns["reba"][row] = max(finals)
    return columns


ARM = (
    "upper_arm_flexion", "upper_arm_abduction", "shoulder_elevation", "lower_arm_flexion", "wrist_flexion",
    "wrist_deviation", "wrist_twist",
)  # fmt: skip


def _where(part: str, differs: NDArray[np.bool_], values: dict[str, Array], theirs: Array, ours: Array) -> str:
    """Range of the angle or load in which a part differs, for each pair of its score and the expected one."""
    if not differs.any():
        return "nowhere"
    if part == "legs":
        cause = np.maximum(values["knee_flexion_left"], values["knee_flexion_right"])
    elif differs.ndim == 2:
        cause = np.stack([values[f"{PARTS[part][0]}_{side}"] for side in SIDES], axis=1)
    else:
        cause = values[PARTS[part][0]]
    unit = "kg" if part == "load_force" else "deg"
    ranges = []
    for pair in sorted({(int(a), int(b)) for a, b in zip(theirs[differs], ours[differs], strict=True)}):
        rows = differs & (theirs == pair[0]) & (ours == pair[1])
        ranges.append(f"{cause[rows].min():.0f} to {cause[rows].max():.0f} {unit}: {pair[0]}, not {pair[1]}")
    return f"{' and '.join(PARTS[part])}: {'; '.join(ranges)}"


if __name__ == "__main__":
    main()
