"""The same path problems solved by IPOPT through CasADi: is our optimum one for a solver that shares no code?

    OMP_NUM_THREADS=1 python benchmarks/optima.py [--slices 10] [--json FILE]

IPOPT (in the wheel of CasADi) gets the values, Jacobians and model Hessians of our problem by callbacks, and nothing of
our solver: globalisation, barrier and linear algebra are its own. The sequence of `benchmarks/path.py` without
collisions, by cost model. IPOPT starts from our path with all unknowns moved at random (1 mrad, mm) and our
multipliers; from elsewhere it may end in another local optimum. A cost that differs by more than 1e-4 is marked.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path as File
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse as sp
from machine import machine, stamp
from path import actions_of, keyframes_of, world_of

import dreba
from lgp.path.bounds import PathBounds
from lgp.path.ergonomics import Ergonomics
from lgp.path.paths import OPTIONS
from lgp.path.problem import PathProblem
from lgp.sqp.result import Result
from lgp.sqp.solver import solve
from reba.arrays import Array

AGREE = 1e-4
IPOPT = {"print_level": 0, "sb": "yes", "tol": 1e-7, "max_iter": 500}
IPOPT |= {
    "mu_init": 1e-6,
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-8,
    "warm_start_mult_bound_push": 1e-8,
}
"""A small barrier, so that it stays in the basin of its start."""
MOVED = 1e-3
"""[rad, m] Standard deviation of the start of IPOPT from our path."""


def sparsity(matrix: sp.csc_matrix) -> ca.Sparsity:
    """Return the CasADi pattern of a compressed column matrix."""
    return ca.Sparsity(*matrix.shape, matrix.indptr.tolist(), matrix.indices.tolist())


class FromProblem(ca.Callback):
    """A function of CasADi whose outputs are computed by Python."""

    def __init__(self, name: str, inputs: list[ca.Sparsity], outputs: list[ca.Sparsity], work: Any) -> None:
        ca.Callback.__init__(self)
        self.inputs, self.outputs, self.work = inputs, outputs, work
        self.construct(name, {})

    def get_n_in(self) -> int:
        return len(self.inputs)

    def get_n_out(self) -> int:
        return len(self.outputs)

    def get_sparsity_in(self, number: int) -> ca.Sparsity:
        return self.inputs[number]

    def get_sparsity_out(self, number: int) -> ca.Sparsity:
        return self.outputs[number]

    def eval(self, given: list[Any]) -> list[Any]:
        values = self.work(*(np.array(one).ravel() for one in given))
        return [ca.DM(pattern, value) for pattern, value in zip(self.outputs, values, strict=True)]


def by_ipopt(problem: PathProblem, x0: Array, near: Result) -> tuple[float, float, int, float]:
    """Return cost, violation, iterations and seconds of IPOPT from a start x0 (n,) and the multipliers of a result."""
    m_e, m_i = (rows.size for rows in problem.evaluate(x0)[1:])
    model = problem.linearise(x0, np.zeros(m_e), np.zeros(m_i))
    jacobian = sp.csr_matrix(sp.vstack([model.eq_jac, model.in_jac]))
    rows = jacobian.tocsc()
    marked = sp.csr_matrix((np.arange(1.0, jacobian.nnz + 1), jacobian.indices, jacobian.indptr), shape=jacobian.shape)
    order = marked.tocsc().data.astype(int) - 1
    n, m = problem.n, m_e + m_i
    column, none, one, dual = (ca.Sparsity.dense(size, 1) for size in (n, 0, 1, m))

    def linearised(x: Array, y: Array) -> Any:
        return problem.linearise(x, y[:m_e], np.maximum(y[m_e:], 0.0))

    def values(x: Array) -> tuple[float, Array]:
        cost, equality, inequality = problem.evaluate(x)
        return cost, np.concatenate([equality, inequality])

    def gradient(x: Array, _: Array) -> tuple[float, Array]:
        return values(x)[0], linearised(x, np.zeros(m)).gradient

    def jacobians(x: Array, _: Array) -> tuple[Array, Array]:
        model = linearised(x, np.zeros(m))
        return values(x)[1], np.concatenate([model.eq_jac.data, model.in_jac.data])[order]

    def hessian(x: Array, _: Array, weight: Array, y: Array) -> tuple[Array]:
        # The model has weight 1 of the cost and the curvature of the rows by their multipliers.
        return (linearised(x, y / max(float(weight[0]), 1e-12)).hessian.data * float(weight[0]),)

    pattern = sparsity(rows)
    functions = {
        "f": FromProblem("f", [column], [one], lambda x: (values(x)[0],)),
        "g": FromProblem("g", [column], [dual], lambda x: (values(x)[1],)),
        "grad_f": FromProblem("grad_f", [column, none], [one, column], gradient),
        "jac_g": FromProblem("jac_g", [column, none], [dual, pattern], jacobians),
        "hess_lag": FromProblem("hess_lag", [column, none, one, dual], [sparsity(model.hessian)], hessian),
    }
    x = ca.MX.sym("x", n)
    options: dict[str, Any] = {name: functions[name] for name in ("grad_f", "jac_g", "hess_lag")}
    options |= {
        "print_time": False,
        "no_nlp_grad": True,
        "ipopt": IPOPT,
    }
    solver = ca.nlpsol("path", "ipopt", {"x": x, "f": functions["f"](x), "g": functions["g"](x)}, options)
    begin = time.process_time()
    upper = np.zeros(m)
    lower = np.concatenate([np.zeros(m_e), np.full(m_i, -np.inf)])
    multipliers = {"lam_g0": np.concatenate([near.y_eq, near.y_in]), "lam_x0": near.y_box}
    result = solver(x0=x0, **multipliers, lbx=problem.lower, ubx=problem.upper, lbg=lower, ubg=upper)
    seconds = time.process_time() - begin
    point = np.clip(np.array(result["x"]).ravel(), problem.lower, problem.upper)
    cost, equality, inequality = problem.evaluate(point)
    violation = max(float(np.abs(equality).max()), float(inequality.max(initial=0.0)))
    return cost * problem.cost_unit, violation, int(solver.stats()["iter_count"]), seconds


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--slices", type=int, default=10, help="per phase")
    parser.add_argument("--json", type=File, help="write the figures to this file")
    options = parser.parse_args()
    print(stamp())
    world = world_of()
    print(
        f"{'cost':12} {'ours':>11} {'its':>4} {'s':>6} {'IPOPT':>11} {'its':>4} {'s':>6} {'violation':>9}  difference"
    )
    rows = []
    for kind in ("none", "quadratic", "convex"):
        ergonomics = None if kind == "none" else Ergonomics(world, dreba.load(kind))
        bounds = PathBounds(world, ergonomics, slices=options.slices)
        actions = actions_of(world)
        keyframes = keyframes_of(bounds, actions)
        phases = bounds.phases(actions)
        sequence, path = bounds.problem("sequence", phases), bounds.problem("path", phases)
        x0 = path.join(sequence.path(sequence.join(keyframes.keyframes, keyframes.variables)), keyframes.variables)
        begin = time.process_time()
        own = solve(path, x0, options=OPTIONS)
        seconds = time.process_time() - begin
        moved = own.x + np.random.default_rng(0).normal(0.0, MOVED, path.n)
        cost, violation, iterations, theirs = by_ipopt(path, np.clip(moved, path.lower, path.upper), own)
        difference = cost / own.cost - 1.0
        violation = max(violation, own.violation)
        rows.append({"cost": kind, "ours": own.cost, "ipopt": cost, "seconds": seconds, "ipopt_seconds": theirs})
        print(
            f"{kind:12} {own.cost:11.6f} {len(own.iterations) - 1:4d} {seconds:6.2f} {cost:11.6f} {iterations:4d} "
            f"{theirs:6.2f} {violation:9.1e}  {difference:+.1e}{'' if abs(difference) <= AGREE else ' !'}",
            flush=True,
        )
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}))


if __name__ == "__main__":
    main()
