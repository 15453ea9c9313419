"""REBA restated one posture at a time, from the printed method, without any of the package's own rules or tables.

Tests compare the vectorised core with this. The grids are a second transcription of Tables A, B and C (Hignett &
McAtamney 2000), laid out as they are printed: neck and lower arm blocks side by side.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

GRID_A = (
    "1234 | 1234 | 3356",
    "2345 | 3456 | 4567",
    "2456 | 4567 | 5678",
    "3567 | 5678 | 6789",
    "4678 | 6789 | 7899",
)
GRID_B = ("122 | 123", "123 | 234", "345 | 455", "455 | 567", "678 | 788", "788 | 899")
GRID_C = (
    "1  1  1  2  3  3  4  5  6  7  7  7",
    "1  2  2  3  4  4  5  6  6  7  7  8",
    "2  3  3  3  4  5  6  7  7  8  8  8",
    "3  4  4  4  5  6  7  8  8  9  9  9",
    "4  4  4  5  6  7  8  8  9  9  9  9",
    "6  6  6  7  8  8  9  9 10 10 10 10",
    "7  7  7  8  9  9  9 10 10 11 11 11",
    "8  8  8  9 10 10 10 10 10 11 11 11",
    "9  9  9 10 10 10 11 11 11 12 12 12",
    "10 10 10 11 11 11 11 12 12 12 12 12",
    "11 11 11 11 12 12 12 12 12 12 12 12",
    "12 12 12 12 12 12 12 12 12 12 12 12",
)
A = [[[int(d) for d in block.strip()] for block in line.split("|")] for line in GRID_A]
B = [[[int(d) for d in block.strip()] for block in line.split("|")] for line in GRID_B]
C = [[int(cell) for cell in line.split()] for line in GRID_C]

LEVEL_OF_SCORE = [0, 0, 1, 1, 2, 2, 2, 2, 3, 3, 3, 4, 4, 4, 4, 4]
"""Action level of scores 0 (not a score) to 15: 1 | 2-3 | 4-7 | 8-10 | 11-15."""

SIDES = ("left", "right")
COUPLING = {"good": 0, "fair": 1, "poor": 2, "unacceptable": 3}
NO_FACTORS: dict[str, Any] = {
    "load": 0.0,
    "shock": False,
    "coupling_left": "good",
    "coupling_right": "good",
    "support": "bilateral",
    "arm_supported_left": False,
    "arm_supported_right": False,
    "static": False,
    "repeated": False,
    "unstable": False,
}


def past(value: float, edge: float, rules: Any) -> bool:
    """Whether a value lies in the class above an edge, which belongs to the lower class unless the rules differ."""
    return value >= edge if rules.edges == "upper" else value > edge


def twisted_or_bent(twist: float, bend: float, twist_limit: float, bend_limit: float, rules: Any) -> int:
    """+1 for twisted or side flexed; by choice one each."""
    twisted, bent = abs(twist) > twist_limit, abs(bend) > bend_limit
    return twisted + bent if rules.twist_and_bend == "two" else int(twisted or bent)


def trunk_score(angles: Mapping[str, float], rules: Any) -> int:
    flexion = angles["trunk_flexion"]
    if abs(flexion) <= rules.trunk_upright:
        score = 1
    elif past(flexion, 60, rules):
        score = 4
    elif past(flexion, 20, rules) or past(-flexion, 20, rules):
        score = 3
    else:
        score = 2
    extra = twisted_or_bent(
        angles["trunk_twist"], angles["trunk_side_bend"], rules.trunk_twist, rules.trunk_side_bend, rules
    )
    return min(score + extra, 5)


def neck_score(angles: Mapping[str, float], rules: Any) -> int:
    flexion = angles["neck_flexion"]
    score = 2 if flexion < -rules.neck_upright or past(flexion, 20, rules) else 1
    extra = twisted_or_bent(
        angles["neck_twist"], angles["neck_side_bend"], rules.neck_twist, rules.neck_side_bend, rules
    )
    return min(score + extra, 3)


def legs_score(angles: Mapping[str, float], support: str, rules: Any) -> int:
    score = {"bilateral": 1, "sitting": 1, "unilateral": 2, "walking": rules.walking_legs}[support]
    if support == "sitting" and not rules.seated_knees:
        return score
    knee = max(angles["knee_flexion_left"], angles["knee_flexion_right"])
    if past(knee, 60, rules):
        return score + 2
    return score + 1 if knee >= 30 else score


def upper_arm_score(angles: Mapping[str, float], side: str, supported: bool, rules: Any) -> int:
    flexion = angles[f"upper_arm_flexion_{side}"]
    if past(flexion, 90, rules):
        score = 4
    elif past(flexion, 45, rules):
        score = 3
    elif past(flexion, 20, rules) or past(-flexion, 20, rules):
        score = 2
    else:
        score = 1
    if angles[f"upper_arm_abduction_{side}"] > rules.abduction:
        score += 1
    if angles[f"shoulder_elevation_{side}"] > rules.shoulder_elevation:
        score += 1
    return max(score - 1, 1) if supported else score


def lower_arm_score(angles: Mapping[str, float], side: str, rules: Any) -> int:
    flexion = angles[f"lower_arm_flexion_{side}"]
    return 2 if flexion < 60 or past(flexion, 100, rules) else 1


def wrist_score(angles: Mapping[str, float], side: str, rules: Any) -> int:
    score = 2 if past(abs(angles[f"wrist_flexion_{side}"]), 15, rules) else 1
    deviated = abs(angles[f"wrist_deviation_{side}"]) > rules.wrist_deviation
    twisted = abs(angles[f"wrist_twist_{side}"]) > rules.wrist_twist
    return score + int(deviated or twisted)


def load_score(load: float, shock: bool) -> int:
    score = 0 if load < 5 else 1 if load <= 10 else 2
    return score + int(shock)


def coupling_score(coupling: str | int, load: float, rules: Any) -> int:
    if load == 0 and not rules.coupling_without_load:
        return 0
    return COUPLING[coupling] if isinstance(coupling, str) else coupling


def score(angles: Mapping[str, float], rules: Any, **factors: Any) -> dict[str, int]:
    """Return every column of the score table but the range for one fully known posture."""
    given = {**NO_FACTORS, **factors}
    row = {
        "trunk": trunk_score(angles, rules),
        "neck": neck_score(angles, rules),
        "legs": legs_score(angles, given["support"], rules),
        "load_force": load_score(given["load"], given["shock"]),
        "activity": int(given["static"]) + int(given["repeated"]) + int(given["unstable"]),
    }
    for side in SIDES:
        row[f"upper_arm_{side}"] = upper_arm_score(angles, side, given[f"arm_supported_{side}"], rules)
        row[f"lower_arm_{side}"] = lower_arm_score(angles, side, rules)
        row[f"wrist_{side}"] = wrist_score(angles, side, rules)
        row[f"coupling_{side}"] = coupling_score(given[f"coupling_{side}"], given["load"], rules)
    return {**row, **totals(row, rules)}


def totals(row: Mapping[str, int], rules: Any) -> dict[str, int]:
    """Return Scores A and B, REBA of both sides, the total and its action level from part scores."""
    found = {"score_a": A[row["trunk"] - 1][row["neck"] - 1][row["legs"] - 1] + row["load_force"]}
    for side in SIDES:
        table_b = B[row[f"upper_arm_{side}"] - 1][row[f"lower_arm_{side}"] - 1][row[f"wrist_{side}"] - 1]
        found[f"score_b_{side}"] = table_b + row[f"coupling_{side}"]
        found[f"reba_{side}"] = C[found["score_a"] - 1][found[f"score_b_{side}"] - 1] + row["activity"]
    worse = max(found["reba_left"], found["reba_right"])
    found["reba"] = worse if rules.two_sides == "worse" else found[f"reba_{rules.two_sides}"]
    found["action_level"] = LEVEL_OF_SCORE[found["reba"]]
    return found
