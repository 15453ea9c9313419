"""Two recordings side by side: what a change of the workplace did to the scores."""

from pathlib import Path

import reba

RECORDING = Path(__file__).resolve().parents[1] / "datasets" / "simulated_palletising.mcap"
postures = reba.read(RECORDING)

before = reba.score(postures, load=12.0, coupling="poor")
after = reba.score(postures, load=4.0, coupling="good")  # smaller boxes with handles
difference = reba.compare(before, after)["difference"]
print("mean REBA:", round(difference["reba"]["mean"], 2))
for part, change in difference["parts"].items():
    print(f"{part}: {change:+.2f}" if change is not None else f"{part}: not comparable")
