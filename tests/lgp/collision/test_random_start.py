"""Random starting postures: legal, on their feet, touching nothing, and different."""

from __future__ import annotations

import numpy as np
import pytest

import reba
from lgp.collision.distances import Collisions
from lgp.collision.random_start import random_start
from lgp.errors import WorldError
from lgp.kinematics.posture import PostureMap
from tests.support.lgp_worlds import human_world, needs_robots, screwdriver_world
from tests.support.says import says


@pytest.mark.parametrize("legs", ["planted", "solved", "locked"])
def test_a_random_start_is_inside_limits_with_the_feet_down(legs: str) -> None:
    world = human_world(legs)
    for seed in range(3):
        q = random_start(world, np.random.default_rng(seed))
        assert np.all((q >= world.lower) & (q <= world.upper))
        if legs == "solved":
            assert PostureMap(world).leg_shortfall(q[None])[0].max() <= 0.0
        if legs == "planted":
            found = world.at(q[None], world.planted)
            for sole, (_, position) in world.planted.items():
                np.testing.assert_allclose(found.placement(sole).position[0], position, atol=1e-9)


@needs_robots
def test_random_starts_touch_nothing_and_score_worse_than_rest() -> None:
    world = screwdriver_world()
    drawn = np.array([random_start(world, np.random.default_rng(seed)) for seed in range(8)])
    collisions = Collisions(world)
    kinematics = world.at(drawn, collisions.frames)
    rows = collisions.near_pairs(kinematics, np.zeros(8, dtype=int), np.zeros(0), within=0.02)
    found = collisions.distances(kinematics, np.zeros(8, dtype=int), np.zeros(0), *rows)
    of_human = np.array(["human." in collisions.name(pair) for pair in found.pairs])
    assert np.all(found.value[of_human] > 0.0)
    scores = reba.score_array(PostureMap(world).angles(drawn)).reba
    assert scores.mean() > 4.0
    np.testing.assert_array_equal(drawn[0], random_start(world, np.random.default_rng(0)))
    assert np.ptp(drawn[:, world.columns("baxter")], axis=0).max() == 0.0


def test_a_scene_without_room_says_so() -> None:
    world = human_world()
    table = {"position": (0.3, -0.2), "height": 1.6, "thickness": 1.4}
    tables = {name: type(old)(**{**vars(old), **table}) for name, old in world.scene.tables.items()}
    crowded = world.with_scene(type(world.scene)(**{**vars(world.scene), "tables": tables}))
    with pytest.raises(WorldError) as error:
        random_start(crowded, np.random.default_rng(0), draws=30)
    says(error, "30 random postures", "move the tables away")
