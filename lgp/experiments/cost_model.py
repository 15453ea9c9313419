"""The dREBA model of an experiment, read once: every run, also in another process or a later command, has the same."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import dreba
from dreba.surrogates.base import Surrogate
from dreba.surrogates.library import models
from dreba.surrogates.serialization import from_dict, to_dict


@dataclass(frozen=True)
class CostModel:
    """A model as text: equal models are equal, and it can be sent to other processes.

    Attributes:
        name: file or shipped name, as it was given.
        text: content of its file, without spaces.
    """

    name: str
    text: str

    def model(self) -> Surrogate:
        """Return the model itself."""
        model: Surrogate = from_dict(json.loads(self.text))
        return model

    def settings(self) -> dict[str, str]:
        """Return what identifies it among the settings of an experiment; a file counts by what is in it."""
        if self.name in models():
            return {"cost": self.name}
        return {"cost": self.name, "cost_hash": hashlib.sha256(self.text.encode()).hexdigest()[:16]}


def cost_model(cost: str | Path | CostModel) -> CostModel:
    """Return the model of a file or of a shipped name; one that was read already stays as it is.

    Raises:
        dreba.errors.ModelError: there is no such file or name, or the file is damaged.

    >>> cost_model("quadratic").settings()
    {'cost': 'quadratic'}
    """
    if isinstance(cost, CostModel):
        return cost
    text = json.dumps(to_dict(dreba.load(cost)), separators=(",", ":"))
    return CostModel(str(cost), text)
