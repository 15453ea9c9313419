"""How near the planner's body comes to measured postures: `python benchmarks/body_fit.py [RECORDING...]`.

For each recording (by default the keypoints in datasets/), `--frames` frames are fitted as `lgp improve` does, and the
angles compared with those of the posture table. Where the recording has joint positions with the names of that file
and z up, the heights of the wrists above the lower ankle, over the length of the leg, are compared as well.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import reba
from lgp.scene.body_measures import lengths
from lgp.workplace.balance import Balance
from lgp.workplace.body_fit import fit_body, person
from reba.posture.columns import SIDES

KEYPOINTS = Path(__file__).parent.parent / "datasets" / "balancing_keypoints.trc"


def wrists(path: Path, frames: np.ndarray) -> np.ndarray | None:
    """Return the heights of both wrists above the lower ankle over the leg's length (n, 2), None without keypoints."""
    names = [] if path.suffix != ".trc" else path.read_text(encoding="utf-8").splitlines()[3].split("\t")[2:]
    if "left_wrist" not in names:
        return None
    names = [name for name in names if name]
    rows = [line.split("\t") for line in path.read_text(encoding="utf-8").splitlines()[5:] if line.strip()]
    table = np.array([[float(cell or "nan") for cell in row[2 : 2 + 3 * len(names)]] for row in rows])
    at = {name: table[:, 3 * number : 3 * number + 3] for number, name in enumerate(names)}
    leg = sum(
        np.nanmedian(np.linalg.norm(at[f"{side}_{upper}"] - at[f"{side}_{lower}"], axis=1)) / 2.0
        for side in SIDES
        for upper, lower in (("hip", "knee"), ("knee", "ankle"))
    )
    floor = np.minimum(*(at[f"{side}_ankle"][:, 2] for side in SIDES))
    heights = np.stack([at[f"{side}_wrist"][:, 2] - floor for side in SIDES], axis=1)
    return np.asarray(heights[frames] / leg)


def main() -> None:
    """Print one line per recording."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="*", type=Path, default=[KEYPOINTS])
    parser.add_argument("--frames", type=int, default=30)
    chosen = parser.parse_args()
    world = person(1.75, "male")
    balance = Balance(world, 0.0, ())
    measures = lengths(1.75, "male")
    leg = measures["thigh"] + measures["shank"]
    for path in chosen.recordings:
        angles = reba.score(reba.read(path)).angles
        frames = np.unique(np.linspace(0, len(angles) - 1, chosen.frames).astype(int))
        fits = [fit_body(world, angles[frame], balance) for frame in frames]
        away = np.abs([fit.away for fit in fits])
        text = f"{path.name}: {len(frames)} postures, angles {np.nanmean(away):.2f} deg away on average, "
        text += f"{np.nanpercentile(away, 99):.1f} in 99 of 100, {np.nanmax(away):.1f} at most"
        measured = wrists(path, frames)
        if measured is not None:
            names = [f"human.{side}_wrist_Z" for side in SIDES]
            height = np.array([world.at(fit.q[None], names).position[0, :, 2] for fit in fits])
            differ = 100.0 * leg * ((height - measures["ankle_height"]) / leg - measured)
            text += f"; wrists {np.nanmean(np.abs(differ)):.0f} cm higher or lower on average"
        print(text)


if __name__ == "__main__":
    main()
