"""Error metrics of a model against true scores: RMSE and bias per REBA class, rank correlation, rounded accuracy."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dreba.errors import ModelError
from reba.arrays import Array

PUBLISHED: Final[dict[int, float]] = {
    1: 0.72, 2: 0.91, 3: 0.86, 4: 1.08, 5: 1.02, 6: 1.72, 7: 1.86, 8: 2.18, 9: 2.18, 10: 1.50,
}  # fmt: skip
"""RMSE per REBA class of the published model (Busch et al. 2018, Table I)."""
PUBLISHED_OVERALL: Final = 1.50
"""Overall RMSE of the published model on balanced poses: the root of the mean square of `PUBLISHED`."""


@dataclass(frozen=True)
class ClassError:
    """Error on the poses of one REBA class: number of poses, RMSE, and bias (mean of model minus true score)."""

    n: int
    rmse: float
    bias: float


@dataclass(frozen=True)
class Evaluation:
    """Error of a model on poses with their true scores.

    Attributes:
        kind: kind of the model.
        classes: REBA score -> `ClassError`, for the scores that occur.
        n: number of poses.
        rmse: root mean square error over all poses.
        balanced_rmse: root of the mean over classes of the squared RMSE; equal to `rmse` on balanced poses.
        spearman: rank correlation with the true score; NaN where one of them is constant.
        rounded_accuracy: share of poses whose value, rounded and clipped to 1 to 15, is the true score.
    """

    kind: str
    classes: dict[int, ClassError]
    n: int
    rmse: float
    balanced_rmse: float
    spearman: float
    rounded_accuracy: float

    def to_dict(self) -> dict[str, Any]:
        """Return the plain data of `dreba evaluate --json`; None for NaN."""
        overall = {
            "n": self.n,
            "rmse": self.rmse,
            "balanced_rmse": self.balanced_rmse,
            "spearman": None if np.isnan(self.spearman) else self.spearman,
            "rounded_accuracy": self.rounded_accuracy,
        }
        classes = {str(score): dataclasses.asdict(error) for score, error in self.classes.items()}
        return {"kind": self.kind, "classes": classes, "overall": overall}


def evaluation_of(kind: str, values: ArrayLike, scores: ArrayLike) -> Evaluation:
    """Return the error of values (n,) against true scores (n,); ModelError without poses or for a value not finite."""
    predicted, true = np.asarray(values, np.float64), np.asarray(scores).astype(int)
    if predicted.shape != true.shape or not len(true):
        raise ModelError(
            f"values have shape {predicted.shape} and scores {true.shape}; expected as many of both, at least one"
        )
    if not np.isfinite(predicted).all():
        raise ModelError("the model returns values that are not finite; check the angles")
    error = predicted - true
    classes = {}
    for score in np.unique(true):
        own = error[true == score]
        classes[int(score)] = ClassError(len(own), _rms(own), float(own.mean()))
    return Evaluation(
        kind=kind,
        classes=classes,
        n=len(true),
        rmse=_rms(error),
        balanced_rmse=_rms(np.array([own.rmse for own in classes.values()])),
        spearman=_spearman(predicted, true),
        rounded_accuracy=float(np.mean(np.clip(np.rint(predicted), 1, 15) == true)),
    )


def distance_to_published(evaluation: Evaluation) -> float:
    """Return the root mean square difference of the RMSE per class to Table I; classes 1 to 10 must all have poses."""
    missing = [score for score in PUBLISHED if score not in evaluation.classes]
    if missing:
        raise ModelError(f"no pose has REBA {missing[0]}; expected poses of all classes 1 to 10 of Table I")
    return _rms(np.array([evaluation.classes[score].rmse - PUBLISHED[score] for score in PUBLISHED]))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _spearman(predicted: Array, true: NDArray[np.int64]) -> float:
    from scipy.stats import rankdata

    ranks = [rankdata(values) for values in (predicted, true)]
    centred = [rank - rank.mean() for rank in ranks]
    dispersion = float(np.sqrt((centred[0] @ centred[0]) * (centred[1] @ centred[1])))
    return float(centred[0] @ centred[1]) / dispersion if dispersion else float("nan")


def published_overall(scores: Iterable[int]) -> float:
    """Return the overall RMSE of the published model over the REBA classes of these that Table I has, NaN if none.

    Example:
        >>> published_overall(range(1, 11)) - PUBLISHED_OVERALL < 0.005, round(published_overall([1, 2]), 2)
        (True, 0.82)
    """
    squares = [PUBLISHED[score] ** 2 for score in scores if score in PUBLISHED]
    return float(np.sqrt(np.mean(squares))) if squares else float("nan")


def with_error(value: float, error: float | None, sign: str = "") -> str:
    """Return a mean with its standard error in brackets, where there is one.

    Example:
        >>> with_error(-0.163, 0.07, "+"), with_error(2.0, None)
        ('-0.16 (0.07)', '2.00')
    """
    return f"{value:{sign}.2f}" + ("" if error is None else f" ({error:.2f})")
