"""Score angles of your own: any table with columns of the posture table, in any order."""

import pandas as pd

import reba

angles = pd.DataFrame(
    {
        "time": [0.0, 0.5, 1.0],
        "trunk_flexion": [5.0, 35.0, 65.0],  # degrees, forward positive
        "neck_flexion": [10.0, 15.0, 25.0],
        "upper_arm_flexion_right": [20.0, 60.0, 95.0],
        "lower_arm_flexion_right": [80.0, 45.0, 20.0],
    }
)
scores = reba.score(angles, load=3.0, activity="none")

# What was not measured leaves an exact range; it is never silently zero.
print(scores.data[["time", "reba_low", "reba_high"]].to_string(index=False))
print("not measured:", ", ".join(scores.unmeasured))

# The same as arrays, for a loop of your own: columns in the order of reba.COLUMNS.
arrays = reba.score_array(reba.angle_table(angles), missing="neutral")
print("unmeasured angles taken as neutral:", arrays["reba"])
