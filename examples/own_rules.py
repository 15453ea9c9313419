"""Score with thresholds of your own: what the paper leaves open is a named field of one record."""

from pathlib import Path

import reba

RECORDING = Path(__file__).resolve().parents[1] / "datasets" / "simulated_assembly.csv"
postures = reba.read(RECORDING)

strict = reba.PRESETS["paper"]  # any departure from upright counts
default = reba.PRESETS["measured"]  # tolerances for recorded angles
own = default.replace(trunk_upright=10.0, wrist_twist=45.0)
for name, rules in {"paper": strict, "measured": default, "own": own}.items():
    mean = reba.score(postures, rules=rules, missing="neutral").summary()["reba"]["mean"]
    print(f"{name}: mean REBA {mean:.2f}")
