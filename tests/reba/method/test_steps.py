"""The step table against the vectorised scores and the closed classes, on and beside every edge."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import reba
from reba.arrays import Array, Flags
from reba.method.classes import angle_classes
from reba.method.rules import load_points, rules_of
from reba.method.steps import STEPS, ClassStep
from reba.method.tables import PART_MAXIMA
from reba.posture.columns import COLUMNS, COLUMNS_OF, GROUP_A, INDEX, PART_COLUMNS, PARTS, SIDES

OWN = reba.Rules(
    name="own", trunk_upright=3.0, neck_upright=4.0, trunk_twist=6.0, trunk_side_bend=7.0, neck_twist=8.0,
    neck_side_bend=9.0, abduction=25.0, shoulder_elevation=11.0, wrist_deviation=12.0, wrist_twist=33.0,
)  # fmt: skip
PRESETS: tuple[str | reba.Rules, ...] = ("measured", "paper", OWN)
RULE_SETS = [
    rules_of(preset).replace(edges=edges, twist_and_bend=together)
    for preset, edges, together in itertools.product(PRESETS, ("lower", "upper"), ("one", "two"))
]
each_rules = pytest.mark.parametrize("rules", RULE_SETS, ids=lambda r: f"{r.name}-{r.edges}-{r.twist_and_bend}")


def passed(step: ClassStep, angle: Array, rules: reba.Rules) -> Flags:
    """Return where angles pass a step: the definition of a step, written out."""
    edge = step.threshold(rules)
    reaches = np.greater_equal if step.includes_edge(rules) else np.greater
    if step.sense == 0:
        return reaches(angle, edge) | reaches(-angle, edge)
    return reaches(step.sense * angle, edge)


def values_beside_edges(rules: reba.Rules) -> Array:
    edges = np.array(sorted({abs(step.threshold(rules)) for step in STEPS} | {0.0, 180.0}))
    beside = np.concatenate([edges, np.nextafter(edges, 1e9), np.nextafter(edges, -1e9)])
    return np.concatenate([beside, -beside])


def part_scores(angles: Array, rules: reba.Rules) -> dict[str, Array]:
    """Return part scores from the step table alone, one step after another."""
    scores = {}
    for part, columns in PART_COLUMNS.items():
        name = next(known for known in PARTS if part.startswith(known))
        side = part.removeprefix(name)
        points = np.ones(len(angles), int)
        adjustments: dict[str, Flags] = {}
        for step in (step for step in STEPS if step.part == name):
            own = [f"{step.angle}{side}"] if side else COLUMNS_OF[step.angle]
            assert set(own) <= set(columns)
            angle = angles[:, [INDEX[column] for column in own]].max(axis=1)
            if step.adjustment:
                adjustments.setdefault(step.adjustment, np.zeros(len(angles), bool))
                adjustments[step.adjustment] |= passed(step, angle, rules)
            else:
                points += passed(step, angle, rules)
        together = name == "wrist" or (name in ("trunk", "neck") and rules.twist_and_bend == "one")
        count = sum((flags.astype(int) for flags in adjustments.values()), np.zeros(len(angles), int))
        scores[part] = np.minimum(points + (np.minimum(count, 1) if together else count), PART_MAXIMA[name])
    return scores


@each_rules
def test_step_table_gives_the_part_scores_on_and_beside_every_edge(rules: reba.Rules) -> None:
    rng = np.random.default_rng(20250101)
    values = values_beside_edges(rules)
    shape = (20_000, len(COLUMNS))
    angles = np.where(rng.random(shape) < 0.6, rng.choice(values, shape), rng.uniform(-120.0, 150.0, shape))
    # Every value of every column at least once, whatever the draw.
    for column, start in enumerate(range(0, len(COLUMNS) * len(values), len(values))):
        angles[start : start + len(values), column] = values
    scores = reba.score_array(angles, None, rules)
    for part, expected in part_scores(angles, rules).items():
        np.testing.assert_array_equal(scores[part], expected, err_msg=part)


@each_rules
def test_classes_hold_the_angles_that_pass_as_many_steps(rules: reba.Rules) -> None:
    values = values_beside_edges(rules)
    known = angle_classes(rules)
    assert [column for one in known if one.part in GROUP_A for column in one.columns] == [
        column for part in GROUP_A for angle in dict.fromkeys(s.angle for s in STEPS if s.part == part)
        for column in COLUMNS_OF[angle]
    ]  # fmt: skip
    assert {column for one in known for column in one.columns} == set(COLUMNS)
    for one in known:
        name = one.columns[0]
        steps = [step for step in STEPS if name in COLUMNS_OF[step.angle]]
        points = sum((passed(step, values, rules).astype(int) for step in steps), np.zeros(len(values), int))
        first = one.classes[0].points
        assert [first + int(count) for count in points] == [one.class_of(float(value)).points for value in values], name
        assert [c.points for c in one.classes] == list(range(first, first + len(one.classes)))
        assert len({c.text for c in one.classes}) == len(one.classes)


def test_texts_of_classes_hold_the_edges_of_the_rules() -> None:
    texts = {one.columns[0]: [c.text for c in one.classes] for one in angle_classes(OWN)}
    assert texts["trunk_flexion"] == [
        "upright (within 3)", "up to 20 of flexion or extension", "20 to 60 of flexion, or over 20 of extension",
        "over 60",
    ]  # fmt: skip
    assert texts["trunk_twist"] == ["within 6", "twisted (over 6)"]
    assert texts["neck_side_bend"] == ["within 9", "side flexed (over 9)"]
    assert texts["upper_arm_abduction_left"] == ["up to 25", "abducted (over 25)"]
    assert texts["lower_arm_flexion_right"] == ["60 to 100", "under 60 or over 100"]
    assert texts["wrist_deviation_left"] == ["within 12", "bent (over 12)"]


def test_every_open_threshold_of_the_rules_is_the_edge_of_a_step() -> None:
    fields = {step.edge for step in STEPS if isinstance(step.edge, str)}
    assert fields == {
        name for name, value in vars(reba.PRESETS["paper"]).items() if value == 0.0 and value is not False
    }
    assert {step.angle for step in STEPS} == {angle for angles in PARTS.values() for angle in angles}
    assert all(step.angle in PARTS[step.part] for step in STEPS)
    assert len(STEPS) == 27, "model files of soft tables hold one number for each step"


def test_parts_hold_every_column_once() -> None:
    assert sorted(column for columns in PART_COLUMNS.values() for column in columns) == sorted(COLUMNS)
    assert all(
        name.endswith(SIDES) for part, columns in PART_COLUMNS.items() if part not in GROUP_A for name in columns
    )


@pytest.mark.parametrize(
    ("load", "points"), [(0, 0), (np.nextafter(5, 0), 0), (5, 1), (10, 1), (np.nextafter(10, 11), 2)]
)
def test_points_of_a_load(load: float, points: int) -> None:
    assert load_points(load) == points
    assert load_points(np.full(3, load)).tolist() == [points] * 3
