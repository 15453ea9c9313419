"""Links of one robot: what the audit of plans looks at, the planner keeps apart, and what is joined it does not."""

from __future__ import annotations

import numpy as np
import pytest

from lgp.audit.audit import bodies_of
from lgp.audit.replay import replay
from lgp.audit.samples import Samples
from lgp.audit.shapes import ROBOT
from lgp.collision import joined_links
from lgp.collision.distances import Collisions
from lgp.kinematics.world import World
from lgp.plan_record import Plan
from lgp.scene.scene_file import load_scene
from tests.support.lgp_worlds import needs_robots

pytestmark = needs_robots


def kept_apart(world: World) -> set[frozenset[str]]:
    """Return the names of the links of one robot that the planner keeps apart."""
    collisions = Collisions(world)
    sides = [(collisions.shapes[one], collisions.shapes[other]) for one, other in collisions.pairs]
    return {
        frozenset(shape.name.partition("/")[0] for shape in pair)
        for pair in sides
        if pair[0].owner == pair[1].owner and pair[0].owner in world.scene.robots and pair[0].kind != "grip"
    }


@pytest.mark.parametrize("name", ["screwdriver", "screwdriver_panda"])
def test_what_the_audit_looks_at_the_planner_keeps_apart(name: str) -> None:
    scene = load_scene(name)
    world = World(scene)
    nothing = Plan(scene=scene, feasible=True, status="given", reason="", joints=world.joints,
                   start=world.initial_configuration, search={}, path=np.zeros((0, world.nq)))  # fmt: skip
    bodies, _, _, pairs = bodies_of(replay(Samples.of(nothing)))
    own = {
        frozenset((bodies[one].name, bodies[other].name))
        for one, other in pairs.tolist()
        if bodies[one].kind == ROBOT and bodies[one].owner == bodies[other].owner
    }
    kept = kept_apart(world)
    assert {pair for pair in own if len(pair) > 1} - kept == set()


def test_a_head_and_an_upper_arm_are_kept_apart_and_what_is_drawn_into_each_other_is_not() -> None:
    kept = kept_apart(World(load_scene("screwdriver")))
    assert frozenset(("baxter.collision_head_link_1", "baxter.right_upper_elbow_visual")) in kept
    assert frozenset(("baxter.right_lower_forearm", "baxter.right_upper_shoulder")) in kept
    assert frozenset(("baxter.right_upper_forearm_visual", "baxter.right_wrist")) not in kept
    kept = kept_apart(World(load_scene("screwdriver_panda")))
    assert frozenset(("panda.panda_link5", "panda.panda_hand")) in kept


def test_pairs_are_decided_as_if_all_positions_were_looked_at() -> None:
    rng = np.random.default_rng(0)
    count, positions = 40, joined_links.POSITIONS
    share = rng.uniform(0.0, 1.0, count)
    distance = np.where(rng.uniform(size=(positions, count)) < share, -0.1, rng.uniform(0.0, 0.03, (positions, count)))
    enough = np.where(np.arange(count) % 2, 1, joined_links.DRAWN * positions)
    at, pairs = np.nonzero(rng.uniform(size=distance.shape) < 0.9)
    looked_at = []

    def distances(some: np.ndarray) -> np.ndarray:
        looked_at.append(len(some))
        return distance[at[some], pairs[some]]

    meet, near = joined_links._counts(at, pairs, distances, enough)
    all_meet, all_near = (
        np.bincount(pairs[distance[at, pairs] < least], minlength=count) for least in (0.0, joined_links.NEAR)
    )
    assert np.array_equal(meet >= enough, all_meet >= enough)
    free = all_meet < enough
    half = joined_links.DRAWN * positions
    assert np.array_equal(near[free] >= half, all_near[free] >= half)
    assert sum(looked_at) < 0.8 * len(pairs)


def test_a_robot_is_looked_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load_scene("screwdriver_panda")
    kept = kept_apart(World(scene))
    monkeypatch.setattr(joined_links, "_counts", None)
    assert kept_apart(World(scene)) == kept
