"""The vectorised core against the scalar restatement of the method."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reba
from reba.method.scoring import SCORE_COLUMNS
from reba.posture.columns import INDEX
from tests.support import posture_samples as samples
from tests.support import reference_reba as reference
from tests.support.posture_samples import KNOWN, MEASURED, one, posture, restated, rule_sets, seeds

PAPER = reba.PRESETS["paper"]

# -- agreement with the restatement --------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(seed=seeds, rules=rule_sets)
def test_every_column_equals_the_restatement(seed: int, rules: reba.Rules) -> None:
    rng = np.random.default_rng(seed)
    angles, factors = samples.random_angles(rng, 150), samples.random_factors(rng, 150)
    arrays = reba.score_array(angles, factors, rules)
    for frame in range(len(angles)):
        expected = restated(angles[frame], rules, **samples.frame_factors(factors, frame))
        assert {name: int(arrays[name][frame]) for name in KNOWN} == expected
    np.testing.assert_array_equal(arrays.reba_low, arrays.reba)
    np.testing.assert_array_equal(arrays.reba_high, arrays.reba)


@settings(max_examples=100, deadline=None)
@given(seed=seeds, rules=rule_sets, column=st.sampled_from(reba.COLUMNS))
def test_edges_of_every_angle(seed: int, rules: reba.Rules, column: str) -> None:
    """Each angle swept over every printed edge and threshold, on it and beside it, both signs."""
    rng = np.random.default_rng(seed)
    limits = {value for value in vars(rules).values() if isinstance(value, float) and value <= 90.0}
    edges = np.array(sorted({*samples.EDGES, *limits}))
    beside = np.concatenate([edges, edges + 1e-9, edges - 1e-9, np.nextafter(edges, 1e9), np.nextafter(edges, -1e9)])
    values = np.concatenate([beside, -beside])
    angles = np.repeat(samples.random_angles(rng, 1), len(values), axis=0)
    angles[:, INDEX[column]] = values
    arrays = reba.score_array(angles, None, rules)
    for frame in range(len(values)):
        expected = restated(angles[frame], rules)
        assert {name: int(arrays[name][frame]) for name in KNOWN} == expected, values[frame]


def test_every_class_of_every_part_by_angles() -> None:
    """One posture and set of factors for each of the 138,240 part-score states."""
    trunk = [(0, 0), (10, 0), (40, 0), (75, 0), (75, 40)]
    neck = [(5, 0), (40, 0), (40, 40)]
    legs = [("bilateral", 0), ("bilateral", 45), ("bilateral", 90), ("unilateral", 90)]
    upper = [(0, 0, 0), (30, 0, 0), (70, 0, 0), (120, 0, 0), (120, 60, 0), (120, 60, 30)]
    lower, wrist = [80, 20], [(0, 0), (40, 0), (40, 40)]
    load, grip = [(0, False), (7, False), (30, False), (30, True)], ["good", "fair", "poor", "unacceptable"]
    active = [(False, False, False), (True, False, False), (True, True, False), (True, True, True)]
    spans = [range(len(span)) for span in (trunk, neck, legs, upper, lower, wrist, load, grip, active)]
    t, n, g, u, w, r, f, k, a = np.indices([len(span) for span in spans]).reshape(9, -1)
    angles = np.zeros((len(t), len(reba.COLUMNS)))

    def put(name: str, values: np.ndarray) -> None:
        for column in (name, f"{name}_left", f"{name}_right"):
            if column in INDEX:
                angles[:, INDEX[column]] = values

    put("trunk_flexion", np.array(trunk)[t, 0])
    put("trunk_twist", np.array(trunk)[t, 1])
    put("neck_flexion", np.array(neck)[n, 0])
    put("neck_side_bend", np.array(neck)[n, 1])
    put("knee_flexion", np.array([knee for _, knee in legs])[g])
    for index, name in enumerate(("upper_arm_flexion", "upper_arm_abduction", "shoulder_elevation")):
        put(name, np.array(upper)[u, index])
    put("lower_arm_flexion", np.array(lower)[w])
    put("wrist_flexion", np.array(wrist)[r, 0])
    put("wrist_twist", np.array(wrist)[r, 1])
    factors = {
        "support": np.array([support for support, _ in legs])[g],
        "load": np.array([load_kg for load_kg, _ in load])[f],
        "shock": np.array([shock for _, shock in load])[f],
        "coupling_left": np.array(grip)[k],
        "coupling_right": np.array(grip)[k],
        **{kind: np.array(active)[a, index] for index, kind in enumerate(("static", "repeated", "unstable"))},
    }
    arrays = reba.score_array(angles, factors, "measured")
    assert len(t) == 138_240
    for name, index in {
        "trunk": t,
        "neck": n,
        "legs": g,
        "upper_arm_left": u,
        "lower_arm_right": w,
        "wrist_left": r,
    }.items():
        np.testing.assert_array_equal(arrays[name], index + 1, err_msg=name)
    score_a = np.array(reference.A)[t, n, g] + f
    score_b = np.array(reference.B)[u, w, r] + k
    np.testing.assert_array_equal(arrays.score_a, score_a)
    for side in ("left", "right"):
        np.testing.assert_array_equal(arrays[f"score_b_{side}"], score_b)
    np.testing.assert_array_equal(arrays.reba, np.array(reference.C)[score_a - 1, score_b - 1] + a)
    np.testing.assert_array_equal(arrays.action_level, np.array(reference.LEVEL_OF_SCORE)[arrays.reba])


# -- the printed edges, by hand ------------------------------------------------------------------------------------

ABOVE = 1e-9


@pytest.mark.parametrize(
    ("rules", "angle", "score"),
    [
        *((PAPER, angle, score) for angle, score in [(0, 1), (ABOVE, 2), (-ABOVE, 2), (20, 2), (20 + ABOVE, 3)]),
        *((PAPER, angle, score) for angle, score in [(60, 3), (60 + ABOVE, 4), (-20, 2), (-20 - ABOVE, 3), (-90, 3)]),
        *((MEASURED, angle, score) for angle, score in [(5, 1), (5 + ABOVE, 2), (-5, 1), (-5 - ABOVE, 2), (20, 2)]),
        *((MEASURED.replace(edges="upper"), angle, score) for angle, score in [(20 - ABOVE, 2), (20, 3), (60, 4)]),
        *((MEASURED.replace(edges="upper"), angle, score) for angle, score in [(-20, 3), (5, 1), (5 + ABOVE, 2)]),
    ],
)
def test_trunk(rules: reba.Rules, angle: float, score: int) -> None:
    assert one(posture(trunk_flexion=angle), rules)["trunk"] == score


@pytest.mark.parametrize(
    ("rules", "angle", "score"),
    [
        *((PAPER, angle, score) for angle, score in [(0, 1), (-ABOVE, 2), (20, 1), (20 + ABOVE, 2), (-45, 2)]),
        *((MEASURED, angle, score) for angle, score in [(-5, 1), (-5 - ABOVE, 2), (20, 1), (20 + ABOVE, 2)]),
        *((MEASURED.replace(edges="upper"), angle, score) for angle, score in [(20 - ABOVE, 1), (20, 2), (-5, 1)]),
    ],
)
def test_neck(rules: reba.Rules, angle: float, score: int) -> None:
    assert one(posture(neck_flexion=angle), rules)["neck"] == score


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(
    ("edges", "angle", "score"),
    [
        *(("lower", angle, score) for angle, score in [(-20, 1), (-20 - ABOVE, 2), (20, 1), (20 + ABOVE, 2), (45, 2)]),
        *(("lower", angle, score) for angle, score in [(45 + ABOVE, 3), (90, 3), (90 + ABOVE, 4), (-90, 2)]),
        *(("upper", angle, score) for angle, score in [(-20, 2), (20, 2), (45, 3), (90, 4), (20 - ABOVE, 1)]),
    ],
)
def test_upper_arm(side: str, edges: str, angle: float, score: int) -> None:
    scores = one(posture(**{f"upper_arm_flexion_{side}": angle}), MEASURED.replace(edges=edges))
    assert scores[f"upper_arm_{side}"] == score
    assert scores[f"upper_arm_{'left' if side == 'right' else 'right'}"] == 1


@pytest.mark.parametrize(
    ("edges", "angle", "score"),
    [
        *(("lower", angle, score) for angle, score in [(60 - ABOVE, 2), (60, 1), (100, 1), (100 + ABOVE, 2), (0, 2)]),
        *(("upper", angle, score) for angle, score in [(60 - ABOVE, 2), (60, 1), (100 - ABOVE, 1), (100, 2)]),
    ],
)
def test_lower_arm(edges: str, angle: float, score: int) -> None:
    assert one(posture(lower_arm_flexion=angle), MEASURED.replace(edges=edges))["lower_arm_left"] == score


@pytest.mark.parametrize(
    ("edges", "angle", "score"),
    [
        *(("lower", angle, score) for angle, score in [(15, 1), (15 + ABOVE, 2), (-15, 1), (-15 - ABOVE, 2)]),
        *(("upper", angle, score) for angle, score in [(15 - ABOVE, 1), (15, 2), (-15, 2)]),
    ],
)
def test_wrist(edges: str, angle: float, score: int) -> None:
    assert one(posture(wrist_flexion=angle), MEASURED.replace(edges=edges))["wrist_right"] == score


@pytest.mark.parametrize(
    ("edges", "knee", "points"),
    [
        *(("lower", angle, points) for angle, points in [(30 - ABOVE, 0), (30, 1), (60, 1), (60 + ABOVE, 2)]),
        *(("upper", angle, points) for angle, points in [(30 - ABOVE, 0), (30, 1), (60 - ABOVE, 1), (60, 2)]),
    ],
)
@pytest.mark.parametrize(("support", "base"), [("bilateral", 1), ("walking", 1), ("unilateral", 2)])
@pytest.mark.parametrize("side", ["left", "right"])
def test_legs(edges: str, knee: float, points: int, support: str, base: int, side: str) -> None:
    row = posture(**{f"knee_flexion_{side}": knee})
    assert one(row, MEASURED.replace(edges=edges), support=support)["legs"] == base + points


def test_legs_while_sitting_and_walking() -> None:
    row = posture(knee_flexion=90)
    assert one(row, support="sitting")["legs"] == 1
    assert one(row, MEASURED.replace(seated_knees=True), support="sitting")["legs"] == 3
    assert one(row, MEASURED.replace(walking_legs=2), support="walking")["legs"] == 4


@pytest.mark.parametrize(
    ("column", "part", "limit", "signs"),
    [
        ("trunk_twist", "trunk", 10, (1, -1)),
        ("trunk_side_bend", "trunk", 10, (1, -1)),
        ("neck_twist", "neck", 10, (1, -1)),
        ("neck_side_bend", "neck", 10, (1, -1)),
        ("upper_arm_abduction_left", "upper_arm_left", 30, (1,)),
        ("shoulder_elevation_right", "upper_arm_right", 10, (1,)),
        ("wrist_deviation_left", "wrist_left", 10, (1, -1)),
        ("wrist_twist_right", "wrist_right", 30, (1, -1)),
    ],
)
def test_adjustments(column: str, part: str, limit: float, signs: tuple[int, ...]) -> None:
    for rules, edge in ((MEASURED, limit), (PAPER, 0.0), (MEASURED.replace(edges="upper"), limit)):
        for sign in signs:
            assert one(posture(**{column: sign * edge}), rules)[part] == 1
            assert one(posture(**{column: sign * (edge + ABOVE)}), rules)[part] == 2


def test_adjustments_one_way_only() -> None:
    assert one(posture(upper_arm_abduction=-80, shoulder_elevation=-80), PAPER)["upper_arm_left"] == 1


def test_twist_and_bend_together() -> None:
    row = posture(
        trunk_flexion=75, trunk_twist=40, trunk_side_bend=40, neck_flexion=5, neck_twist=40, neck_side_bend=40
    )
    assert (one(row)["trunk"], one(row)["neck"]) == (5, 2)
    two = MEASURED.replace(twist_and_bend="two")
    assert (one(row, two)["trunk"], one(row, two)["neck"]) == (5, 3)
    row[0, INDEX["trunk_flexion"]] = 10.0
    assert (one(row)["trunk"], one(row, two)["trunk"]) == (3, 4)
    both = posture(wrist_flexion=40, wrist_deviation=40, wrist_twist=50)
    assert one(both, two)["wrist_left"] == 3


def test_supported_arm_never_below_one() -> None:
    assert one(posture(), arm_supported=True)["upper_arm_left"] == 1
    scores = one(posture(upper_arm_flexion=60), arm_supported_left=True)
    assert (scores["upper_arm_left"], scores["upper_arm_right"]) == (2, 3)
    assert one(posture(), arm_supported=True)["reba"] == 1


@pytest.mark.parametrize(
    ("load", "points"),
    [(0, 0), (5 - ABOVE, 0), (5, 1), (10, 1), (10 + ABOVE, 2), (500, 2)],
)
def test_load_and_shock(load: float, points: int) -> None:
    assert one(posture(), load=load)["load_force"] == points
    assert one(posture(), load=load, shock=True)["load_force"] == points + 1


def test_coupling() -> None:
    for code, word in enumerate(("good", "fair", "poor", "unacceptable")):
        for given_ in (word, word.upper(), code, str(code), float(code)):
            scores = one(posture(), coupling=given_)
            assert (scores["coupling_left"], scores["score_b_right"]) == (code, 1 + code)
        apart = one(posture(), coupling_left=word)
        assert (apart["coupling_left"], apart["coupling_right"]) == (code, 0)
    empty = MEASURED.replace(coupling_without_load=False)
    assert one(posture(), empty, coupling="poor")["coupling_left"] == 0
    assert one(posture(), empty, coupling="poor", load=0.1)["coupling_left"] == 2


def test_activity_points() -> None:
    for static, repeated, unstable in itertools.product([False, True], repeat=3):
        scores = one(posture(), static=static, repeated=repeated, unstable=unstable)
        assert scores["activity"] == static + repeated + unstable
        assert scores["reba"] == 1 + scores["activity"]


def test_sides_are_never_mixed() -> None:
    row = posture(upper_arm_flexion_left=120, lower_arm_flexion_right=20, wrist_flexion_right=40, trunk_flexion=40)
    scores = one(row)
    assert (scores["score_b_left"], scores["score_b_right"]) == (4, 2)
    assert scores["reba"] == max(scores["reba_left"], scores["reba_right"])
    assert one(row, MEASURED.replace(two_sides="right"))["reba"] == scores["reba_right"]


# -- properties ----------------------------------------------------------------------------------------------------


def mirrored(angles: np.ndarray) -> np.ndarray:
    """Return postures seen in a mirror: sides exchanged, side bend and twist turned round."""
    order = []
    for column in reba.COLUMNS:
        swapped = column.replace("_left", "_RIGHT").replace("_right", "_left").replace("_RIGHT", "_right")
        order.append(INDEX[swapped])
    turned = angles[:, order]
    for column in ("trunk_side_bend", "trunk_twist", "neck_side_bend", "neck_twist"):
        turned[:, INDEX[column]] *= -1
    return turned


@settings(max_examples=40, deadline=None)
@given(seed=seeds, edges=st.sampled_from(["lower", "upper"]), preset=st.sampled_from(["paper", "measured"]))
def test_mirror(seed: int, edges: str, preset: str) -> None:
    rng = np.random.default_rng(seed)
    angles = samples.random_angles(rng, 200)
    angles[rng.random(angles.shape) < 0.05] = np.nan
    rules = reba.PRESETS[preset].replace(edges=edges)
    straight, turned = reba.score_array(angles, None, rules), reba.score_array(mirrored(angles), None, rules)
    for name in SCORE_COLUMNS:
        other = name.replace("_left", "_RIGHT").replace("_right", "_left").replace("_RIGHT", "_right")
        np.testing.assert_array_equal(straight[name], turned[other], err_msg=name)


@settings(max_examples=60, deadline=None)
@given(seed=seeds, column=st.sampled_from(reba.COLUMNS), rules=rule_sets)
def test_more_departure_never_scores_less(seed: int, column: str, rules: reba.Rules) -> None:
    rng = np.random.default_rng(seed)
    for sign in (1.0, -1.0):
        steps = np.sort(rng.uniform(0.0, 100.0, 80))
        angles = np.repeat(samples.random_angles(rng, 1), len(steps), axis=0)
        angles[:, INDEX[column]] = sign * steps + (80.0 if column.startswith("lower_arm") else 0.0)
        scores = reba.score_array(angles, samples.random_factors(rng, 1), rules).reba
        assert (np.diff(scores.astype(int)) >= 0).all()
