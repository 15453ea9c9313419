"""Sequential quadratic programming: convex QP steps, an l1 merit function, elastic mode, warm starts.

Each iteration asks the problem for its convex model, solves one QP for a step and new multipliers (`step`), and
backtracks on the merit function (`merit`). It ends on residuals recomputed from the problem, never on what a back end
reports. The same input gives the same iterations.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lgp.sqp.merit import AcceptedStep, PredictedReduction, line_search, predict, violation_max, violation_sum
from lgp.sqp.problem import Model, Problem, ProblemError, SolverOptions, Values
from lgp.sqp.qp import QPBackend, QPResult, QPStatus, check_model, check_vector
from lgp.sqp.result import Iteration, Residuals, Result, SolveStatus, infeasible_stationary, residuals, worst_rows
from lgp.sqp.subproblem import SqpStep, SubproblemSolver
from reba.arrays import Array

BOTTOM = 1e12
"""A cost this far below its start, relative to it, counts as falling without end."""
EXACT = 2.0
"""Penalty per largest multiplier from which on a stagnating violation is not for want of price (l1 is exact)."""
PENALTY_RAISES = 3
"""Times a stagnating violation raises the penalty."""
DEAR = 3
"""Patiences with a stagnating violation before it does: a high penalty forbids long steps along curved rows."""
STATIONARY = 1e-3
"""Relative slope of the squared violation below which a point that violates rows counts as stationary."""
SHORT = 0.05
"""Accepted share of a step below which the model was poor and the next one is damped."""
HELD = 4
"""Iterations for which a damping stays that a short step without it called for."""
LATE = 10.0
"""A promised decrease this many times the one that ends a solve calls for polishing violations away."""
NEARLY = 30.0
"""Violations up to this many times the one allowed are no sign of rows that contradict each other."""
RETRIES = 8
"""Dampings tried at one point when no length of the step is accepted."""


class Solver:
    """Solves problems one after another, keeping pattern analyses and the last active set between them.

    Args:
        options: tolerances and budgets.
        backend: QP back end; `ActiveSet` by default.

    >>> import numpy as np
    >>> from lgp.sqp.problem import FunctionProblem
    >>> bowl = FunctionProblem(2, cost=lambda x: x @ x, gradient=lambda x: 2 * x, lower=np.ones(2))
    >>> Solver().solve(bowl, np.full(2, 5.0)).x
    array([1., 1.])
    """

    def __init__(self, options: SolverOptions | None = None, backend: QPBackend | None = None) -> None:
        self.options = SolverOptions() if options is None else options
        self.steps = SubproblemSolver(backend)

    def solve(self, problem: Problem, x0: Array, warm: Result | None = None) -> Result:
        """Minimise from x0 (n,), clipped into the bounds.

        Args:
            problem: bounds, values and models.
            x0: start.
            warm: an earlier result of a problem with the same rows; its multipliers and active set are used.

        Raises:
            ProblemError: shapes or bounds that contradict each other, or a start that is not finite.
        """
        return _Run(self, problem, _start(problem, x0)).run(warm)


def solve(
    problem: Problem,
    x0: Array,
    *,
    options: SolverOptions | None = None,
    backend: QPBackend | None = None,
    warm: Result | None = None,
) -> Result:
    """Minimise a problem once; `Solver` keeps its analyses for several."""
    return Solver(options, backend).solve(problem, x0, warm)


@dataclass
class _Move:
    """How one iteration went on: an accepted point, or the status that ends the solve."""

    accepted: AcceptedStep | None
    step: SqpStep | None
    status: SolveStatus | None = None


class _Run:
    """One solve: the point, its multipliers, and what the merit function has learnt."""

    def __init__(self, solver: Solver, problem: Problem, x: Array) -> None:
        self.options, self.steps, self.problem, self.x = solver.options, solver.steps, problem, x
        self.steps.restart()
        self.penalty, self.damping, self.held = solver.options.penalty, 0.0, 0
        self.log: list[Iteration] = []
        self.seconds = {"evaluate": 0.0, "linearise": 0.0, "qp": 0.0, "total": 0.0}
        self.least, self.stagnant, self.raises = np.inf, 0, 0
        self.warm: QPResult | None = None
        # Multipliers of the bounds where the last QP gave all; elsewhere the residuals tell them.
        self.y_box: Array | None = None

    def run(self, warm: Result | None) -> Result:
        """Iterate until a status is reached."""
        begin = time.perf_counter()
        values = self._evaluate(self.x)
        self._sizes(values, warm)
        first = values[0]
        while True:
            self.seconds["total"] = time.perf_counter() - begin
            if not (np.isfinite(values[0]) and np.isfinite(values[1]).all() and np.isfinite(values[2]).all()):
                return self._broken(values)
            model = self._linearise()
            if not np.isfinite(model.gradient).all():
                return self._broken(values)
            now = residuals(self.problem, model, self.x, self.y_eq, self.y_in)
            status = self._status(now, model, values[0], first)
            if status is None:
                move = self._move(model, values)
                now = residuals(self.problem, model, self.x, self.y_eq, self.y_in)
                status = move.status
            if status is not None or move.accepted is None or move.step is None:
                self.seconds["total"] = time.perf_counter() - begin
                return self._result(status or SolveStatus.STALLED, values, now)
            self._record(now, values[0], move.step, move.accepted)
            self._take(move.step, move.accepted)
            values = move.accepted.values

    def _status(self, now: Residuals, model: Model, cost: float, first: float) -> SolveStatus | None:
        """Return the status that ends the solve before another step, if any."""
        options = self.options
        if now.violation <= options.violation and now.kkt <= options.kkt:
            return SolveStatus.OPTIMAL
        if cost < -BOTTOM * max(1.0, abs(first)):
            return SolveStatus.UNBOUNDED
        if now.violation > NEARLY * options.violation:
            if self._gives_up(now.violation, model):
                return SolveStatus.INFEASIBLE
        elif now.violation <= options.violation:
            self.least, self.stagnant, self.raises = np.inf, 0, 0
        if len(self.log) >= options.iterations:
            return SolveStatus.ITERATIONS
        return SolveStatus.TIME if self.seconds["total"] > options.seconds else None

    def _gives_up(self, violation: float, model: Model) -> bool:
        """Whether the violation has stopped falling, near a stationary point of it or at any price.

        A merit function with a low penalty may trade violation for cost for a while, so the penalty is raised first;
        not where the rows contradict each other, because elastic steps have raised their price by then.
        """
        self.stagnant = 0 if violation < 0.9 * self.least else self.stagnant + 1
        self.least = min(self.least, violation)
        if self.stagnant >= self.options.patience and self.steps.contradicted:
            return True
        if self.stagnant >= DEAR * self.options.patience:
            self.stagnant = 0
            dear = max(float(np.abs(self.y_eq).max(initial=0.0)), float(self.y_in.max(initial=0.0)))
            if self.raises < PENALTY_RAISES and self.penalty < EXACT * dear:
                self.raises += 1
                self.penalty *= 10.0
        return self.stagnant >= 2 and infeasible_stationary(self.problem, model, self.x) < STATIONARY

    def _move(self, model: Model, values: Values) -> _Move:
        """Find a step that the merit function accepts, damping it more after each failure."""
        for _ in range(RETRIES):
            step = self._qp(model)
            if step is None:
                return _Move(None, None, SolveStatus.STALLED)
            violation = violation_max(values[1], values[2])
            if step.hopeless and violation > self.options.violation:
                return _Move(None, step, SolveStatus.INFEASIBLE)
            promised = predict(model, step.step, step.curvature)
            finished = self._finished(model, step, promised, violation, values[0])
            if finished is not None:
                return _Move(None, step, finished)
            self.penalty = promised.penalty(self.penalty)
            accepted = self._search(model, values, step, promised)
            if accepted is not None:
                return _Move(accepted, step)
            self.damping = self.steps.more(self.damping)
        stuck = violation > self.options.violation and infeasible_stationary(self.problem, model, self.x) < STATIONARY
        return _Move(None, step, SolveStatus.INFEASIBLE if stuck else SolveStatus.STALLED)

    def _finished(
        self, model: Model, step: SqpStep, promised: PredictedReduction, violation: float, cost: float
    ) -> SolveStatus | None:
        """Return OPTIMAL if the multipliers of the QP close the conditions here, ACCEPTABLE if it promises nothing."""
        if violation > self.options.violation:
            return None
        now = residuals(self.problem, model, self.x, step.found.y, step.found.z)
        little = promised.decrease(self.penalty) <= self.options.decrease * max(1.0, abs(cost))
        optimal = now.kkt <= self.options.kkt
        if not optimal and (step.damping > 0.0 or not little):
            return None
        self.y_eq, self.y_in, self.y_box = step.found.y, step.found.z, step.found.z_box
        return SolveStatus.OPTIMAL if optimal else SolveStatus.ACCEPTABLE

    def _search(self, model: Model, values: Values, step: SqpStep, promised: PredictedReduction) -> AcceptedStep | None:
        descent = promised.descent(self.penalty)
        if not descent < 0.0:
            return None

        def correct(failed: Values) -> Array | None:
            if step.elastic or violation_sum(failed[1], failed[2]) <= self.options.violation:
                return None
            return self._timed_correction(step, failed, model)

        size = float(np.abs(step.step).max(initial=0.0))
        accepted = line_search(
            self._evaluate,
            self.x,
            step.step,
            values[0] + self.penalty * violation_sum(values[1], values[2]),
            descent,
            self.penalty,
            longest=min(1.0, self.options.longest_step / size) if size > 0.0 else 1.0,
            correct=correct,
        )
        late = promised.decrease(self.penalty) <= LATE * self.options.decrease * max(1.0, abs(values[0]))
        if accepted is None or accepted.length < 1.0 or accepted.corrected or not late:
            return accepted
        return self._polished(step, accepted, correct)

    def _polished(
        self, step: SqpStep, accepted: AcceptedStep, correct: Callable[[Values], Array | None]
    ) -> AcceptedStep:
        """Return the second-order corrected point instead, where little but violation is left and it has much less."""
        corrected = correct(accepted.values)
        if corrected is None:
            return accepted
        point = self.x + corrected
        values = self._evaluate(point)
        price = 2.0 * max(self.penalty, float(np.abs(step.found.y).max(initial=0.0)), step.found.z.max(initial=0.0))
        before, after = (one[0] + price * violation_sum(one[1], one[2]) for one in (accepted.values, values))
        return AcceptedStep(point, values, 1.0, corrected=True) if after < before else accepted

    def _take(self, step: SqpStep, accepted: AcceptedStep) -> None:
        """Move to the accepted point with the multipliers of the QP; a step cut short calls for more damping."""
        self.x = np.clip(accepted.x, self.problem.lower, self.problem.upper)
        self.y_eq, self.y_in = step.found.y, step.found.z
        self.damping = step.damping
        if accepted.length < SHORT:
            self.damping, self.held = self.steps.more(step.damping), HELD
        elif accepted.length == 1.0 and self.held == 0:
            self.damping *= 0.1
        else:
            self.held = max(self.held - 1, 0)
        if self.damping < 1e-3 * self.steps.more(0.0):
            self.damping = 0.0
        if not step.elastic:
            self.warm = replace(step.found, x=np.zeros_like(self.x))

    def _qp(self, model: Model) -> SqpStep | None:
        begin = time.perf_counter()
        step = self.steps.make(self.problem, model, self.x, self.damping, self.warm)
        self.seconds["qp"] += time.perf_counter() - begin
        return step

    def _timed_correction(self, step: SqpStep, failed: Values, model: Model) -> Array | None:
        begin = time.perf_counter()
        corrected = self.steps.correct(step, failed, model)
        self.seconds["qp"] += time.perf_counter() - begin
        return corrected

    def _evaluate(self, x: Array) -> Values:
        begin = time.perf_counter()
        values = self.problem.evaluate(np.clip(x, self.problem.lower, self.problem.upper))
        self.seconds["evaluate"] += time.perf_counter() - begin
        return values

    def _linearise(self) -> Model:
        begin = time.perf_counter()
        model = self.problem.linearise(self.x, self.y_eq, self.y_in)
        self.seconds["linearise"] += time.perf_counter() - begin
        if not self.log:
            check_model(model, self.x.size, self.y_eq.size, self.y_in.size)
        return model

    def _sizes(self, values: Values, warm: Result | None) -> None:
        """Set the first multipliers: zero, or those of an earlier result with as many rows."""
        m_e, m_i = values[1].size, values[2].size
        self.y_eq, self.y_in = np.zeros(m_e), np.zeros(m_i)
        if warm is None:
            return
        for name, given, size in (("y_eq", warm.y_eq, m_e), ("y_in", warm.y_in, m_i), ("x", warm.x, self.x.size)):
            check_vector(f"warm start {name}", given, size)
        self.y_eq, self.y_in = warm.y_eq, warm.y_in
        self.warm = QPResult(QPStatus.SOLVED, np.zeros(self.x.size), warm.y_eq, warm.y_in, warm.y_box, 0, "warm start")

    def _record(self, now: Residuals, cost: float, step: SqpStep, accepted: AcceptedStep) -> None:
        self.log.append(
            Iteration(
                cost=cost,
                equality=now.equality,
                inequality=now.inequality,
                kkt=now.kkt,
                step=float(np.abs(accepted.x - self.x).max(initial=0.0)),
                length=accepted.length,
                penalty=self.penalty,
                damping=step.damping,
                qp_solver=step.found.solver,
                qp_iterations=step.found.iterations,
                corrected=accepted.corrected,
            )
        )

    def _result(self, status: SolveStatus, values: Values, now: Residuals) -> Result:
        self.log.append(Iteration(values[0], now.equality, now.inequality, now.kkt))
        return Result(
            status=status,
            x=self.x,
            cost=values[0],
            y_eq=self.y_eq,
            y_in=self.y_in,
            y_box=now.y_box if self.y_box is None else self.y_box,
            kkt=now.kkt,
            equality=now.equality,
            inequality=now.inequality,
            worst=worst_rows(values[1], values[2], self.options.violation),
            iterations=tuple(self.log),
            seconds=dict(self.seconds),
        )

    def _broken(self, values: Values) -> Result:
        nowhere = Residuals(np.inf, np.inf, np.inf, np.zeros_like(self.x))
        return self._result(SolveStatus.BROKEN, (values[0], np.zeros(0), np.zeros(0)), nowhere)


def _start(problem: Problem, x0: Array) -> Array:
    """Check bounds and start; return the start within the bounds."""
    check_vector("lower", problem.lower, problem.n)
    check_vector("upper", problem.upper, problem.n)
    crossed = np.flatnonzero(problem.lower > problem.upper)
    if crossed.size:
        i = int(crossed[0])
        raise ProblemError(
            f"bounds of unknown {i}: lower {problem.lower[i]} above upper {problem.upper[i]}; exchange or widen them"
        )
    x = np.array(x0, dtype=float)
    check_vector("x0", x, problem.n)
    if not np.isfinite(x).all():
        raise ProblemError(f"x0: entry {int(np.flatnonzero(~np.isfinite(x))[0])} is infinite; give a finite start")
    return np.clip(x, problem.lower, problem.upper)
