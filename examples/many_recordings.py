"""A folder of recordings: one row for each, and one that cannot be read does not stop the others."""

from pathlib import Path

import pandas as pd

import reba

FOLDER = Path(__file__).resolve().parents[1] / "datasets"
rows = []
for path in sorted(FOLDER.iterdir()):
    if path.suffix not in (".mcap", ".csv", ".trc"):
        continue
    try:
        summary = reba.score(reba.read(path)).summary()
    except reba.RebaError as error:
        print(f"left out: {error}")
        continue
    rows.append({"recording": path.name, "seconds": summary["seconds"], **summary["range"]})
print(pd.DataFrame(rows).round(1).to_string(index=False))
# With thousands of recordings, many processes or a cluster:  reba score FOLDER -o scores/ --jobs 8
