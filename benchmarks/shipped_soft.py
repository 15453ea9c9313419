"""Fit the soft model that comes with the package.

Usage: python benchmarks/shipped_soft.py [--updates N]

Poses: five sixths without load over REBA classes 1 to 10, one sixth, at a fifth of the weight, with load, coupling and
activity over 1 to 15, so that the learned tables stay right where load and coupling lead.
"""

from __future__ import annotations

import argparse

import numpy as np

import dreba
from dreba.surrogates.library import SHIPPED
from reba.posture.factors import Factors

SEED = 1
PLAIN, LOADED, HELD_OUT = 250_000, 50_000, 20_000
LOADED_WEIGHT = 0.2
UPDATES = 6000
DRAWN = ("load", "coupling_left", "coupling_right", "static", "repeated", "unstable")


def both(plain: dreba.Poses, loaded: dreba.Poses) -> dreba.Poses:
    """Poses of both, factors included."""

    def column(name: str) -> np.ndarray:
        values = np.asarray(getattr(loaded.factors, name))
        filler = np.zeros(len(plain), values.dtype) if values.dtype.kind in "biuf" else np.full(len(plain), "good")
        return np.concatenate([filler, np.broadcast_to(values, len(loaded))])

    return dreba.Poses(
        np.concatenate([plain.angles, loaded.angles]),
        np.concatenate([plain.reba, loaded.reba]),
        Factors(**{name: column(name) for name in DRAWN}),
        {"domain": plain.provenance["domain"], "plain": brief(plain), "loaded": brief(loaded)},
    )


def loaded_error(model: dreba.Surrogate) -> str:
    """Error per REBA class 1 to 15 on held-out poses with factors."""
    held_out = dreba.sample(HELD_OUT, range(1, 16), factors=["load", "coupling", "activity"], rng=(SEED, 4))
    evaluation = dreba.evaluate(model, held_out)
    return " ".join(f"{error.rmse:.2f}" for error in evaluation.classes.values())


def brief(poses: dreba.Poses) -> dict[str, object]:
    return {key: value for key, value in poses.provenance.items() if key != "domain"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--updates", type=int, default=UPDATES, help="steps of the fit at each temperature")
    updates = parser.parse_args().updates
    plain = dreba.sample(PLAIN, rng=SEED)
    loaded = dreba.sample(LOADED, range(1, 16), factors=["load", "coupling", "activity"], rng=(SEED, 3))
    held_out = dreba.sample(HELD_OUT, rng=(SEED, 1))
    command = "python benchmarks/shipped_soft.py" + (f" --updates {updates}" if updates != UPDATES else "")

    train = both(plain, loaded)
    soft = dreba.SoftModel(updates=updates, seed=SEED)
    weights = np.repeat([1.0, LOADED_WEIGHT], [PLAIN, LOADED])
    dreba.fit_to(soft, train, held_out, weights, command=command)
    soft.save(SHIPPED / "soft.json")
    for temperature in soft.temperatures_:
        evaluation = dreba.evaluate(soft, held_out, temperature=temperature)
        rmse = " ".join(f"{error.rmse:.2f}" for error in evaluation.classes.values())
        print(f"T = {temperature:4g} deg: {rmse}  all {evaluation.rmse:.3f}")
    loads = loaded_error(soft)
    print(f"with load, coupling and activity, T = {soft.temperature:g} deg: {loads}")


if __name__ == "__main__":
    main()
