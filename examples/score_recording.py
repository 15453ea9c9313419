"""Score a recording of a person at work: MCAP in, risk and an HTML report out."""

from pathlib import Path

import reba

RECORDING = Path(__file__).resolve().parents[1] / "datasets" / "simulated_palletising.mcap"

postures = reba.read(RECORDING)  # a posture table: one row per frame, angles in degrees
scores = reba.score(postures, load=8.0, coupling="fair")  # kilograms; how well the box can be gripped

summary = scores.summary()
print(
    f"REBA: median {summary['reba']['median']}, 90th percentile {summary['reba']['p90']}, max {summary['reba']['max']}"
)
for level, share in summary["action_levels"].items():
    print(f"action level {level}: {share:.0%} of the time")
print("assumed:", "; ".join(scores.assumed))

reba.write_scores(scores, "scores.parquet")
reba.write_report(scores, "report.html")
