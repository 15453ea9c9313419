"""Sequential quadratic programming: convex QP steps, l1 merit function, elastic mode, warm starts (NW ch. 18).

Each iteration linearises the problem, solves one QP for a step and new multipliers (`subproblem`), and backtracks on
the merit function (`merit`). It ends by residuals recomputed from the problem, not by those of a back end. The same
input gives the same iterations.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lgp.sqp.merit import AcceptedStep, PredictedReduction, line_search, predict, violation_max, violation_sum
from lgp.sqp.problem import Model, Problem, ProblemError, SolverOptions, Values
from lgp.sqp.qp import QPBackend, QPResult, QPStatus, check_model, check_vector
from lgp.sqp.result import Iteration, Residuals, Result, SolveStatus, infeasible_stationarity, residuals, worst_rows
from lgp.sqp.subproblem import SqpStep, SubproblemSolver
from reba.arrays import Array

UNBOUNDED_COST = 1e12
"""Decrease of the cost, relative to its first value, beyond which it counts as unbounded below."""
EXACT_PENALTY = 2.0
"""Penalty per largest multiplier above which raising it does not help: the l1 merit function is exact (NW 15.4)."""
PENALTY_RAISES = 3
"""Times a stalled violation raises the penalty in one solve."""
STALLS_BEFORE_RAISE = 3
"""Times `max_stalled_iterations` before it is raised: a high penalty prevents long steps along curved rows."""
STATIONARY = 1e-3
"""Relative gradient of the squared violation below which an infeasible point counts as stationary."""
SHORT_STEP = 0.05
"""Step length below which the model was poor and the next one is damped."""
DAMPING_HOLD = 4
"""Iterations for which the damping after a short step is not reduced."""
NEAR_CONVERGENCE = 10.0
"""Predicted decrease, relative to the one that ends a solve, below which violations get a second-order correction."""
NEARLY_FEASIBLE = 30.0
"""Violation, relative to the tolerance, up to which inconsistent rows are not tested."""
IDLE_STEPS = 3
"""Consecutive steps between feasible points, each of which lowers the least cost by less than the model must
predict."""
RETRIES = 8
"""Dampings tried at one point when no step length is accepted."""


class Solver:
    """Solves problems one after another; sparsity analyses and back ends (`ActiveSet` by default) persist between them.

    >>> import numpy as np
    >>> from lgp.sqp.problem import FunctionProblem
    >>> bowl = FunctionProblem(2, cost=lambda x: x @ x, gradient=lambda x: 2 * x, lower=np.ones(2))
    >>> Solver().solve(bowl, np.full(2, 5.0)).x
    array([1., 1.])
    """

    def __init__(self, options: SolverOptions | None = None, backend: QPBackend | None = None) -> None:
        self.options = SolverOptions() if options is None else options
        radius = self.options.longest_step if self.options.trust_region else np.inf
        self.subproblem = SubproblemSolver(backend, radius)

    def solve(self, problem: Problem, x0: Array, warm: Result | None = None) -> Result:
        """Return the minimiser from an initial point x0 (n,), clipped to the bounds.

        Args:
            warm: a result of a problem with the same rows, for initial multipliers and active set.

        Raises:
            ProblemError: inconsistent shapes or bounds, or an initial point that is not finite.
        """
        result = _Run(self, problem, _initial_point(problem, x0)).run(warm)
        return replace(result, cost=problem.cost_unit * result.cost)


def solve(
    problem: Problem,
    x0: Array,
    *,
    options: SolverOptions | None = None,
    backend: QPBackend | None = None,
    warm: Result | None = None,
) -> Result:
    """Return the minimiser of a problem; a `Solver` reuses its analyses for several."""
    return Solver(options, backend).solve(problem, x0, warm)


@dataclass
class _StepOutcome:
    """Outcome of one iteration: an accepted point, or the status that ends the solve."""

    accepted: AcceptedStep | None
    step: SqpStep | None
    status: SolveStatus | None = None


class _Run:
    """State of one solve: point, multipliers, penalty, damping and log."""

    def __init__(self, solver: Solver, problem: Problem, x: Array) -> None:
        self.options, self.subproblem, self.problem, self.x = solver.options, solver.subproblem, problem, x
        self.subproblem.restart()
        self.penalty, self.damping, self.damping_hold = solver.options.penalty, 0.0, 0
        self.log: list[Iteration] = []
        self.seconds = {"evaluate": 0.0, "linearise": 0.0, "qp": 0.0, "total": 0.0}
        self.least_violation, self.stalled, self.penalty_raises = np.inf, 0, 0
        self.idle, self.least_cost = 0, np.inf
        self.warm: QPResult | None = None
        # Multipliers of the bounds by the last QP; without it they follow from the residuals.
        self.y_box: Array | None = None

    def run(self, warm: Result | None) -> Result:
        """Iterate until a status is reached."""
        begin = time.perf_counter()
        values = self._evaluate(self.x)
        self._set_multipliers(values, warm)
        first = values[0]
        while True:
            self.seconds["total"] = time.perf_counter() - begin
            if not (np.isfinite(values[0]) and np.isfinite(values[1]).all() and np.isfinite(values[2]).all()):
                return self._not_finite(values)
            model = self._linearise()
            if not np.isfinite(model.gradient).all():
                return self._not_finite(values)
            errors = residuals(self.problem, model, self.x, self.y_eq, self.y_in)
            status = self._status(errors, model, values[0], first)
            if status is None:
                outcome = self._step(model, values)
                status = outcome.status
                if status is not None:
                    errors = residuals(self.problem, model, self.x, self.y_eq, self.y_in)
            if status is not None or outcome.accepted is None or outcome.step is None:
                self.seconds["total"] = time.perf_counter() - begin
                return self._result(status or SolveStatus.STALLED, values, errors)
            self._record(errors, values[0], outcome.step, outcome.accepted)
            self._accept(outcome.step, outcome.accepted)
            self._count_idle(values, outcome.accepted.values)
            values = outcome.accepted.values

    def _status(self, errors: Residuals, model: Model, cost: float, first: float) -> SolveStatus | None:
        """Return the status that ends the solve before another step, if any."""
        options = self.options
        if errors.violation <= options.violation and errors.kkt <= options.kkt:
            return SolveStatus.OPTIMAL
        if cost < -UNBOUNDED_COST * max(1.0, abs(first)):
            return SolveStatus.UNBOUNDED
        if errors.violation > NEARLY_FEASIBLE * options.violation:
            if self._locally_infeasible(errors.violation, model):
                return SolveStatus.INFEASIBLE
        elif errors.violation <= options.violation:
            self.least_violation, self.stalled, self.penalty_raises = np.inf, 0, 0
        if self.idle >= IDLE_STEPS:
            return SolveStatus.ACCEPTABLE
        if len(self.log) >= options.iterations:
            return SolveStatus.ITERATIONS
        return SolveStatus.TIME if self.seconds["total"] > options.seconds else None

    def _count_idle(self, before: Values, after: Values) -> None:
        """Count steps that gain nothing: at edges of constraints the model predicts decreases that do not come.

        Steps may go to and fro between such edges, so the least cost counts.
        """
        if max(violation_max(*values[1:]) for values in (before, after)) > self.options.violation:
            self.idle, self.least_cost = 0, np.inf
            return
        self.least_cost = min(self.least_cost, before[0])
        little = self.least_cost - after[0] <= self.options.decrease * max(1.0, abs(after[0]))
        self.idle = self.idle + 1 if little else 0
        self.least_cost = min(self.least_cost, after[0])

    def _locally_infeasible(self, violation: float, model: Model) -> bool:
        """Whether the violation has stopped falling at a stationary point of it, or with inconsistent rows.

        A merit function with a low penalty may trade violation for cost, so the penalty is raised first; not where the
        rows are inconsistent, because the elastic steps have raised theirs.
        """
        self.stalled = 0 if violation < 0.9 * self.least_violation else self.stalled + 1
        self.least_violation = min(self.least_violation, violation)
        if self.stalled >= self.options.max_stalled_iterations and self.subproblem.inconsistent:
            return True
        if self.stalled >= STALLS_BEFORE_RAISE * self.options.max_stalled_iterations:
            self.stalled = 0
            multiplier = max(float(np.abs(self.y_eq).max(initial=0.0)), float(self.y_in.max(initial=0.0)))
            if self.penalty_raises < PENALTY_RAISES and self.penalty < EXACT_PENALTY * multiplier:
                self.penalty_raises += 1
                self.penalty *= 10.0
        return self.stalled >= 2 and infeasible_stationarity(self.problem, model, self.x) < STATIONARY

    def _step(self, model: Model, values: Values) -> _StepOutcome:
        """Return the step that the merit function accepts, with more damping after each failure."""
        for _ in range(RETRIES):
            step = self._solve_subproblem(model)
            if step is None:
                return _StepOutcome(None, None, SolveStatus.STALLED)
            violation = violation_max(values[1], values[2])
            if step.stationary_infeasible and violation > self.options.violation:
                return _StepOutcome(None, step, SolveStatus.INFEASIBLE)
            predicted = predict(model, step.step, step.curvature)
            status = self._converged(model, step, predicted, violation, values[0])
            if status is not None:
                return _StepOutcome(None, step, status)
            self.penalty = predicted.penalty(self.penalty)
            accepted = self._search(model, values, step, predicted)
            if accepted is not None:
                return _StepOutcome(accepted, step)
            self.damping = self.subproblem.next_damping(self.damping)
        stuck = violation > self.options.violation and infeasible_stationarity(self.problem, model, self.x) < STATIONARY
        return _StepOutcome(None, step, SolveStatus.INFEASIBLE if stuck else SolveStatus.STALLED)

    def _converged(
        self, model: Model, step: SqpStep, predicted: PredictedReduction, violation: float, cost: float
    ) -> SolveStatus | None:
        """Return OPTIMAL at a KKT point with the multipliers of the QP, ACCEPTABLE without predicted decrease."""
        if violation > self.options.violation:
            return None
        errors = residuals(self.problem, model, self.x, step.result.y, step.result.z)
        little = predicted.decrease(self.penalty) <= self.options.decrease * max(1.0, abs(cost))
        optimal = errors.kkt <= self.options.kkt
        if not optimal and (step.damping > 0.0 or not little):
            return None
        self.y_eq, self.y_in, self.y_box = step.result.y, step.result.z, step.result.z_box
        return SolveStatus.OPTIMAL if optimal else SolveStatus.ACCEPTABLE

    def _search(
        self, model: Model, values: Values, step: SqpStep, predicted: PredictedReduction
    ) -> AcceptedStep | None:
        descent = predicted.descent(self.penalty)
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
            max_length=min(1.0, self.options.longest_step / size) if size > 0.0 else 1.0,
            correct=correct,
        )
        converging = predicted.decrease(self.penalty) <= NEAR_CONVERGENCE * self.options.decrease * max(
            1.0, abs(values[0])
        )
        if accepted is None or accepted.length < 1.0 or accepted.corrected or not converging:
            return accepted
        return self._corrected(step, accepted, correct)

    def _corrected(
        self, step: SqpStep, accepted: AcceptedStep, correct: Callable[[Values], Array | None]
    ) -> AcceptedStep:
        """Return the second-order corrected point where its merit is lower: near convergence violation dominates."""
        corrected = correct(accepted.values)
        if corrected is None:
            return accepted
        point = self.x + corrected
        values = self._evaluate(point)
        penalty = 2.0 * max(self.penalty, float(np.abs(step.result.y).max(initial=0.0)), step.result.z.max(initial=0.0))
        before, after = (one[0] + penalty * violation_sum(one[1], one[2]) for one in (accepted.values, values))
        return AcceptedStep(point, values, 1.0, corrected=True) if after < before else accepted

    def _accept(self, step: SqpStep, accepted: AcceptedStep) -> None:
        """Move to the accepted point with the multipliers of the QP; a short step raises the damping."""
        self.x = np.clip(accepted.x, self.problem.lower, self.problem.upper)
        self.y_eq, self.y_in = step.result.y, step.result.z
        self.damping = step.damping
        if accepted.length < SHORT_STEP:
            self.damping, self.damping_hold = self.subproblem.next_damping(step.damping), DAMPING_HOLD
        elif accepted.length == 1.0 and self.damping_hold == 0:
            self.damping *= 0.1
        else:
            self.damping_hold = max(self.damping_hold - 1, 0)
        if self.damping < 1e-3 * self.subproblem.next_damping(0.0):
            self.damping = 0.0
        if not step.elastic:
            self.warm = replace(step.result, x=np.zeros_like(self.x))

    def _solve_subproblem(self, model: Model) -> SqpStep | None:
        begin = time.perf_counter()
        step = self.subproblem.solve(self.problem, model, self.x, self.damping, self.warm)
        self.seconds["qp"] += time.perf_counter() - begin
        return step

    def _timed_correction(self, step: SqpStep, failed: Values, model: Model) -> Array | None:
        begin = time.perf_counter()
        corrected = self.subproblem.second_order_correction(step, failed, model)
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

    def _set_multipliers(self, values: Values, warm: Result | None) -> None:
        """Set the initial multipliers: zero, or those of the warm start."""
        m_e, m_i = values[1].size, values[2].size
        self.y_eq, self.y_in = np.zeros(m_e), np.zeros(m_i)
        if warm is None:
            return
        for name, vector, size in (("y_eq", warm.y_eq, m_e), ("y_in", warm.y_in, m_i), ("x", warm.x, self.x.size)):
            check_vector(f"warm start {name}", vector, size)
        self.y_eq, self.y_in = warm.y_eq, warm.y_in
        self.warm = QPResult(QPStatus.SOLVED, np.zeros(self.x.size), warm.y_eq, warm.y_in, warm.y_box, 0, "warm start")

    def _record(self, errors: Residuals, cost: float, step: SqpStep, accepted: AcceptedStep) -> None:
        self.log.append(
            Iteration(
                cost=cost,
                equality=errors.equality,
                inequality=errors.inequality,
                kkt=errors.kkt,
                step=float(np.abs(accepted.x - self.x).max(initial=0.0)),
                length=accepted.length,
                penalty=self.penalty,
                damping=step.damping,
                qp_solver=step.result.solver,
                qp_iterations=step.result.iterations,
                corrected=accepted.corrected,
            )
        )

    def _result(self, status: SolveStatus, values: Values, errors: Residuals) -> Result:
        self.log.append(Iteration(values[0], errors.equality, errors.inequality, errors.kkt))
        return Result(
            status=status,
            x=self.x,
            cost=values[0],
            y_eq=self.y_eq,
            y_in=self.y_in,
            y_box=errors.y_box if self.y_box is None else self.y_box,
            kkt=errors.kkt,
            equality=errors.equality,
            inequality=errors.inequality,
            worst=worst_rows(values[1], values[2], self.options.violation),
            iterations=tuple(self.log),
            seconds=dict(self.seconds),
        )

    def _not_finite(self, values: Values) -> Result:
        infinite = Residuals(np.inf, np.inf, np.inf, np.zeros_like(self.x))
        return self._result(SolveStatus.BROKEN, (values[0], np.zeros(0), np.zeros(0)), infinite)


def _initial_point(problem: Problem, x0: Array) -> Array:
    """Return the initial point within the bounds, checked with them."""
    if not 0.0 < problem.cost_unit < np.inf:
        raise ProblemError(f"cost_unit: {problem.cost_unit} given, expected a positive number")
    check_vector("lower", problem.lower, problem.n)
    check_vector("upper", problem.upper, problem.n)
    crossed = np.flatnonzero(problem.lower > problem.upper)
    if crossed.size:
        i = int(crossed[0])
        raise ProblemError(
            f"bounds of unknown {i}: lower {problem.lower[i]} above upper {problem.upper[i]}; expected lower <= upper"
        )
    x = np.array(x0, dtype=float)
    check_vector("x0", x, problem.n)
    if not np.isfinite(x).all():
        entry = int(np.flatnonzero(~np.isfinite(x))[0])
        raise ProblemError(f"x0: entry {entry} is infinite; expected finite values")
    return np.clip(x, problem.lower, problem.upper)
