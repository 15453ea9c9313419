"""Memory of a long recording that is read and scored at once, and in blocks; each in a new process.

    python benchmarks/blocks.py [--json FILE] [--hours 1 4]

Writes recordings at 100 Hz (36 joints of human.urdf, zstd) in a temporary folder and reports seconds and peak memory.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from machine import machine
from whole_command import make_recording

WAYS = {
    "read, score": "reba.score(reba.read(path))",
    "read_blocks": "[None for block in reba.read_blocks(path)]",
    "read_blocks, score of each": "[len(reba.score(block).data) for block in reba.read_blocks(path)]",
}
SCRIPT = """
import resource, sys, time
import reba
path, start = sys.argv[1], time.perf_counter()
{way}
print(time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def main() -> None:
    """Measure, print and save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--hours", type=float, nargs="+", default=[1.0, 4.0])
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for hours in arguments.hours:
            path = Path(folder) / "recording.mcap"
            make_recording(path, 60 * hours)
            for name, way in WAYS.items():
                words = [sys.executable, "-c", SCRIPT.format(way=way), str(path)]
                done = subprocess.run(words, check=True, capture_output=True, text=True)
                seconds, peak = map(float, done.stdout.split())
                rows.append({"hours": hours, "way": name, "seconds": round(seconds, 2), "peak_mb": round(peak)})
                print(f"{hours:g} h  {name:28}{seconds:8.2f} s{peak:8.0f} MB", flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
