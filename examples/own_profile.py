"""Read a recording with joint names of your own: a profile says which joint is which angle, and its sign."""

from pathlib import Path

import pandas as pd

import reba

PROFILE = """
name = "my_suit"
title = "Suit of my laboratory"
source = "its manual"
kind = "joints"
unit = "deg"

[columns]                                  # column of the posture table = sum of joints, with their signs
trunk_flexion = ["+spine_bend"]
knee_flexion_left = ["+knee_l"]
knee_flexion_right = ["+knee_r"]
lower_arm_flexion_right = ["-elbow_r"]     # this suit counts extension as positive
"""
Path("my_suit.toml").write_text(PROFILE)
pd.DataFrame(
    {
        "time": [0.0, 0.1],
        "spine_bend": [10.0, 30.0],
        "knee_l": [5.0, 40.0],
        "knee_r": [5.0, 40.0],
        "elbow_r": [-80.0, -90.0],
    }
).to_csv("walk.csv", index=False)

postures = reba.read("walk.csv", profile="my_suit.toml")
print(postures.data.dropna(axis="columns").to_string(index=False))
print("not measured by this suit:", len(postures.unmeasured), "of", len(reba.COLUMNS), "columns")
