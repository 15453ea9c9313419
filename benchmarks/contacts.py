"""What it costs that bodies do not touch: the same sequence planned with bodies that may be in each other, and apart.

    python benchmarks/contacts.py [--draws N] [--phase-seconds 2 5] [--json FILE]

Table heights are drawn as in the screwdriver experiment; the sequence is given, with the centre table. Costs are those
of the motion, without time.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from machine import machine, stamp

import lgp

SEQUENCE = (
    "grasp(baxter.right, screwdriver)",
    "place(baxter.right, screwdriver, table.center)",
    "grasp(human.right_hand, screwdriver)",
)


def motion_cost(plan: lgp.Plan) -> float:
    """Return accelerations and ergonomics."""
    return float(plan.costs["acceleration"] + plan.costs["ergonomics"])


def measure(seconds: float, draws: int) -> dict[str, Any]:
    """Return what plans cost with bodies apart, in multiples of what they cost where bodies may overlap."""
    scene = lgp.load_scene("screwdriver", {"phase_seconds": seconds})
    ratios, overlaps, clean, spent = [], [], 0, []
    for seed in range(draws):
        drawn = scene.draw_heights(np.random.default_rng(seed))
        free = lgp.plan(drawn, sequence=SEQUENCE, collisions=False)
        begin = time.process_time()
        apart = lgp.plan(drawn, sequence=SEQUENCE)
        spent.append(time.process_time() - begin)
        if not (free.feasible and apart.feasible):
            continue
        ratios.append(motion_cost(apart) / motion_cost(free))
        overlaps.append(max((one["depth"] for one in free.audit["deepest"]), default=0.0))
        clean += bool(apart.audit["clean"])
    return {
        "phase_seconds": seconds,
        "draws": draws,
        "feasible": len(ratios),
        "clean": clean,
        "median": float(np.median(ratios)) if ratios else None,
        "largest": float(np.max(ratios)) if ratios else None,
        "overlap": float(np.median(overlaps)) if overlaps else None,
        "seconds": float(np.median(spent)),
    }


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=10)
    parser.add_argument("--phase-seconds", type=float, nargs="+", default=[2.0, 5.0])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = [measure(seconds, options.draws) for seconds in options.phase_seconds]
    print(stamp())
    print(
        f"{'phase':>6} {'plans':>7} {'clean':>6} {'apart / overlapping':>20} {'largest':>8} {'overlap':>8} {'CPU':>7}"
    )
    for row in rows:
        if row["median"] is None:
            print(f"{row['phase_seconds']:5g}s {0:3d}/{row['draws']:<3d}")
            continue
        print(
            f"{row['phase_seconds']:5g}s {row['feasible']:3d}/{row['draws']:<3d} {row['clean']:6d} "
            f"{row['median']:20.2f} {row['largest']:8.2f} {1000 * row['overlap']:5.0f} mm {row['seconds']:5.1f} s"
        )
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
