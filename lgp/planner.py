"""Planning by multi-bound tree search (Toussaint & Lopes 2017): a scene in, a plan out.

scene -> symbolic task -> search over action sequences with pose, sequence and path bounds -> `Plan`
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

import dreba
from dreba.surrogates.base import Surrogate
from lgp.audit.audit import audit_plan
from lgp.collision.start_check import check_start, start_penetrations
from lgp.concurrency import with_concurrent_actions
from lgp.defaults import SCENE_COST
from lgp.errors import LgpError, LogicError
from lgp.kinematics.posture import PostureMap
from lgp.kinematics.world import World
from lgp.logic.pddl import SHIPPED, PddlDomain, load_domain
from lgp.logic.task import Action, Task, ground, numbered, parse_atom, parse_goal
from lgp.path.bounds import PathBounds
from lgp.path.costs import Costs, Weights
from lgp.path.ergonomics import Ergonomics
from lgp.path.keyframes import Solution
from lgp.path.partial_order import depends, same_phase
from lgp.path.places import leaving_places
from lgp.plan_record import PersonPostures, Plan
from lgp.scene.consistency import check_first_facts
from lgp.scene.model import Scene
from lgp.scene.scene_file import load_scene
from lgp.search.reasons import why_cut_short
from lgp.search.records import (
    BoundResult,
    Budget,
    LevelStatistics,
    SearchProgress,
    SearchResult,
    SearchStatus,
    Skeleton,
)
from lgp.search.time_limit import TimeIsUp, stopped_at_limit, time_limit
from lgp.search.tree_search import search
from reba.arrays import Array
from reba.checks import COUNT, PATH, YES_NO, Allowed, accepts, from_home, is_number

SCENE: Final = Allowed(
    "a scene, or the name or path of one", lambda value: isinstance(value, Scene) or PATH.fits(value), from_home
)
COST_MODEL: Final = Allowed(
    "a surrogate, its name or path, or None",
    lambda value: value is None or isinstance(value, Surrogate | Ergonomics) or PATH.fits(value),
    from_home,
)
INTERRUPTED: Final = SearchStatus.INTERRUPTED.name.lower()
"""`Plan.status` after an interrupt."""
SEARCH_SHARE: Final = 0.6
"""Share of the time limit after which a search with a plan ends where concurrent actions of it are tried then."""
SECONDS: Final = Allowed("seconds above 0", lambda value: is_number(value) and value > 0)


@accepts(
    LgpError,
    scene=SCENE,
    cost=COST_MODEL,
    depth=COUNT.or_none(),
    seconds=SECONDS,
    slices=COUNT.or_none(),
    collisions=YES_NO,
    accept_start=YES_NO,
)
def plan(
    scene: Scene | str | Path,
    cost: Surrogate | Ergonomics | str | Path | None = SCENE_COST,
    *,
    sequence: Iterable[str] | None = None,
    depth: int | None = None,
    seconds: float = float("inf"),
    start: Array | None = None,
    slices: int | None = None,
    weights: Weights | None = None,
    world: World | None = None,
    collisions: bool = True,
    accept_start: bool = False,
    on_progress: Callable[[SearchProgress], None] | None = None,
) -> Plan:
    """Return the sequence of actions and the motion of all agents with the least cost.

    Args:
        scene: a scene, the name of a shipped one, or the path of a TOML file.
        cost: a dREBA surrogate, its file or the name of a shipped one, by default that of the scene; None plans without
            ergonomics. An `Ergonomics` of a world with the same agents saves preparing it again.
        sequence: actions to plan for instead of searching, as a plan prints them: `grasp(1, baxter.right, box)`; the
            number of the phase may be left out, and actions with the same one happen at the same time.
        depth: longest sequence of actions, the scene's by default.
        seconds: wall-clock limit of the search or of the given sequence [s], concurrent actions included; the best plan
            so far is returned. Only while there is none, the path that is being solved then has 10 s more, or a
            tenth of the limit; that of a given sequence is finished.
        start: initial configuration (nq,) [rad, m] in the order of `Plan.joints`, the scene's by default.
        slices: per phase, the scene's by default.
        weights: of the terms of the cost, by default those of the scene.
        world: kinematics with the agents of this scene, to save building them.
        collisions: constrain the path to be collision-free; `residuals["penetration"]` is computed either way.
        accept_start: plan from a start in which bodies are in each other; otherwise it is refused.
            `residuals["start_penetration"]` is the depth [m].
        on_progress: called now and then with what the search knows so far: `cost`, `bound`, `gap`, and its `step`.

    Returns:
        The plan with what an independent `audit` of it found, without actions where the goal holds already; the best so
        far after an interrupt (Ctrl-C) of the search. Where `feasible` is false, `reason` names the constraint or
        precondition that fails.

    Raises:
        LgpError: the scene, model, sequence or initial configuration is invalid.

    Example:
        >>> import lgp
        >>> from dataclasses import replace
        >>> scene = lgp.load_scene("screwdriver")
        >>> scene = replace(scene, goal=("grasped(baxter.right, screwdriver)",))
        >>> lgp.plan(scene, cost=None, collisions=False).actions
        ('grasp(1, baxter.right, screwdriver)',)
    """
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    check_first_facts(scene)
    task = task_of(scene)
    skeleton = None if sequence is None else parse_sequence(task, sequence)
    world = World(scene) if world is None else world.with_scene(scene)
    initial = _initial_configuration(world, start)
    if collisions and not accept_start and not task.is_goal(task.initial):
        check_start(world, initial)
    bounds = PathBounds(world, _ergonomics(world, cost), weights, initial, slices, collisions=collisions)
    budget = Budget(
        scene.depth if depth is None else depth, seconds=seconds, keep_interrupted=True, on_progress=on_progress
    )
    begin = time.perf_counter()
    alone = plan_within(bounds, task, skeleton, with_time_left(budget, scene))
    if on_progress is not None and scene.concurrent and alone.feasible:
        counts = alone.search
        known = counts["expanded"], counts["paths"], alone.costs["total"], counts["bound"]
        on_progress(SearchProgress("trying actions at the same time", *known))
    return at_the_same_time(bounds, task, alone, seconds - (time.perf_counter() - begin))


def with_time_left(budget: Budget, scene: Scene) -> Budget:
    """Return the budget of a search that leaves time for concurrent actions, where its scene asks for them."""
    return replace(budget, improving=SEARCH_SHARE * budget.seconds) if scene.concurrent else budget


def plan_within(
    bounds: PathBounds, task: Task, sequence: Skeleton | None = None, budget: Budget | None = None, first: Skeleton = ()
) -> Plan:
    """Return the plan from prepared bounds, which keep solved problems from earlier calls for the same scene.

    A `sequence` is planned for instead of searching; `first` is as for `lgp.search.tree_search.search`.
    """
    budget = budget or Budget()
    result = search(task, bounds, budget, first) if sequence is None else follow(bounds, sequence, budget.seconds)
    return plan_of(bounds, _with_better_motion(bounds, result, budget))


def _with_better_motion(bounds: PathBounds, result: SearchResult, budget: Budget) -> SearchResult:
    """Return a result with a cheaper motion of the same actions, where one is found in the time that is left."""
    if not isinstance(result.payload, Solution) or result.status is SearchStatus.INTERRUPTED:
        return result
    begin = time.perf_counter()
    if budget.on_progress is not None:
        paths = result.statistics[bounds.levels[-1]].solved
        known = SearchProgress("improving the motion", len(result.nodes), paths, result.cost, result.bound)
        budget.on_progress(known)
    try:
        with time_limit(min(budget.seconds, budget.improving) - result.seconds), stopped_at_limit():
            better = bounds.improved(result.skeleton)
    except TimeIsUp:
        return replace(result, seconds=result.seconds + time.perf_counter() - begin)
    except KeyboardInterrupt:
        if not budget.keep_interrupted:
            raise
        return replace(result, status=SearchStatus.INTERRUPTED, reason="interrupted")
    cost = better.costs.total
    for node in result.nodes:
        if node.skeleton == result.skeleton:
            node.costs[bounds.levels[-1]] = cost
    seconds = result.seconds + time.perf_counter() - begin
    return replace(result, cost=cost, payload=better, bound=min(result.bound, cost), seconds=seconds)


def plan_of(bounds: PathBounds, result: SearchResult) -> Plan:
    """Return the plan of a search with these bounds, and what its audit found."""
    plan = _record(bounds.world.scene, bounds, result)
    return replace(plan, audit=audit_plan(plan).summary()) if plan.feasible else plan


def at_the_same_time(bounds: PathBounds, task: Task, plan: Plan, seconds: float = math.inf) -> Plan:
    """Return a plan with concurrent actions, where its scene asks for them and it has none yet.

    Args:
        bounds: of the plan.
        plan: returned as it is after an interrupt (Ctrl-C).
        seconds: wall-clock limit; what is solved then is dropped.
    """
    given = not plan.actions or len(plan.durations) < len(plan.actions) or plan.status == INTERRUPTED
    if given or not plan.scene.concurrent:
        return plan
    skeleton = parse_sequence(task, plan.actions)
    try:
        with time_limit(seconds), stopped_at_limit():
            return with_concurrent_actions(plan, skeleton, lambda actions: plan_within(bounds, task, actions))
    except KeyboardInterrupt:
        return replace(plan, status=INTERRUPTED)


def task_of(scene: Scene) -> Task:
    """Return the symbolic task of a scene; LogicError where its domain, initial state or goal is invalid."""
    first, goals = map(parse_atom, scene.initial), parse_goal(scene.goal)
    return leaving_places(ground(_domain(scene.domain), scene.object_types, first, *goals))


def _domain(which: str) -> PddlDomain:
    """Return a shipped domain (read once) or the one in a file."""
    return _shipped(which) if os.path.isfile(SHIPPED / f"{which}.pddl") else load_domain(which)


@cache
def _shipped(name: str) -> PddlDomain:
    return load_domain(name)


def parse_sequence(task: Task, lines: Iterable[str]) -> Skeleton:
    """Return the actions named by lines of text; blank lines and lines that start with # are skipped.

    Raises:
        LogicError: an action is unknown or not applicable at its step, it depends on one of the same number, or the
            goal is not satisfied at the end.
    """
    state = task.initial
    actions: list[Action] = []
    texts = [text for line in lines if (text := line.strip()) and not text.startswith("#")]
    for text, together in numbered(texts):
        action = replace(task.action(text), together=together)
        beside = next((one for one in same_phase(actions) if together and depends(action, one)), None)
        if beside is not None:
            raise LogicError(
                f"sequence: {action} and {beside} have the same number and cannot be at the same time, as one depends "
                "on the other or they share an agent or object; give each a number of its own"
            )
        if not action.applies(state):
            missing = ", ".join(map(str, task.holding(action.needs & ~state)))
            forbidden = ", ".join(map(str, task.holding(action.forbids & state)))
            what = f"needs {missing}" if missing else f"must not have {forbidden}"
            raise LogicError(
                f"sequence: {action.at(len(actions) + 1)} is not applicable: it {what}; correct the sequence"
            )
        state = action.apply(state)
        actions.append(action)
    if not task.is_goal(state):
        raise LogicError(
            f"sequence: the goal is not satisfied after its {len(actions)} actions; add the missing actions"
        )
    return tuple(actions)


def follow(bounds: PathBounds, skeleton: Skeleton, seconds: float = math.inf) -> SearchResult:
    """Solve all bound levels of one sequence, in the order of the search; after so many seconds none is improved."""
    begin = time.perf_counter()
    solved = {level: LevelStatistics() for level in bounds.levels}
    steps: list[tuple[str, Skeleton]] = [("pose", skeleton[: end + 1]) for end in range(len(skeleton))]
    steps += [(level, skeleton) for level in bounds.levels[1:]]
    result = BoundResult(True, 0.0)
    with time_limit(seconds):
        for level, actions in steps if skeleton else ():
            result = bounds.solve(level, actions, result, thorough=True)
            solved[level] = solved[level].plus(result, result.seconds)
            if not result.feasible:
                break
    given = SearchStatus.CONCURRENT if any(action.together for action in skeleton) else SearchStatus.GIVEN
    failed = SearchStatus.EXHAUSTED if result.postponed else SearchStatus.INFEASIBLE
    return SearchResult(
        status=given if result.feasible else failed,
        skeleton=skeleton if result.feasible else (),
        cost=result.cost,
        payload=result.payload,
        # No cost is negative; of other sequences nothing more is known.
        bound=0.0 if result.feasible or result.postponed else math.inf,
        nodes=(),
        statistics=solved,
        expanded=0,
        pruned=0,
        seconds=time.perf_counter() - begin,
        reason=why_cut_short(seconds, [result.reason]) if result.postponed else result.reason,
    )


def _initial_configuration(world: World, start: Array | None) -> Array:
    if start is None:
        return world.initial_configuration
    q = np.asarray(start, dtype=float)
    if q.shape != (world.nq,) or not np.isfinite(q).all():
        raise LgpError(
            f"start has shape {q.shape}, expected ({world.nq},) finite numbers; give one for each of `Plan.joints`"
        )
    world.check_limits(q, "`start`")
    return np.clip(q, world.lower, world.upper)


def _ergonomics(world: World, cost: Surrogate | Ergonomics | str | Path | None) -> Ergonomics | None:
    if cost is None or not world.scene.humans:
        return None
    if isinstance(cost, Ergonomics):
        return cost
    cost = world.scene.cost_model(cost)
    return Ergonomics(world, dreba.load(cost) if isinstance(cost, (str, Path)) else cost)


def _record(scene: Scene, bounds: PathBounds, result: SearchResult) -> Plan:
    """Return the plan of a search, with residuals recomputed from the path."""
    levels = {f"{level}s": numbers.solved for level, numbers in result.statistics.items()}
    counts: dict[str, Any] = {"expanded": result.expanded, "pruned": result.pruned, **levels, "seconds": result.seconds}
    counts |= {
        "bound": result.bound,
        "gap": result.gap,
        "levels": {
            level: {"solved": n.solved, "infeasible": n.infeasible, "known": n.known, "seconds": n.seconds}
            for level, n in result.statistics.items()
        },
    }
    common: dict[str, Any] = {
        "scene": scene,
        "status": result.status.name.lower(),
        "reason": result.reason,
        "joints": bounds.world.joints,
        "start": bounds.initial_configuration,
        "search": counts,
        "tree": result.nodes,
        "weights": asdict(bounds.weights),
    }
    if np.isinf(result.cost):
        return Plan(feasible=False, **common)
    if not result.skeleton:
        return Plan(feasible=True, **common, **_rest(bounds))
    solution: Solution = result.payload
    return Plan(feasible=True, **common, **_motion(bounds, result.skeleton, solution))


def _rest(bounds: PathBounds) -> dict[str, Any]:
    """Return the motion of a plan without actions, for a goal that holds already."""
    return {
        "path": np.zeros((0, bounds.world.nq)),
        "costs": {"total": 0.0} | asdict(Costs(0.0, 0.0)),
        "residuals": {"equality": 0.0, "inequality": 0.0, "metres": 0.0, "radians": 0.0, "penetration": 0.0}
        | _start_penetration(bounds),
    }


def _start_penetration(bounds: PathBounds) -> dict[str, float]:
    depths = [one.depth for one in start_penetrations(bounds.world, bounds.initial_configuration)]
    return {"start_penetration": max(depths, default=0.0)}


def _motion(bounds: PathBounds, skeleton: Sequence[Action], solution: Solution) -> dict[str, Any]:
    phases = bounds.phases(tuple(skeleton), solution.durations)
    problem = bounds.problem("path", phases)
    path = solution.keyframes if solution.path is None else solution.path
    x = problem.join(path, solution.variables)
    costs = problem.costs(x)
    penetration, *_ = bounds.paths.collision_constraints(phases).deepest_penetration(*problem.split(x))
    carried = phases.loads()
    people = {
        name: PersonPostures(PostureMap(bounds.world, person).angles(path), carried[:, at])
        for at, (name, person) in enumerate(bounds.world.scene.humans.items())
    }
    return {
        "actions": tuple(phases.label(number) for number in range(len(phases.actions))),
        "time": phases.times(),
        "phase": np.repeat(np.arange(phases.count), phases.slices),
        "path": path,
        "variables": dict(zip(problem.modes.names, solution.variables.tolist(), strict=True)),
        "people": people,
        "costs": {"total": costs.total} | asdict(costs),
        "residuals": problem.constraints.residuals(*problem.split(x))
        | {"penetration": penetration}
        | _start_penetration(bounds),
        "solver": {
            "status": solution.result.status.name.lower(),
            "kkt": solution.result.kkt,
            "iterations": len(solution.result.iterations) - 1,
            "seconds": solution.result.seconds["total"],
        },
        "starts": dict(zip(("agreed", "of"), solution.starts, strict=True)),
    }
