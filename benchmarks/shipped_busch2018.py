"""Write the shipped model `busch2018`: the coefficients that the authors of the paper published.

Usage: python benchmarks/shipped_busch2018.py

Nothing is fitted. The numbers are facts read in github.com/buschbapti/handovers, src/reba_optim/reba_assess.py, commit
0d3ba79 of 13 September 2017: for each joint a weight and a parabola through three points, and one residual. Left and
right have the same weight, and both sides are added. The shoulder girdle is not modelled, so its weight is 0. Load is
equation (4) of the paper.
"""

from __future__ import annotations

import numpy as np

import dreba
from dreba.surrogates.library import SHIPPED
from dreba.surrogates.registry import ModelInfo
from dreba.surrogates.serialization import from_dict, to_dict
from reba.posture.columns import COLUMNS, COLUMNS_OF, INDEX
from reba.provenance import provenance

SEED, HELD_OUT = 1, 20_000
PUBLISHED = {
    "neck_side_bend": (0.303, (-45, 0, 45), (1, 0, 1)),
    "neck_flexion": (1.008, (-35, 10, 55), (1, 0, 1)),
    "neck_twist": (0.524, (-45, 0, 45), (1, 0, 1)),
    "trunk_side_bend": (1.519, (-45, 0, 45), (1, 0, 1)),
    "trunk_flexion": (1.399, (-90, 0, 90), (3, 0, 3)),
    "trunk_twist": (1.856, (-45, 0, 45), (1, 0, 1)),
    "knee_flexion": (0.416, (-60, 0, 60), (2, 0, 2)),
    "upper_arm_abduction": (0.243, (-45, 0, 45), (1, 0, 1)),
    "upper_arm_flexion": (0.554, (-90, 0, 90), (3, 0, 3)),
    "lower_arm_flexion": (0.107, (0, 60, 100), (1, 0, 1)),
    "wrist_deviation": (0.096, (-45, 0, 45), (1, 0, 1)),
    "wrist_flexion": (0.843, (-45, 0, 45), (1, 0, 1)),
    "wrist_twist": (0.698, (-45, 0, 45), (1, 0, 1)),
}
"""Angle -> weight, angles [deg] and the values of the parabola through them; abduction is 90 minus the angle there."""
RESIDUAL = -0.206
SOURCE = "github.com/buschbapti/handovers, src/reba_optim/reba_assess.py, commit 0d3ba79, 13 September 2017"


def main() -> None:
    """Put the numbers into a model and write its file with the error on poses of the authors' bins."""
    options = {"domain": "paper", "minimum": "free", "payload": "linear", "payload_only": True}
    poses = dreba.sample(100, domain="paper", rng=SEED)
    data = to_dict(dreba.QuadraticModel(**options).fit(poses, poses.reba))  # its coefficients are replaced
    polynomials, weights = np.zeros((len(COLUMNS), 3)), np.zeros(len(COLUMNS))
    for name, (weight, angles, values) in PUBLISHED.items():
        for column in COLUMNS_OF[name]:
            weights[INDEX[column]] = weight
            polynomials[INDEX[column]] = np.polyfit(angles, values, 2)[::-1].round(12)
    data["parameters"]["learned"] = {
        "polynomials_": polynomials.tolist(), "weights_": weights.tolist(), "intercept_": RESIDUAL,
        "coupling_weight_": 0.0,
    }  # fmt: skip
    model = from_dict(data)
    held_out = dreba.sample(HELD_OUT, domain="paper", rng=(SEED, 1))
    errors = dreba.evaluate(model, held_out).classes
    origin = {key: value for key, value in held_out.provenance.items() if key != "domain"}
    notes = {"source": SOURCE, "fitted": "by its authors; the error is ours, on poses of their bins"}
    command = {"held_out": origin, "rmse_on": "held-out poses", "command": "python benchmarks/shipped_busch2018.py"}
    rmse = {str(score): round(error.rmse, 4) for score, error in errors.items()}
    model.about_ = ModelInfo(held_out.provenance["domain"], rmse, {**notes, **command, **provenance()})
    model.save(SHIPPED / "busch2018.json")


if __name__ == "__main__":
    main()
