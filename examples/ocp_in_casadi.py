"""A surrogate in an optimal control problem: CasADi with IPOPT, and the same in acados where it is installed."""

import importlib.util
from pathlib import Path

import numpy as np

import dreba
import reba

try:
    import casadi
except ImportError:
    raise SystemExit("needs CasADi: pip install casadi") from None

# A planar figure of your own: trunk, upper arm and elbow, in radians. The map says which columns they are.
MAP = """
joints = ["torso", "shoulder", "elbow"]
[columns]
trunk_flexion = ["+torso"]
upper_arm_flexion_right = ["+shoulder"]
lower_arm_flexion_right = ["+elbow"]
[hold]
"""
moved = ("trunk_flexion", "upper_arm_flexion_right", "lower_arm_flexion_right")
held = [column for column in reba.COLUMNS if column not in moved]
rest = {column: 80 if column.startswith("lower_arm") else 0 for column in held}
Path("arm.toml").write_text(MAP + "\n".join(f"{column} = {angle}" for column, angle in rest.items()))

# The export is a file that any CasADi reads, without this package.
model = dreba.load("convex")
dreba.export_model(model, "cost.casadi", to="casadi", joint_map="arm.toml", name="ergonomics")
ergonomics = casadi.Function.deserialize(Path("cost.casadi").read_text())

STEPS, SECONDS, LOAD = 20, 0.1, 6.0
TARGET = np.array([0.55, 0.25])
LOW, HIGH = np.radians([-20.0, -40.0, 5.0]), np.radians([90.0, 150.0, 140.0])
GUESS = [10.0, 40.0, 60.0]


def hand(q):
    """Return the place of the hand (forward, up) [m] from the hip: trunk 0.5, upper arm 0.3, forearm 0.28."""
    trunk, upper = q[0], q[0] - q[1]  # from the vertical; the arm is measured from the trunk line
    lower = upper - q[2]
    forward = 0.5 * casadi.sin(trunk) - 0.3 * casadi.sin(upper) - 0.28 * casadi.sin(lower)
    return casadi.vertcat(forward, 0.5 * casadi.cos(trunk) - 0.3 * casadi.cos(upper) - 0.28 * casadi.cos(lower))


def posture_cost(q):
    """Return the surrogate with the load in the right hand, of which the grip is fair."""
    return ergonomics(q, LOAD, casadi.DM([0, 1]), 0)[0]


opti = casadi.Opti()
q, v, u = opti.variable(3, STEPS + 1), opti.variable(3, STEPS + 1), opti.variable(3, STEPS)
opti.subject_to(q[:, 0] == np.radians([0.0, 0.0, 10.0]))
opti.subject_to(casadi.vec(v[:, 0]) == 0)
total = 0
for k in range(STEPS):
    opti.subject_to(q[:, k + 1] == q[:, k] + SECONDS * v[:, k + 1])
    opti.subject_to(v[:, k + 1] == v[:, k] + SECONDS * u[:, k])
    opti.subject_to(opti.bounded(LOW, q[:, k + 1], HIGH))
    total += SECONDS * (posture_cost(q[:, k + 1]) + 1e-2 * casadi.sumsqr(u[:, k]))
opti.subject_to(hand(q[:, STEPS]) == TARGET)
opti.subject_to(v[:, STEPS] == 0)
opti.minimize(total)
opti.set_initial(q, np.radians(GUESS)[:, None] @ np.ones((1, STEPS + 1)))
opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
found = np.degrees(opti.solve().value(q))

table = {
    **{column: np.full(STEPS + 1, float(angle)) for column, angle in rest.items()},
    **dict(zip(moved, found, strict=True)),
}
scores = reba.score_array(table, {"load": LOAD, "coupling_right": "fair"}).reba
print("IPOPT: joints at the end [deg]", found[:, -1].round().astype(int).tolist(), "exact REBA", scores.tolist())

if importlib.util.find_spec("acados_template") is None:
    print("acados is not installed (docs.acados.org): its part is left out")
else:
    from acados_template import AcadosModel, AcadosOcp, AcadosOcpSolver

    own, x, a = AcadosModel(), casadi.SX.sym("x", 6), casadi.SX.sym("u", 3)
    own.name, own.x, own.u = "reach", x, a
    own.f_expl_expr = casadi.vertcat(x[3:], a)
    own.cost_expr_ext_cost = posture_cost(x[:3]) + 1e-2 * casadi.sumsqr(a)
    own.con_h_expr_e = hand(x[:3])
    ocp = AcadosOcp()
    ocp.model, ocp.cost.cost_type = own, "EXTERNAL"
    ocp.solver_options.N_horizon, ocp.solver_options.tf = STEPS, STEPS * SECONDS
    ocp.solver_options.nlp_solver_type, ocp.solver_options.integrator_type = "SQP", "ERK"
    ocp.solver_options.hessian_approx, ocp.solver_options.regularize_method = "EXACT", "PROJECT"
    ocp.solver_options.globalization = "MERIT_BACKTRACKING"  # the curvature of hinges jumps, full steps would cycle
    ocp.constraints.x0 = np.concatenate([np.radians([0.0, 0.0, 10.0]), np.zeros(3)])
    ocp.constraints.idxbx, ocp.constraints.lbx, ocp.constraints.ubx = np.arange(3), LOW, HIGH
    # At the end the joints are within their limits, at rest, and the hand is at its place.
    ocp.constraints.idxbx_e = np.arange(6)
    ocp.constraints.lbx_e, ocp.constraints.ubx_e = (np.concatenate([ends, np.zeros(3)]) for ends in (LOW, HIGH))
    ocp.constraints.lh_e = ocp.constraints.uh_e = TARGET
    solver = AcadosOcpSolver(ocp)
    for k in range(STEPS + 1):
        solver.set(k, "x", np.concatenate([np.radians(GUESS), np.zeros(3)]))
    status = solver.solve()
    print("acados: status", status, "joints at the end [deg]", np.degrees(solver.get(STEPS, "x")[:3]).round().tolist())
