"""Run every benchmark and write one table: machine, versions, key figures and their ratios to peers and targets.

    python benchmarks/all.py                       everything; needs an idle machine
    python benchmarks/all.py --quick               small sizes, some minutes; shows that everything runs
    python benchmarks/all.py --only scoring path   some
    python benchmarks/all.py --komo PYTHON         interpreter with `robotic`, for the comparison with KOMO

Writes OUT/benchmarks.md and OUT/benchmarks.json, and beside them what each script printed. Each script runs as a
process of its own on one thread. One that fails is a row of its own, and the exit code is 1.
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
"""[s] That one script may take."""


def run(script: Script, folder: Path, words: list[str]) -> dict[str, Any]:
    """Run one script; return seconds, figures and, if it failed or was left out, why."""
    source = HERE / f"{script.name}.py"
    row: dict[str, Any] = {"name": script.name, "words": words, "seconds": 0.0, "figures": [], "why": script.needs}
    if script.needs:
        return row
    if not source.is_file():
        return row | {"why": "there is no such script"}
    written = folder / f"{script.name}.json"
    written.unlink(missing_ok=True)
    # Not every script has figures to write; what it prints is kept either way.
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
        found = json.loads(written.read_text(encoding="utf-8"))
        row["figures"] = [figure._asdict() for figure in script.figures(found)]
    return row


def markdown(rows: list[dict[str, Any]], quick: bool) -> str:
    """Return the table as Markdown."""
    lines = ["# Benchmarks", "", stamp(), ""]
    if quick:
        lines += ["Small sizes: this shows that everything runs; ratios of a full run differ.", ""]
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
    parser.add_argument("--komo", metavar="PYTHON", help="interpreter that has `robotic`")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    given = parser.parse_args()
    folder = given.output / "benchmarks"
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for script in SCRIPTS:
        if given.only and script.name not in given.only:
            continue
        words = list(script.quick) if given.quick else []
        if given.komo and script.name == "path":
            words += ["--komo", given.komo]
        rows.append(run(script, folder, words))
        print(f"{script.name:18}{rows[-1]['seconds']:7.1f} s  {rows[-1]['why'] or 'done'}", flush=True)
    text = markdown(rows, given.quick)
    (given.output / "benchmarks.md").write_text(text, encoding="utf-8")
    figures = {"machine": machine(), "quick": given.quick, "benchmarks": rows}
    (given.output / "benchmarks.json").write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    print(f"\n{text}\nwritten: {given.output / 'benchmarks.md'}, {given.output / 'benchmarks.json'}")
    return 1 if any(row["why"].startswith("failed") for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
