"""Path by constraint generation: constrain the pairs of bodies that are near and joints that are fast, solve again.

Between two rounds the set of active constraints, and with it the sparsity pattern, is fixed; multipliers and active
set warm-start the next round. The path is the local minimum near its initial guess. Where that one is expensive,
multi-start solves from other initial guesses, to a coarse tolerance, and returns the cheapest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from lgp.kinematics.world import World
from lgp.path.active_constraints import ActiveConstraints, MotionConstraints
from lgp.path.collision_constraints import MARGIN_TOLERANCE, CollisionConstraints
from lgp.path.feasibility import CLOSE
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.path.sampled_motion import MOTIONS, Motion
from lgp.search.time_limit import time_is_up
from lgp.sqp.merit import violation_max
from lgp.sqp.problem import SolverOptions
from lgp.sqp.result import Result, SolveStatus
from lgp.sqp.solver import Solver
from reba.arrays import Array, Indices

ROUNDS = 12
"""Rounds of constraint generation."""
ROUND_ITERATIONS = 8
"""SQP iterations of a round before the last, at most."""
ROUND_DECREASE = 1e-4
"""Predicted decrease, relative to the cost, that ends a round before the last."""
FINAL_ITERATIONS = 20
"""SQP iterations of the last round, at most: distances have edges, where steps get ever shorter."""
FINAL_DECREASE = 1e-5
"""Predicted decrease, relative to the cost, that ends the last round: constraints added later change it by more."""
MAX_STEP = 0.3
"""[rad, m] Largest change of an unknown per iteration: distances are too curved for longer steps."""
COMPARABLE_VIOLATION = 1e-2
"""[m, rad] Violation up to which the cost is near that of the feasible path."""
STUCK, STUCK_ROUNDS = (SolveStatus.INFEASIBLE, SolveStatus.STALLED), 2
"""Rounds in turn that end so, with a larger violation: more constraints get no path out of there."""
IMPLAUSIBLE_ROUNDS = 2
"""Rounds in turn that cost too much before any path is found: they hardly ever lead back to a cheap one."""
DEARER = 1.01
"""Cost of a path with part of its constraints, relative to the best plan, from which on it is given up: constraints
that are added later seldom make a path cheaper, and never by that much as far as is known."""
UNSETTLED = 1.25
"""The same for a round that did not end at a minimum, relative to one that did: its cost may still fall."""

ProblemOf = Callable[[ActiveConstraints], PathProblem]
"""Active constraints -> path problem."""


def solve_constrained(
    problem_of: ProblemOf,
    constraints: MotionConstraints,
    first: Result,
    options: SolverOptions,
    *,
    solved: bool = True,
    rounds: int = ROUNDS,
    cost_limit: float = math.inf,
    unsettled: float = 1.0,
    plausible: float = math.inf,
    coarse: bool = False,
) -> tuple[PathProblem, Result]:
    """Return the problem of the last round and its result; constraints left violated show that it failed.

    Args:
        constraints: none active yet, or those of `first`.
        first: result of the problem with these constraints. The free path leads to better minima than most guesses.
        options: of the solver; its iterations are those of the last round.
        solved: whether `first` is at its minimum; otherwise it is an initial guess only.
        cost_limit: cost at which to stop: more constraints seldom make a path cheaper.
        unsettled: the same relative to `cost_limit` after a round that did not end at a minimum.
        plausible: cost above which `IMPLAUSIBLE_ROUNDS` rounds in turn whose constraints are far from holding end it.
        coarse: whether constraints that the last round violates, and that were not active in it, are left out.
    """
    problem, result = problem_of(constraints), first
    final, stuck, implausible = solved, 0, 0
    for number in range(rounds):
        violated = constraints.add_violated(*problem.split(result.x))
        if not violated and final:
            violated = 0 if coarse else constraints.keep_more_around(*problem.split(result.x))
            if not violated:
                break
            constraints.add_violated(*problem.split(result.x))
        if violated:
            problem = problem_of(constraints)
        final = not violated or number == rounds - 1
        chosen = collision_options(options) if final else round_options(options)
        limited = replace(
            chosen,
            longest_step=min(MAX_STEP, options.longest_step),
            trust_region=coarse,
            iterations=min(FINAL_ITERATIONS, chosen.iterations),
        )
        result = Solver(limited).solve(problem, result.x, warm=_with_new_multipliers(result, problem))
        stuck = stuck + 1 if result.status in STUCK and result.violation > COMPARABLE_VIOLATION else 0
        implausible = implausible + 1 if result.cost > plausible and result.violation > COMPARABLE_VIOLATION else 0
        if stuck == STUCK_ROUNDS or implausible == IMPLAUSIBLE_ROUNDS or exceeds(result, cost_limit, unsettled):
            break
        # At a stationary point of the violation a solve to the final tolerance would not reduce it either.
        final = final or result.status is SolveStatus.INFEASIBLE
    else:
        if not coarse and constraints.add_violated(*problem.split(result.x)):
            problem = problem_of(constraints)
            _, equality, inequality = problem.evaluate(result.x)
            result = replace(result, inequality=violation_max(equality, inequality))
    return problem, result


def solve_contacts(
    problem_of: ProblemOf, constraints: MotionConstraints, first: Result, cost_limit: float = math.inf
) -> tuple[PathProblem, Result]:
    """Return the path that keeps what actions declare: contacts, and hands that draw back; other bodies may overlap.

    They shape a path most, and from there it seldom gets stuck at other bodies. What its cost is above that of the free
    path belongs to the actions, and no other way around anything saves it.
    """
    assert constraints.collisions is not None
    constraints.collisions.contacts_alone = True
    solved = solve_constrained(
        problem_of, constraints, first, CANDIDATE_OPTIONS, cost_limit=cost_limit, unsettled=UNSETTLED, coarse=True
    )
    constraints.collisions.contacts_alone = False
    return solved


def solve_coarse_to_fine(
    problem_of: ProblemOf, constraints: MotionConstraints, first: Result, cost_limit: float, plausible: float
) -> tuple[PathProblem, Result]:
    """Return the path, to a coarse tolerance, whose bodies are first apart at the ends of phases, then between them.

    The constraints of all slices at once ask for a way around in a single step, which mostly ends where no motion leads
    on. Those of the ends alone move the postures; halving the time between constraints then leads the path around
    step by step. Arguments as of `solve_constrained`; constraints left violated show that it failed.
    """
    assert constraints.collisions is not None
    stride = constraints.collisions.phases.slices
    problem, result = problem_of(constraints), first
    while stride:
        constraints.collisions.stride = stride
        problem, result = solve_constrained(
            problem_of,
            constraints,
            result,
            CANDIDATE_OPTIONS,
            solved=False,
            rounds=CANDIDATE_ROUNDS,
            plausible=plausible,
            coarse=True,
        )
        if result.violation > COMPARABLE_VIOLATION or exceeds(result, cost_limit):
            break
        stride //= 2
    constraints.collisions.stride = 1
    return problem, result


def exceeds(result: Result, cost_limit: float, unsettled: float = 1.0) -> bool:
    """Return whether a path that nearly satisfies its constraints costs a limit or more, see `solve_constrained`."""
    settled = result.status in (SolveStatus.OPTIMAL, SolveStatus.ACCEPTABLE)
    return result.violation <= COMPARABLE_VIOLATION and result.cost >= cost_limit * (1.0 if settled else unsettled)


def round_options(options: SolverOptions) -> SolverOptions:
    """Return options that stop as soon as a path shows which constraints are missing."""
    coarse = replace(options, decrease=max(options.decrease, ROUND_DECREASE), kkt=max(options.kkt, 10 * ROUND_DECREASE))
    return replace(coarse, violation=MARGIN_TOLERANCE, iterations=ROUND_ITERATIONS)


def collision_options(options: SolverOptions) -> SolverOptions:
    """Return options that stop where the cost of a path with collision constraints no longer changes visibly."""
    return replace(options, decrease=max(options.decrease, FINAL_DECREASE), kkt=max(options.kkt, 10 * FINAL_DECREASE))


def _with_new_multipliers(warm: Result, problem: PathProblem) -> Result:
    """Return a result with multipliers 0 for new constraints, which come last."""
    new = len(problem.constraints.in_rows) - len(warm.y_in)
    return replace(warm, y_in=np.concatenate([warm.y_in, np.zeros(new)]))


MULTI_START_RATIO = 1.5
"""Cost of a collision-free path, relative to the path with contacts alone, above which other guesses are solved."""
GOOD_RATIO = 1.5
"""Cost, relative to the same, below which an improved path ends the multi-start."""
IMPROVEMENT = 0.97
"""Cost, relative to the best known path, above which a candidate is stopped."""
GUESS_AMPLITUDES = (0.3, 0.5)
"""Largest share of the way from the path to random postures, in turn."""
GUESSES = 12
"""Initial guesses drawn: their total penetration costs little compared with solving one."""
CANDIDATES = 6
"""Guesses solved where a plan or a plausible path is known; otherwise sampled motions follow, and all of them where
those fail too. Drawn ones are in turn the next of least total penetration and the next drawn."""
DISTURBED = 4
"""Disturbed paths drawn; that they are four is a choice."""
DISTURBANCE, WAVES = 0.02, 3
"""[rad, m] Standard deviation of the first wave of a disturbed path, and number of waves: a choice; larger disturbances
lead to farther and mostly dearer paths."""
PLAUSIBLE_RATIO = 4.0
"""Cost of a known path, relative to the path with contacts alone, above which there is probably another way."""
CANDIDATE_OPTIONS = SolverOptions(violation=1e-6, kkt=1e-2, decrease=1e-3, iterations=16)
"""Coarse: candidates are only compared."""
CANDIDATE_ROUNDS = 5
"""Rounds of constraint generation of a candidate."""


@dataclass(frozen=True)
class CandidatePath:
    """A collision-free path to a coarse tolerance: its active constraints, its problem and the solver's result."""

    constraints: MotionConstraints
    problem: PathProblem
    result: Result


@dataclass(frozen=True)
class Guess:
    """An initial guess of a candidate; `gradual`: solved by `solve_coarse_to_fine`."""

    motion: Motion
    gradual: bool = False


def multi_start(
    problem_of: ProblemOf,
    active_of: Callable[[], MotionConstraints],
    problem: PathProblem,
    contacts: Result,
    guesses: Iterator[Guess],
    least: float,
    cost_limit: float = math.inf,
) -> CandidatePath | None:
    """Return the cheapest candidate that costs clearly less than the known path, None without one.

    Where all of these cost too much it is the cheapest of them, whose constraints need not hold.

    Args:
        active_of: makes the constraints of a candidate, none active yet.
        problem: the one without collision constraints.
        contacts: result of `solve_contacts`.
        guesses: `candidate_guesses`, from which as many are taken as are solved.
        least: cost of the known path, inf without one.
        cost_limit: cost that is too much; a candidate is stopped there.
    """
    begin = replace(contacts, y_in=contacts.y_in[: problem.constraints.always])
    best: CandidatePath | None = None
    dear: CandidatePath | None = None
    for number, guess in enumerate(guesses, start=1):
        constraints = active_of()
        improved = IMPROVEMENT * least
        limit = min(improved, cost_limit)
        start = replace(begin, x=problem.join(*guess.motion))
        plausible = min(limit, PLAUSIBLE_RATIO * contacts.cost)
        if guess.gradual:
            solved = solve_coarse_to_fine(problem_of, constraints, start, limit, PLAUSIBLE_RATIO * contacts.cost)
        else:
            solved = solve_constrained(
                problem_of,
                constraints,
                start,
                CANDIDATE_OPTIONS,
                solved=False,
                rounds=CANDIDATE_ROUNDS,
                cost_limit=limit,
                plausible=plausible,
                coarse=True,
            )
        candidate = CandidatePath(constraints, *solved)
        cost = candidate.result.cost
        better = candidate.result.violation <= CLOSE and cost < limit
        too_dear = not better and cost < improved and exceeds(candidate.result, cost_limit)
        if better or too_dear:
            best, dear, least = (candidate, dear, cost) if better else (best, candidate, cost)
            if cost <= GOOD_RATIO * contacts.cost:
                break
        known = math.isfinite(cost_limit) or least <= PLAUSIBLE_RATIO * contacts.cost
        if time_is_up():
            break
        if number >= CANDIDATES and (known or (best is not None and number >= CANDIDATES + MOTIONS)):
            break
    return best or dear


def candidate_guesses(
    problem: PathProblem,
    path: Array,
    variables: Array,
    reference: Motion | None = None,
    sampled: Callable[[], Iterable[Motion]] = tuple,
) -> Iterator[Guess]:
    """Yield the initial guesses of the candidates.

    First the path with the robot joints of the reference, if there is one, and the reference, which keeps all
    constraints; the path itself, and slightly disturbed, to be solved gradually; then, in turn, the next of least total
    penetration and the next drawn. After `CANDIDATES` of these come the sampled motions, which take long, are expensive
    at first, and are collision-free.

    Args:
        reference: motion of the same actions under another cost.
        sampled: gives motions that are collision-free, see `lgp.path.sampled_motion`.
    """
    nearby = _nearby_guesses(problem, path, variables, reference)
    yield from islice(nearby, CANDIDATES)
    yield from map(Guess, sampled())
    yield from nearby


def _nearby_guesses(problem: PathProblem, path: Array, variables: Array, reference: Motion | None) -> Iterator[Guess]:
    world = problem.world
    if reference is not None:
        robots = [column for name in world.scene.robots for column in world.columns(name)]
        guess = path.copy()
        guess[:, robots] = reference[0][:, robots]
        yield Guess((guess, variables))
        yield Guess(reference)
    yield Guess((path, variables), gradual=True)
    yield from islice(disturbed_guesses(problem, path, variables, gradual=True), 1)
    constraints = CollisionConstraints(world, problem.phases, problem.initial_configuration)
    guesses = list(initial_guesses(world, problem.phases, path, GUESSES))
    depths = [constraints.total_penetration(guess, variables) for guess in guesses]
    by_depth = np.argsort(depths, kind="stable").tolist()
    order = dict.fromkeys(number for pair in zip(by_depth, range(GUESSES), strict=True) for number in pair)
    yield from (Guess((guesses[number], variables)) for number in order)


def disturbed_guesses(
    problem: PathProblem, path: Array, variables: Array, seed: int = 0, *, gradual: bool = False
) -> Iterator[Guess]:
    """Yield a path (T, nq) with a small smooth random motion of all joints added.

    Where bodies overlap at first, which way they are moved apart may hang on little: the path that is found is then the
    better or the worse of two ways. From near that path, without its active constraints, the other one is as likely.
    """
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 1.0, len(path))[:, None]
    low, high = problem.world.lower, problem.world.upper
    for _ in range(DISTURBED):
        waves = (
            np.sin(np.pi * k * time) * rng.normal(0.0, DISTURBANCE / k, path.shape[1]) for k in range(1, WAVES + 1)
        )
        yield Guess((np.clip(path + sum(waves), low, high), variables), gradual)


def initial_guesses(world: World, phases: Phases, path: Array, count: int) -> Iterator[Array]:
    """Yield `count` initial guesses (T, nq) [rad, m] that equal the path (T, nq) at its keyframes, from a fixed seed.

    Between keyframes the limbs move towards random postures and back, sin^2 of the time in the phase.
    """
    limbs = _moving_limbs(world, phases)
    rng = np.random.default_rng(0)
    profile = (np.sin(np.pi * (np.arange(phases.total) + 1.0) / phases.slices) ** 2).reshape(phases.count, -1, 1)
    for number in range(count):
        postures = rng.uniform(world.lower[limbs], world.upper[limbs], (phases.count, 1, len(limbs)))
        guess = path.reshape(phases.count, phases.slices, -1).copy()
        amplitude = GUESS_AMPLITUDES[number % len(GUESS_AMPLITUDES)]
        guess[..., limbs] += amplitude * profile * (postures - guess[..., limbs])
        yield guess.reshape(path.shape)


def _moving_limbs(world: World, phases: Phases) -> Indices:
    """Return the joints that move the hands of robots in a sequence, or of all agents where no robot acts in it."""
    hands = {hand for switch in phases.switches for hand in switch.hands}
    robots = {hand for hand in hands if not world.scene.hands[hand].human}
    return np.flatnonzero(np.max([world.support(hand) for hand in sorted(robots or hands)], axis=0))
