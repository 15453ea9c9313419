"""Run every benchmark and write one table: machine, versions, key figures and their ratios to peers and targets.

    python benchmarks/all.py                       everything; needs an idle machine
    python benchmarks/all.py --quick               small sizes, some minutes; checks that all scripts run
    python benchmarks/all.py --only scoring path   selected scripts
    python benchmarks/all.py --komo PYTHON         interpreter with `robotic`, for the comparison with KOMO

Writes OUT/benchmarks.md and OUT/benchmarks.json, and the output of each script beside them. Each script runs in its own
process on one thread. A script that fails has a row with the reason, and the exit code is 1.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from key_figures import SCRIPTS, Figure, Script
from machine import machine, stamp

HERE = Path(__file__).resolve().parent
LIMIT = 3600.0
"""Longest time of one script [s]."""


def run(script: Script, folder: Path, words: list[str]) -> dict[str, Any]:
    """Run one script: seconds, key figures, and the reason if it failed or was left out."""
    source = HERE / f"{script.name}.py"
    row: dict[str, Any] = {"name": script.name, "words": words, "seconds": 0.0, "figures": [], "why": script.needs}
    if script.needs:
        return row
    if not source.is_file():
        return row | {"why": "there is no such script"}
    written = folder / f"{script.name}.json"
    written.unlink(missing_ok=True)
    # Some scripts write no figures; their output is stored in any case.
    target = ["--json", str(written)] if '"--json"' in source.read_text(encoding="utf-8") else []
    began = time.perf_counter()
    try:
        done = subprocess.run(
            [sys.executable, str(source), *words, *target],
            capture_output=True,
            text=True,
            timeout=LIMIT,
            env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            check=False,
        )
    except subprocess.TimeoutExpired:
        return row | {"seconds": LIMIT, "why": f"failed: took more than {LIMIT:g} s"}
    row["seconds"] = time.perf_counter() - began
    (folder / f"{script.name}.txt").write_text(done.stdout, encoding="utf-8")
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        return row | {"why": f"failed: {last}"}
    if written.is_file():
        output = json.loads(written.read_text(encoding="utf-8"))
        row["figures"] = [figure._asdict() for figure in script.figures(output)]
    return row


def markdown(rows: list[dict[str, Any]], quick: bool) -> str:
    """Table of all key figures as Markdown."""
    lines = ["# Benchmarks", "", stamp(), ""]
    if quick:
        lines += ["Small sizes: a check that all scripts run; ratios of a full run differ.", ""]
    lines += ["| benchmark | what | figure | against | ratio |", "|---|---|---:|---|---:|"]
    for row in rows:
        name = f"{row['name']} ({row['seconds']:.0f} s)" if row["seconds"] else row["name"]
        figures = [Figure(**figure) for figure in row["figures"]]
        if row["why"] or not figures:
            figures = [Figure(row["why"] or f"see {row['name']}.txt", "")]
        for number, (what, value, against, ratio) in enumerate(figures):
            shown = "" if ratio is None else f"{ratio:.3g}"
            lines.append(f"| {'' if number else name} | {what} | {value} | {against} | {shown} |")
    return "\n".join([*lines, ""])


def main() -> int:
    """Run, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="small sizes")
    parser.add_argument("--only", nargs="+", choices=[script.name for script in SCRIPTS], metavar="NAME")
    parser.add_argument("--komo", metavar="PYTHON", help="interpreter with `robotic`")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    options = parser.parse_args()
    folder = options.output / "benchmarks"
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for script in SCRIPTS:
        if options.only and script.name not in options.only:
            continue
        words = list(script.quick) if options.quick else []
        if options.komo and script.name == "path":
            words += ["--komo", options.komo]
        rows.append(run(script, folder, words))
        print(f"{script.name:18}{rows[-1]['seconds']:7.1f} s  {rows[-1]['why'] or 'done'}", flush=True)
    text = markdown(rows, options.quick)
    (options.output / "benchmarks.md").write_text(text, encoding="utf-8")
    figures = {"machine": machine(), "quick": options.quick, "benchmarks": rows}
    (options.output / "benchmarks.json").write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    print(f"\n{text}\nwritten: {options.output / 'benchmarks.md'}, {options.output / 'benchmarks.json'}")
    return 1 if any(row["why"].startswith("failed") for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
