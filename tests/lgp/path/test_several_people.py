"""Costs and constraints of several people: those of each, added and side by side."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

import dreba
from lgp.kinematics.world import World
from lgp.path.constraints import Constraints
from lgp.path.ergonomics import Ergonomics
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.planner import parse_sequence, task_of
from lgp.scene.scene_file import read_scene
from tests.support.two_people import two_people

SEQUENCE = (
    "grasp(anna.right_hand, rod)",
    "handover(anna.right_hand, rod, bert.left_hand)",
    "place(bert.left_hand, rod, table.bert)",
)


@cache
def both() -> World:
    return World(read_scene(two_people()))


@cache
def ergonomics() -> Ergonomics:
    return Ergonomics(both(), dreba.load("convex"))


def phases() -> Phases:
    task = task_of(both().scene)
    return Phases.of(both().scene, parse_sequence(task, SEQUENCE), 10)


def test_the_score_is_the_sum_of_the_scores_of_each() -> None:
    world = both()
    q = np.random.default_rng(0).uniform(world.lower, world.upper, (20, world.nq))
    q[:, [world.column[f"{name}.pelvis_z"] for name in world.scene.humans]] = -0.1
    loads = np.tile([2.0, 7.0], (20, 1))
    score, added = np.zeros(20), np.zeros(20)
    for at, (name, person) in enumerate(world.scene.humans.items()):
        alone = World(replace(world.scene, humans={name: person}, objects={}, initial=(), goal=()))
        own = Ergonomics(alone, dreba.load("convex"))
        columns = [world.column[joint] for joint in alone.joints]
        score += own.value(q[:, columns], loads[:, at])
        added += own.payload(loads[:, at])
    np.testing.assert_allclose(ergonomics().value(q, loads), score, rtol=1e-12)
    np.testing.assert_allclose(ergonomics().payload(loads), added, rtol=1e-12)
    value, gradient, blocks = ergonomics().quadratic_model(q, loads)
    np.testing.assert_allclose(value, score, rtol=1e-12)
    assert gradient.shape == (20, len(ergonomics().columns))
    assert [block.shape[1] for block in blocks] == [len(part) for part in ergonomics().parts]
    step = 1e-6
    for column in (3, len(ergonomics().columns) - 4):
        moved = q.copy()
        moved[:, ergonomics().columns[column]] += step
        slope = (ergonomics().value(moved, loads) - score) / step
        np.testing.assert_allclose(gradient[:, column], slope, atol=1e-3)


def test_the_load_is_that_of_the_person_whose_hand_has_it() -> None:
    assert phases().loads()[::10].tolist() == [[0.0, 0.0], [1.5, 0.0], [0.0, 1.5]]


def test_the_legs_of_each_reach() -> None:
    world, steps = both(), phases()
    problem = PathProblem(world, steps, ergonomics=ergonomics())
    rows = [(row.name, row.number) for row in problem.constraints.in_rows if row.kind == "leg"]
    assert rows == [(name, at) for name in ("anna", "bert") for at in range(steps.total)]
    q = np.tile(world.initial_configuration, (steps.total, 1))
    q[4, world.column["bert.pelvis_x"]] += 1.5
    x = problem.join(q, np.zeros(problem.modes.size))
    q, z = problem.split(x)
    q = q.copy()
    q[4, world.column["bert.pelvis_x"]] = world.initial_configuration[world.column["bert.pelvis_x"]] + 1.5
    legs = [row.kind == "leg" for row in problem.constraints.in_rows]
    short = np.flatnonzero(problem.constraints.evaluate(q, z).inequality[legs] > 0.0)
    assert short.tolist() == [steps.total + 4]
    assert isinstance(problem.constraints, Constraints)


def test_the_model_of_the_path_is_that_of_both() -> None:
    """The gradient of the cost by finite differences, with two people."""
    world, steps = both(), phases()
    problem = PathProblem(world, steps, ergonomics=ergonomics())
    rng = np.random.default_rng(1)
    q = np.tile(world.initial_configuration, (steps.total, 1)) + rng.uniform(-0.05, 0.05, (steps.total, world.nq))
    q[:, [world.column[f"{name}.pelvis_z"] for name in world.scene.humans]] = -0.1
    x = problem.join(q, np.zeros(problem.modes.size))
    model = problem.linearise(x, np.zeros(len(problem.constraints.eq_rows)), np.zeros(problem.constraints.always))
    for at in rng.choice(steps.total * world.nq, 12, replace=False):
        high, low = x.copy(), x.copy()
        high[at] += 1e-6
        low[at] -= 1e-6
        slope = (problem.evaluate(high)[0] - problem.evaluate(low)[0]) / 2e-6
        assert abs(model.gradient[at] - slope) < 1e-4 * max(1.0, abs(slope))
