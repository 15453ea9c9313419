"""What happens when the time of a search is up."""

from __future__ import annotations

import time

import pytest

from lgp.kinematics.world import World
from lgp.path.bounds import PathBounds
from lgp.planner import follow, parse_sequence, task_of
from lgp.scene.scene_file import read_scene
from lgp.search import tree_search
from lgp.search.records import BoundResult, Budget, SearchStatus, Skeleton
from lgp.search.time_limit import TimeIsUp, stop_if_time_is_up, stopped_at_limit, time_is_up, time_limit
from lgp.search.tree_search import search
from tests.lgp.search.test_tree_search import task
from tests.support.lgp_worlds import HUMAN_ONLY
from tests.support.random_bounds import RandomBounds
from tests.support.says import says


def test_limits_end_with_their_block_and_the_earliest_one_counts() -> None:
    assert not time_is_up()
    with time_limit(1e9):
        with time_limit(0.0):
            assert time_is_up()
            with time_limit(1e9):
                assert time_is_up()
        assert not time_is_up()
    assert not time_is_up()


def test_only_what_is_not_needed_is_stopped_in_the_middle() -> None:
    with time_limit(0.0):
        stop_if_time_is_up()
        with stopped_at_limit(), pytest.raises(TimeIsUp):
            stop_if_time_is_up()
        stop_if_time_is_up()


@pytest.mark.parametrize("budget", [Budget(depth=5, seconds=0.3), Budget(depth=5, improving=0.3)])
def test_with_a_plan_a_search_stops_in_the_middle_of_a_problem(budget: Budget) -> None:
    class Endless(RandomBounds):
        """Solves one path; the next problem has no end."""

        def solve(
            self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = float("inf")
        ) -> BoundResult:
            while done:
                time.sleep(0.01)
                stop_if_time_is_up()
            result = super().solve(level, skeleton, warm, limit)
            done.extend([level] if level == "path" else [])
            return result

    done: list[str] = []
    result = search(task(), Endless(5, 0.0), budget)
    assert result.status is SearchStatus.GAP
    assert result.skeleton
    assert result.bound < result.cost
    assert result.seconds < 10.0


def test_without_a_plan_the_path_that_is_being_solved_has_little_more_time(monkeypatch: pytest.MonkeyPatch) -> None:
    class Endless(RandomBounds):
        def solve(
            self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = float("inf")
        ) -> BoundResult:
            while level == "path":
                time.sleep(0.01)
                stop_if_time_is_up()
            return super().solve(level, skeleton, warm, limit)

    monkeypatch.setattr(tree_search, "GRACE_SECONDS", 0.3)
    result = search(task(), Endless(5, 0.0), Budget(depth=5, seconds=0.3))
    assert result.status is SearchStatus.EXHAUSTED
    assert 0.6 <= result.seconds < 10.0
    says(result.reason, "time limit of 0.3 s", "allow more")


def test_without_a_plan_a_search_goes_on_until_its_time_is_up() -> None:
    class Late(RandomBounds):
        def solve(
            self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = float("inf")
        ) -> BoundResult:
            time.sleep(0.1)
            return super().solve(level, skeleton, warm, limit)

    result = search(task(), Late(5, 0.0), Budget(depth=5, improving=0.05))
    assert result.skeleton
    assert result.status is SearchStatus.GAP
    assert result.statistics["path"].solved == 1


def test_paths_ask_for_the_limit_in_every_iteration() -> None:
    scene = read_scene(HUMAN_ONLY)
    bounds = PathBounds(World(scene), collisions=False)
    skeleton = parse_sequence(task_of(scene), ["grasp(human.right_hand, box)"])
    with time_limit(0.0), stopped_at_limit(), pytest.raises(TimeIsUp):
        follow(bounds, skeleton)
    assert follow(bounds, skeleton).payload is not None, "nothing is kept of what was stopped"


def test_problems_know_the_limit_of_the_search_that_asks_them() -> None:
    seen = []

    class Slow(RandomBounds):
        def solve(
            self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = float("inf")
        ) -> BoundResult:
            seen.append(time_is_up())
            time.sleep(0.02)
            return super().solve(level, skeleton, warm, limit)

    result = search(task(), Slow(5, 0.0), Budget(depth=5, seconds=0.05))
    assert result.status in (SearchStatus.GAP, SearchStatus.EXHAUSTED)
    assert not seen[0]
    assert len(seen) < 10


def test_a_search_without_a_plan_says_which_limit_ended_it_and_what_it_had_tried() -> None:
    class Stuck(RandomBounds):
        """Finds no path from its first guess, and has others."""

        def solve(
            self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = float("inf")
        ) -> BoundResult:
            if level != "path":
                return super().solve(level, skeleton, warm, limit)
            time.sleep(0.3)
            return BoundResult(False, float("inf"), "path: arm.fore is 4 mm in table.bench", postponed=True)

    late = search(task(), Stuck(5, 0.0), Budget(depth=5, seconds=0.25))
    assert late.status is SearchStatus.EXHAUSTED
    says(late.reason, "time limit of 0.25 s", "allow more", "until then", "arm.fore is 4 mm in table.bench")
    few = search(task(), RandomBounds(7, 0.0), Budget(depth=5, calls={"pose": 0}))
    says(few.reason, "limit of problems", "allow more")


def test_a_sequence_whose_problem_is_interrupted_still_bounds_the_optimum() -> None:
    class Interrupted(RandomBounds):
        def solve(
            self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = float("inf")
        ) -> BoundResult:
            if done:
                raise KeyboardInterrupt
            result = super().solve(level, skeleton, warm, limit)
            done.extend([level] if level == "path" else [])
            return result

    done: list[str] = []
    truth = search(task(), RandomBounds(5, 0.0), Budget(depth=5))
    stopped = search(task(), Interrupted(5, 0.0), Budget(depth=5, keep_interrupted=True))
    assert stopped.status is SearchStatus.INTERRUPTED
    assert stopped.bound <= truth.cost == pytest.approx(truth.bound)
