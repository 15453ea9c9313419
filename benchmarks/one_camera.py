"""Difference of scores from one camera to those from four cameras, on the recorded data set.

    python benchmarks/one_camera.py FOLDER

FOLDER is the output of `datasets/balancing.py --alone FOLDER`: one file of keypoints for each camera, with the depth of
the pose estimator. Unmeasured angles are neutral, activity is left out; differences of angles are medians over the
frames, those of scores means.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from machine import stamp

import reba

RECORDED = Path(__file__).resolve().parents[1] / "datasets" / "balancing_keypoints.trc"


def main() -> None:
    """Print one row per camera."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    options = parser.parse_args()
    files = sorted(options.folder.glob("*.trc"))
    if not files:
        parser.exit(2, f"{options.folder}: no .trc file there; run datasets/balancing.py --alone {options.folder}\n")
    together = reba.read(RECORDED)
    measured = [name for name in reba.COLUMNS if name not in together.unmeasured]
    exact = reba.score(together, missing="neutral", activity="none").data
    print(stamp())
    print(f"{'camera':10}{'trunk deg':>10}{'neck deg':>10}{'arm deg':>10}{'REBA':>8}{'level the same':>16}")
    for file in files:
        alone = reba.read(file)
        scores = reba.score(alone, missing="neutral", activity="none").data
        away = (alone.data[measured] - together.data[measured]).abs().median()
        arm = max(away[name] for name in measured if name.startswith("upper_arm_flexion"))
        score = (scores["reba"] - exact["reba"]).abs().mean()
        same = float(np.mean(scores["action_level"] == exact["action_level"]))
        print(
            f"{file.stem:10}{away['trunk_flexion']:10.0f}{away['neck_flexion']:10.0f}{arm:10.0f}{score:8.1f}{same:16.0%}"
        )


if __name__ == "__main__":
    main()
