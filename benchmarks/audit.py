"""Time of the audit of a plan, by its parts.

    python benchmarks/audit.py [SCENE|PLAN_FOLDER ...] [--repeat N] [--json FILE]

A shipped scene is planned without ergonomics first; a folder holds a plan that `lgp plan -o` wrote. Meshes are read
once per process, which the first audit includes.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

from machine import machine, stamp

import lgp
from lgp.audit.audit import audit_plan, bodies_of
from lgp.audit.contacts import allowed_depths
from lgp.audit.penetration import boxes_meet, deepest
from lgp.audit.replay import replay
from lgp.audit.samples import Samples
from lgp.plan_record import Plan


def measure(plan: Plan, repeat: int) -> dict[str, Any]:
    """Return seconds of the first audit and the least of the following ones, of its parts, and what it looked at."""
    began = time.perf_counter()
    found = audit_plan(plan)
    row: dict[str, Any] = {"first": time.perf_counter() - began, "samples": found.samples, "faults": len(found.faults)}
    parts: dict[str, list[float]] = {"all": [], "replay": [], "bodies": [], "boxes": [], "shapes": []}
    for _ in range(repeat):
        marks = [time.perf_counter()]
        audit_plan(plan)
        marks.append(time.perf_counter())
        run = replay(Samples.of(plan))
        marks.append(time.perf_counter())
        bodies, rotation, position, pairs = bodies_of(run)
        marks.append(time.perf_counter())
        near = boxes_meet(bodies, rotation, position, pairs)
        marks.append(time.perf_counter())
        deepest(bodies, rotation, position, pairs, allowed_depths(run, bodies))
        marks.append(time.perf_counter())
        for name, begin, end in zip(parts, marks, marks[1:], strict=False):
            parts[name].append(end - begin)
    row |= {name: min(seconds) for name, seconds in parts.items()}
    return row | {"bodies_number": len(bodies), "pairs": len(pairs), "near": int(near.sum())}


def main() -> None:
    """Measure each plan and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("plans", nargs="*", default=["screwdriver", "screwdriver_panda"])
    parser.add_argument("--repeat", type=int, default=20)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = {}
    for name in options.plans:
        plan = Plan.load(name) if Path(name, "plan.json").is_file() else lgp.plan(name, cost=None)
        rows[name] = measure(plan, options.repeat)
    print(stamp())
    print(f"{'plan':26s} samples bodies pairs   near  first ms   all ms  replay  bodies   boxes  shapes  faults")
    for name, row in rows.items():
        times = "".join(f"{1000 * row[part]:8.1f}" for part in ("replay", "bodies", "boxes", "shapes"))
        print(
            f"{Path(name).name:26s} {row['samples']:7d} {row['bodies_number']:6d} {row['pairs']:5d} {row['near']:6d} "
            f"{1000 * row['first']:9.0f} {1000 * row['all']:8.1f}{times} {row['faults']:7d}"
        )
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "plans": rows}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
