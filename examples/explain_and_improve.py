"""Why is the worst moment bad, and which smallest change lowers its action level?"""

from pathlib import Path

import reba

RECORDING = Path(__file__).resolve().parents[1] / "datasets" / "simulated_palletising.mcap"
scores = reba.score(reba.read(RECORDING), load=8.0, coupling="fair")

worst = scores.summary()["worst"][0]
print(f"worst at {worst['time']:.2f} s, REBA {worst['reba']}")
for line in scores.explain(worst["time"]).lines:  # the worksheet: which angle and rule gave which point
    if line.points:
        print(f"  {line.part}: {line.what} {line.value} ({line.rule}): {line.points:+d}")
for improvement in scores.improve(worst["time"]):
    print(improvement.text())
