"""A quadratic surrogate as a least-squares residual: a reach with Pinocchio, and the same residual in Crocoddyl."""

import importlib.metadata
from pathlib import Path

import numpy as np

import dreba
import reba
from dreba.export.joint_map import read_map

try:
    import pinocchio as pin

    files = importlib.metadata.files("example-robot-data")
except ImportError:
    raise SystemExit("needs Pinocchio and human.urdf: pip install 'dreba[robots]'") from None
try:
    import crocoddyl
except ImportError:
    crocoddyl = None

urdf = next(file.locate() for file in files if file.name == "human.urdf")
body = pin.buildModelFromUrdf(str(urdf))
data, hand, start = body.createData(), body.getFrameId("right_wrist_X"), pin.neutral(body)

# A quadratic is half a sum of squares plus a constant: r = root of curvature times (angle - best angle), by joint.
cost = dreba.load("quadratic")
joints = read_map(Path(__file__).with_name("human_urdf.toml"), cost.joints_)
root = np.sqrt(cost.twice_curvature_)
best = np.divide(-cost.linear_, cost.twice_curvature_, out=np.zeros_like(root), where=root > 0.0)
slope = root[:, None] * joints.matrix  # the Jacobian of the residual, constant


def residual(q):
    """Return the residual (22,); its half sum of squares is the cost of the posture above the lowest."""
    return root * (joints.offset + joints.matrix @ q - best)


def reach(target, weight):
    """Return the joints with the wrist at a place, by Levenberg-Marquardt steps with a weight on the cost."""
    q = start.copy()
    for _ in range(200):
        pin.computeJointJacobians(body, data, q)
        pin.updateFramePlacements(body, data)
        off = 1e2 * (data.oMf[hand].translation - target)
        by_hand = 1e2 * pin.getFrameJacobian(body, data, hand, pin.LOCAL_WORLD_ALIGNED)[:3]
        rows = np.vstack([by_hand, weight * slope, 1e-2 * np.eye(body.nv)])
        step = np.linalg.lstsq(rows, -np.concatenate([off, weight * residual(q), 1e-2 * (q - start)]), rcond=None)[0]
        q = np.clip(pin.integrate(body, q, 0.5 * step), body.lowerPositionLimit, body.upperPositionLimit)
    return q


def score(q):
    """Return exact REBA of the joints."""
    return int(reba.score_array((joints.offset + joints.matrix @ q)[None]).reba[0])


pin.framesForwardKinematics(body, data, start)
target = data.oMf[hand].translation + np.array([0.45, 0.35, 0.0])
assert np.allclose(slope.T @ residual(start), cost.gradient(joints.offset + joints.matrix @ start) @ joints.matrix)
print("Pinocchio: exact REBA", {f"weight {weight:g}": score(reach(target, weight)) for weight in (0.0, 1.0)})

if crocoddyl is None:
    print("Crocoddyl is not installed (pip install crocoddyl): its part is left out")
else:

    class Residual(crocoddyl.ResidualModelAbstract):
        """A residual of the joints of a state, from functions of its value and of its Jacobian."""

        def __init__(self, state, value, jacobian, size):
            crocoddyl.ResidualModelAbstract.__init__(self, state, size, state.nv, True, False, False)
            self.value, self.jacobian = value, jacobian

        def calc(self, data, x, u=None):
            data.r = self.value(x[: body.nq])

        def calcDiff(self, data, x, u=None):
            by_joints = self.jacobian(x[: body.nq])
            data.Rx = np.hstack([by_joints, np.zeros_like(by_joints)])

    def off_target(q):
        pin.framesForwardKinematics(body, data, q)
        return data.oMf[hand].translation - target

    def by_hand(q):
        return pin.computeFrameJacobian(body, data, q, hand, pin.LOCAL_WORLD_ALIGNED)[:3]

    state = crocoddyl.StateMultibody(body)
    actuation = crocoddyl.ActuationModelFull(state)
    # Crocoddyl does not keep Python objects alive, so these have names.
    posture = Residual(state, residual, lambda q: slope, len(root))
    place = Residual(state, off_target, by_hand, 3)

    def action(reaching):
        """Return the action model of a moment, at the end with the wrist at its place."""
        costs = crocoddyl.CostModelSum(state)
        costs.addCost("posture", crocoddyl.CostModelResidual(state, posture), 1.0)
        costs.addCost("still", crocoddyl.CostModelResidual(state, crocoddyl.ResidualModelState(state)), 1e-2)
        costs.addCost("effort", crocoddyl.CostModelResidual(state, crocoddyl.ResidualModelControl(state)), 1e-4)
        costs.addCost("reach", crocoddyl.CostModelResidual(state, place), reaching)
        moving = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, costs)
        return crocoddyl.IntegratedActionModelEuler(moving, 0.05)

    x0 = np.concatenate([start, np.zeros(body.nv)])
    problem = crocoddyl.ShootingProblem(x0, [action(0.0)] * 20, action(1e4))
    solver = crocoddyl.SolverFDDP(problem)
    solver.th_stop = 1e-3  # the cost is 0.475; residuals in Python are slow, so no further
    solver.solve([x0] * 21, problem.quasiStatic([x0] * 20), 100)
    print("Crocoddyl: exact REBA at the end", score(np.array(solver.xs[-1])[: body.nq]))
