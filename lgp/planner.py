"""The one place that joins logic, search and paths: a scene in, a plan out.

scene -> task -> search over sequences, each bounded by pose, sequence and path problems -> Plan
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import dreba
from dreba.surrogates.base import Surrogate
from lgp.errors import LgpError, LogicError
from lgp.kinematics.posture import PostureMap
from lgp.kinematics.world import World
from lgp.kinematics.world import World as Model
from lgp.logic.pddl import SHIPPED, PddlDomain, load_domain
from lgp.logic.task import Action, Task, ground, parse_atom
from lgp.path.bounds import PathBounds
from lgp.path.costs import Weights
from lgp.path.ergonomics import Ergonomics
from lgp.path.keyframes import Solution
from lgp.plan_record import Plan
from lgp.scene.model import Scene
from lgp.scene.scene_file import load_scene
from lgp.search.tree_search import BoundResult, Budget, LevelStatistics, SearchResult, SearchStatus, Skeleton, search
from reba.arrays import Array

COST = "convex"
"""The shipped model that is planned with by default: it is convex, and least near rest."""


def plan(
    scene: Scene | str | Path,
    cost: Surrogate | Ergonomics | str | Path | None = COST,
    *,
    sequence: Iterable[str] | None = None,
    depth: int | None = None,
    seconds: float = float("inf"),
    start: Array | None = None,
    slices: int | None = None,
    weights: Weights | None = None,
    world: World | None = None,
    collisions: bool = True,
) -> Plan:
    """Return the best sequence of actions and the motion of everybody.

    Args:
        scene: a scene, the name of one that is shipped, or a TOML file.
        cost: a dREBA surrogate, its file or the name of a shipped one; None plans without ergonomics. An `Ergonomics`
            of a world with the same agents saves preparing it again.
        sequence: actions to plan for instead of searching, as the paper prints them: `grasp(1, baxter.right, box)`, or
            without the step.
        depth: longest sequence, the scene's by default.
        seconds: wall-clock time for the search; the best plan so far is returned.
        start: (nq,) first configuration [rad, m], in the order of `Plan.joints`; the scene's by default.
        slices: per phase, the scene's by default.
        weights: of the terms of the cost.
        world: kinematics of this scene's agents, to save building them again.
        collisions: whether bodies are kept apart; `residuals["penetration"]` says how far they touch either way.

    Returns:
        A plan; `feasible` says whether there is one, `reason` why not.

    Raises:
        LgpError: the scene, model, sequence or start cannot be used.

    Example:
        >>> import lgp
        >>> found = lgp.plan(lgp.load_scene("screwdriver"), cost=None)      # doctest: +SKIP
        >>> found.actions                                                   # doctest: +SKIP
        ('grasp(1, baxter.right, screwdriver)', ...)
    """

    chosen = scene if isinstance(scene, Scene) else load_scene(scene)
    task = task_of(chosen)
    wanted = None if sequence is None else parse_sequence(task, sequence)
    there = _world(chosen, world)
    first = _start(there, start)
    bounds = PathBounds(there, _ergonomics(there, cost), weights, first, slices, collisions=collisions)
    return plan_within(bounds, task, wanted, Budget(depth=chosen.depth if depth is None else depth, seconds=seconds))


def plan_within(
    bounds: PathBounds, task: Task, sequence: Skeleton | None = None, budget: Budget | None = None, first: Skeleton = ()
) -> Plan:
    """Return the plan that prepared bounds lead to; what they solved before for the same scene is not solved again.

    Args:
        bounds: cost, start and kinematics of the scene.
        task: of the scene.
        sequence: actions to follow instead of searching.
        budget: of the search.
        first: actions to look at first, as for `lgp.search.tree_search.search`.
    """
    found = search(task, bounds, budget, first) if sequence is None else follow(bounds, sequence)
    return _record(bounds.world.scene, bounds, found)


def task_of(scene: Scene) -> Task:
    """Return the symbolic task of a scene.

    Raises:
        LogicError: the domain, the initial state or the goal cannot be used.
    """
    return ground(_domain(scene.domain), scene.objects, map(parse_atom, scene.initial), map(parse_atom, scene.goal))


def _domain(which: str) -> PddlDomain:
    """Return a domain; the shipped ones are read once."""
    return _shipped(which) if (SHIPPED / f"{which}.pddl").is_file() else load_domain(which)


@cache
def _shipped(name: str) -> PddlDomain:
    return load_domain(name)


def parse_sequence(task: Task, lines: Iterable[str]) -> Skeleton:
    """Return the actions that lines of text name; blank lines and lines that start with # are skipped.

    Raises:
        LogicError: an action is unknown or cannot be done when its turn comes, or the goal does not hold at the end.
    """
    state = task.initial
    actions: list[Action] = []
    for line in lines:
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        action = task.action(re.sub(r"\(\s*\d+\s*,", "(", text, count=1))
        if not action.applies(state):
            missing = [str(atom) for bit, atom in enumerate(task.atoms) if action.needs & ~state & (1 << bit)]
            what = f"{', '.join(missing)} does not hold" if missing else "something holds that must not"
            raise LogicError(f"sequence: {action.at(len(actions) + 1)} cannot be done: {what}; correct the sequence")
        state = action.apply(state)
        actions.append(action)
    if not task.is_goal(state):
        raise LogicError(
            f"sequence: the goal does not hold after its {len(actions)} actions; add those that are missing"
        )
    return tuple(actions)


def follow(bounds: PathBounds, skeleton: Skeleton) -> SearchResult:
    """Solve all levels of one sequence, as the search would on its way down."""
    import time

    begin = time.perf_counter()
    solved = {level: LevelStatistics() for level in bounds.levels}
    steps: list[tuple[str, Skeleton]] = [("pose", skeleton[: end + 1]) for end in range(len(skeleton))]
    result: BoundResult | None = None
    for level, actions in (*steps, *((level, skeleton) for level in bounds.levels[1:])):
        result = bounds.solve(level, actions, result)
        solved[level] = solved[level].plus(result, result.seconds)
        if not result.feasible:
            break
    good = result is not None and result.feasible
    return SearchResult(
        status=SearchStatus.OPTIMAL if good else SearchStatus.INFEASIBLE,
        skeleton=skeleton if good else (),
        cost=result.cost if result is not None else float("inf"),
        payload=result.payload if result is not None else None,
        bound=result.cost if result is not None else float("inf"),
        nodes=(),
        statistics=solved,
        expanded=0,
        pruned=0,
        seconds=time.perf_counter() - begin,
        reason="" if result is None else result.reason,
    )


def _world(scene: Scene, world: World | None) -> World:
    if world is not None:
        return world.with_scene(scene)

    return Model(scene)


def _start(world: World, start: Array | None) -> Array:
    if start is None:
        return world.start
    first = np.asarray(start, dtype=float)
    if first.shape != (world.nq,) or not np.isfinite(first).all():
        raise LgpError(f"start has shape {first.shape}, expected ({world.nq},) finite numbers, one per joint")
    return np.clip(first, world.lower, world.upper)


def _ergonomics(world: World, cost: Surrogate | Ergonomics | str | Path | None) -> Ergonomics | None:
    if cost is None or world.scene.human is None:
        return None

    if isinstance(cost, Ergonomics):
        return cost
    return Ergonomics(world, dreba.load(cost) if isinstance(cost, (str, Path)) else cost)


def _record(scene: Scene, bounds: PathBounds, found: SearchResult) -> Plan:
    """Return the plan of a search, its residuals recomputed from the path."""
    levels = {f"{level}s": numbers.solved for level, numbers in found.statistics.items()}
    counts: dict[str, Any] = {"expanded": found.expanded, "pruned": found.pruned, **levels, "seconds": found.seconds}
    counts |= {
        "bound": found.bound,
        "gap": found.gap,
        "levels": {
            level: {"solved": n.solved, "infeasible": n.infeasible, "known": n.known, "seconds": n.seconds}
            for level, n in found.statistics.items()
        },
    }
    common: dict[str, Any] = {
        "scene": scene,
        "status": found.status.name.lower(),
        "reason": found.reason,
        "joints": bounds.world.joints,
        "start": bounds.initial_configuration,
        "search": counts,
        "tree": found.nodes,
    }
    if not found.skeleton:
        return Plan(feasible=False, **common)
    solution: Solution = found.payload
    return Plan(feasible=True, **common, **_motion(bounds, found.skeleton, solution))


def _motion(bounds: PathBounds, skeleton: Sequence[Action], solution: Solution) -> dict[str, Any]:

    phases = bounds.phases(tuple(skeleton))
    problem = bounds.problem("path", phases)
    path = solution.keyframes if solution.path is None else solution.path
    x = problem.join(path, solution.variables)
    costs = problem.costs(x)
    touching = bounds.paths.collision_constraints(phases).deepest_penetration(*problem.split(x))
    posture = np.zeros((0, 0))
    if bounds.world.scene.human is not None:
        posture = PostureMap(bounds.world).angles(path)
    return {
        "actions": tuple(phases.label(number) for number in range(phases.count)),
        "time": phases.times(),
        "phase": np.repeat(np.arange(phases.count), phases.slices),
        "path": path,
        "variables": dict(zip(problem.modes.names, solution.variables.tolist(), strict=True)),
        "posture": posture,
        "carried": phases.loads(),
        "costs": {"total": costs.total, "acceleration": costs.acceleration, "ergonomics": costs.ergonomics},
        "residuals": problem.constraints.residuals(*problem.split(x)) | {"penetration": touching[0]},
        "solver": {
            "status": solution.result.status.name.lower(),
            "kkt": solution.result.kkt,
            "iterations": len(solution.result.iterations) - 1,
            "seconds": solution.result.seconds["total"],
        },
    }
