"""Reach tasks: the exact REBA reached by minimising a surrogate while the hands stay on their target points.

Tasks alternate between one hand at a random point and two hands on the sides of a box 0.34 m wide. A seed generates
them, independently of the training poses of any model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

import reba
from dreba.domain import domain_of
from dreba.evaluation.staged_minimiser import TOLERANCE, Effort, Objective, minimise
from dreba.surrogates.base import Surrogate
from dreba.surrogates.graduated import GraduatedModel
from reba.arrays import Array
from reba.posture.columns import COLUMNS, INDEX, SIDES

Starts = Literal["random", "neutral"]
BOX: Final = 0.34
"""[m] Distance of the hands on a box, a common box width."""
INFEASIBLE: Final = 12
"""Score of a run that does not reach its targets: the worst score of Table C."""
Space = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
SPACES: Final[dict[str, tuple[Space, Space]]] = {
    "bench": (((0.20, 0.65), (-0.20, 0.50), (0.40, 1.60)), ((0.25, 0.60), (-0.20, 0.20), (0.40, 1.50))),
    "wide": (((0.00, 0.80), (-0.30, 0.70), (0.10, 1.90)), ((0.20, 0.75), (-0.35, 0.35), (0.10, 1.80))),
}
"""[m] Ranges of target points and of box centres: forward, towards the side of the hand (of a box: left), up. "wide"
has points near the floor, overhead and far ahead."""


@dataclass(frozen=True)
class ReachTask:
    """Target points of the hands: side -> (x, y, z) [m], forward, left and up from the floor under the pelvis."""

    targets: Mapping[str, tuple[float, float, float]]

    def constraint(self, dofs: Array) -> tuple[Array, Array]:
        """Return the position errors (m,) [m] of the hands, three for each, and their Jacobian (m, 22) [m/deg]."""
        residuals, jacobians = [], []
        for side, target in self.targets.items():
            position, jacobian = hand(dofs, side)
            residuals.append(position - np.array(target))
            jacobians.append(jacobian)
        return np.concatenate(residuals), np.concatenate(jacobians)


def tasks(n: int, seed: int = 0, space: Literal["bench", "wide"] = "bench") -> tuple[ReachTask, ...]:
    """Return n tasks in one of `SPACES`; one hand (left and right in turn) and two hands alternate.

    Example:
        >>> [sorted(task.targets) for task in tasks(4)]
        [['left'], ['left', 'right'], ['right'], ['left', 'right']]
    """
    rng = np.random.default_rng(seed)
    of_hand, of_box = SPACES[space]
    generated = []
    for number in range(n):
        if number % 2 == 0:
            side = SIDES[number // 2 % 2]
            x, y, z = (float(rng.uniform(*ends)) for ends in of_hand)
            generated.append(ReachTask({side: (x, y if side == "left" else -y, z)}))
        else:
            x, y, z = (float(rng.uniform(*ends)) for ends in of_box)
            generated.append(ReachTask({"left": (x, y + BOX / 2, z), "right": (x, y - BOX / 2, z)}))
    return tuple(generated)


def starts(kind: Starts, n: int, seed: int = 0) -> Array:
    """Return initial postures (n, 22) [deg]: uniform within the limits, or within 5 deg of standing upright."""
    rng = np.random.default_rng([seed, 1])
    low, high = limits()
    if kind == "random":
        return rng.uniform(low, high, (n, len(low)))
    return np.clip(neutral() + rng.uniform(-5.0, 5.0, (n, len(low))), low, high)


def true_score(dofs: Array) -> int:
    """Return the exact REBA score of degrees of freedom (22,) [deg]."""
    return int(reba.score_array(posture(dofs)[None]).reba[0])


def on_figure(objective: Objective) -> Objective:
    """Return an objective of the posture angles as one of the degrees of freedom of the figure."""

    def evaluate(dofs: Array) -> tuple[float, Array]:
        value, gradient = objective(posture(dofs))
        return value, pull_back(gradient)

    return evaluate


SINGLE_STAGE: Final = Effort(iterations=100, tolerance=1e-4)
"""Limits of a method of one stage: more and finer than those of a stage that others follow."""


@dataclass(frozen=True)
class Method:
    """Solution method of a reach task: objectives of the 22 angles, one per stage, and options of the minimisation.

    Attributes:
        name: row of tables.
        free_start: see `staged_minimiser.minimise`.
        effort: limits of the stages.
        select_by_score: whether the result is the stage end of the lowest exact score.
    """

    name: str
    objectives: Sequence[Objective]
    free_start: bool = False
    effort: Effort = SINGLE_STAGE
    select_by_score: bool = False


def method_of(model: Surrogate, temperature: float | None = None, name: str = "", free_start: bool = True) -> Method:
    """Return a model of all 22 columns as a method: the stages of a graduated model, or one stage for any other.

    Args:
        temperature: [deg] of a model with temperatures; None for its default, or for all stages of a graduated one.
        name: row of tables, the kind by default.
        free_start: of a graduated model.
    """
    if isinstance(model, GraduatedModel) and temperature is None:
        objectives = [_by_columns(model, stage.objective()) for stage in model.stages_]
        return Method(name or model.kind, objectives, free_start=free_start, effort=Effort(), select_by_score=True)

    def objective(angles: Array) -> tuple[float, Array]:
        value, gradient = model.value_and_gradient(angles, temperature=temperature)
        return float(value), gradient

    return Method(name or model.kind, [_by_columns(model, objective)])


def _by_columns(model: Surrogate, objective: Objective) -> Objective:
    """Return an objective of the angles in the order of a model's joints as one of `reba.COLUMNS`."""
    if model.joints_ == COLUMNS:
        return objective
    places = [INDEX[joint] for joint in model.joints_]

    def reordered(angles: Array) -> tuple[float, Array]:
        value, by_joints = objective(angles[places])
        gradient = np.zeros(len(COLUMNS))
        gradient[places] = by_joints
        return value, gradient

    return reordered


@dataclass(frozen=True)
class ReachResult:
    """Results of a method on tasks x starts: exact scores, and means per run of evaluations and wall time.

    Attributes:
        scores: (tasks, starts), `INFEASIBLE` where the targets were not reached.
        infeasible: share of runs that did not reach their targets.
        evaluations: of the objective.
        constraint_evaluations: of the hand positions.
    """

    scores: NDArray[np.int64]
    infeasible: float
    evaluations: float
    constraint_evaluations: float
    seconds: float

    @property
    def mean(self) -> float:
        """Mean exact score."""
        return float(self.scores.mean())

    def share_best(self, best: NDArray[np.int64]) -> float:
        """Return the share of runs that equal the best known score of their task (tasks,)."""
        return float((self.scores == best[:, None]).mean())

    def share_best_of_starts(self, best: NDArray[np.int64]) -> float:
        """Return the share of tasks whose best start equals the best known score (tasks,)."""
        return float((self.scores.min(axis=1) == best).mean())


def run(method: Method, reach_tasks: Sequence[ReachTask], initial: Array) -> ReachResult:
    """Return the results of every task from every initial posture, `initial` (tasks, starts, 22) [deg]."""
    # The matrices are tiny: synchronising threads of the linear algebra takes longer than the arithmetic.
    with threadpool_limits(1):
        return _run(method, reach_tasks, initial)


def _run(method: Method, reach_tasks: Sequence[ReachTask], initial: Array) -> ReachResult:
    low, high = limits()
    objectives = [on_figure(objective) for objective in method.objectives]
    scores = np.empty(initial.shape[:2], np.int64)
    counts = []
    start_time = perf_counter()
    for row, task in enumerate(reach_tasks):
        for column, start in enumerate(initial[row]):
            minimum = minimise(
                objectives, start, low, high, task.constraint, free_start=method.free_start, effort=method.effort,
                score=true_score if method.select_by_score else None,
            )  # fmt: skip
            scores[row, column] = true_score(minimum.x) if minimum.residual <= TOLERANCE else INFEASIBLE
            counts.append((minimum.residual > TOLERANCE, minimum.evaluations, minimum.constraint_evaluations))
    seconds = (perf_counter() - start_time) / len(counts)
    infeasible, evaluations, constraint_evaluations = (float(mean) for mean in np.mean(counts, axis=0))
    return ReachResult(scores, infeasible, evaluations, constraint_evaluations, seconds)


def best_known(results: Sequence[ReachResult]) -> NDArray[np.int64]:
    """Return the lowest score (tasks,) that any method reached from any start."""
    return np.min([result.scores.min(axis=1) for result in results], axis=0)


HEIGHT: Final = 1.75
"""[m] Stature of the figure."""
_SHARES: Final = {
    "ankle": 0.039, "shank": 0.246, "thigh": 0.245, "trunk": 0.288, "half shoulders": 0.129,
    "upper arm": 0.186, "forearm": 0.146, "grip": 0.055,
}  # fmt: skip
"""Segment lengths as shares of stature (Drillis & Contini 1966, in Winter 2009, Fig. 4.1); grip is half the hand."""
ROTATIONS: Final = tuple(f"upper_arm_rotation_{side}" for side in SIDES)
"""[deg] Internal rotation of the upper arms, 0 with the elbow axis pointing sideways."""
ROTATION_LIMITS: Final = (-60.0, 80.0)
"""[deg] American Academy of Orthopaedic Surgeons (1965), Joint Motion, rounded."""
DOFS: Final = (*(column for column in COLUMNS if not column.startswith("shoulder_elevation")), *ROTATIONS)
"""Names of the 22 degrees of freedom."""
_SCORED: Final = np.array([INDEX[name] for name in DOFS if name in INDEX])
_DOF_INDEX: Final = {name: index for index, name in enumerate(DOFS)}


class _Joint(NamedTuple):
    """Revolute joint: degree of freedom, axis in the parent frame, offset [m] of the next joint in its own frame."""

    dof: int
    axis: tuple[float, float, float]
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)


def _chain(side: str) -> tuple[_Joint, ...]:
    """Return the joints from pelvis to hand."""
    out = 1.0 if side == "left" else -1.0
    size = {name: share * HEIGHT for name, share in _SHARES.items()}

    def joint(
        name: str, axis: tuple[float, float, float], offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> _Joint:
        return _Joint(_DOF_INDEX[name], axis, offset)

    return (
        joint("trunk_flexion", (0.0, 1.0, 0.0)),
        joint("trunk_side_bend", (1.0, 0.0, 0.0)),
        joint("trunk_twist", (0.0, 0.0, 1.0), (0.0, out * size["half shoulders"], size["trunk"])),
        joint(f"upper_arm_flexion_{side}", (0.0, -1.0, 0.0)),
        joint(f"upper_arm_abduction_{side}", (out, 0.0, 0.0)),
        joint(f"upper_arm_rotation_{side}", (0.0, 0.0, -out), (0.0, 0.0, -size["upper arm"])),
        joint(f"lower_arm_flexion_{side}", (0.0, -1.0, 0.0)),
        joint(f"wrist_twist_{side}", (0.0, 0.0, -out), (0.0, 0.0, -size["forearm"])),
        joint(f"wrist_flexion_{side}", (-out, 0.0, 0.0)),
        joint(f"wrist_deviation_{side}", (0.0, 1.0, 0.0), (0.0, 0.0, -size["grip"])),
    )


_CHAINS: Final = {side: _chain(side) for side in SIDES}


def limits() -> tuple[Array, Array]:
    """Return lower and upper limits (22,) [deg] of `DOFS`: those of the domain `human` and `ROTATION_LIMITS`."""
    human = domain_of("human")
    ends = np.array([ROTATION_LIMITS, ROTATION_LIMITS])
    return np.append(human.low[_SCORED], ends[:, 0]), np.append(human.high[_SCORED], ends[:, 1])


def neutral() -> Array:
    """Return the neutral posture (22,) [deg]: upright, upper arms hanging, elbows at 80 deg."""
    dofs = np.zeros(len(DOFS))
    for side in SIDES:
        dofs[_DOF_INDEX[f"lower_arm_flexion_{side}"]] = 80.0
    return dofs


def posture(dofs: Array) -> Array:
    """Return the angles (22,) [deg] of `reba.COLUMNS` from the degrees of freedom (22,) [deg]."""
    angles = np.zeros(len(COLUMNS))
    angles[_SCORED] = dofs[: len(_SCORED)]
    return angles


def pull_back(gradient: Array) -> Array:
    """Return the gradient (22,) by the degrees of freedom from that by the angles (22,)."""
    by_dofs = np.zeros(len(DOFS))
    by_dofs[: len(_SCORED)] = gradient[_SCORED]
    return by_dofs


def hand(dofs: Array, side: str) -> tuple[Array, Array]:
    """Return the grip position (3,) [m] of a hand and its Jacobian (3, 22) [m/deg].

    Example:
        >>> hand(neutral(), "right")[0].round(2)
        array([ 0.35, -0.23,  1.04])
    """
    pelvis, by_knee = _pelvis(dofs)
    position, frame = np.array([0.0, 0.0, pelvis]), np.eye(3)
    origins, axes = [], []
    for joint in _CHAINS[side]:
        axis = np.array(joint.axis)
        origins.append(position)
        axes.append(frame @ axis)
        frame = frame @ _rotation(axis, float(dofs[joint.dof]))
        position = position + frame @ np.array(joint.offset)
    jacobian = np.zeros((3, len(DOFS)))
    (x, y, z), (u, v, w) = np.array(axes).T, (position - np.array(origins)).T
    cross = np.array([y * w - z * v, z * u - x * w, x * v - y * u])
    jacobian[:, [joint.dof for joint in _CHAINS[side]]] = np.radians(cross)
    for knee, slope in zip(("knee_flexion_left", "knee_flexion_right"), by_knee, strict=True):
        jacobian[2, _DOF_INDEX[knee]] = slope
    return position, jacobian


def _pelvis(dofs: Array) -> tuple[float, tuple[float, float]]:
    """Return the height of the pelvis [m], the mean over both legs, and its slope by each knee [m/deg]."""
    shank, thigh = _SHARES["shank"] * HEIGHT, _SHARES["thigh"] * HEIGHT
    height, slopes = _SHARES["ankle"] * HEIGHT, []
    for side in SIDES:
        knee = np.radians(float(dofs[_DOF_INDEX[f"knee_flexion_{side}"]]))
        leg = np.sqrt(shank**2 + thigh**2 + 2.0 * shank * thigh * np.cos(knee))
        height += leg / 2.0
        slopes.append(float(np.radians(-shank * thigh * np.sin(knee) / leg / 2.0)))
    return float(height), (slopes[0], slopes[1])


def _rotation(axis: Array, angle: float) -> Array:
    """Return the rotation matrix of an angle [deg] about a positive or negative coordinate axis."""
    x, y, z = (float(part) for part in axis)
    c, s = float(np.cos(np.radians(angle))), float(np.sin(np.radians(angle)))
    if x:
        return np.array([[1.0, 0.0, 0.0], [0.0, c, -x * s], [0.0, x * s, c]])
    if y:
        return np.array([[c, 0.0, y * s], [0.0, 1.0, 0.0], [-y * s, 0.0, c]])
    return np.array([[c, -z * s, 0.0], [z * s, c, 0.0], [0.0, 0.0, 1.0]])
