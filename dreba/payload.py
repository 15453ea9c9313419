"""delta_payload, the cost of a carried load that is added to the score of the posture (equations 3 and 4)."""

from __future__ import annotations

from typing import Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from dreba.errors import ModelError
from reba.rules import LOAD_EDGES

Payload = Literal["tree", "linear"]
PAYLOADS: Final = ("tree", "linear")
OMEGA_LOAD: Final = 5.0
"""[kg] Load that costs 1 in the linear form (equation 4)."""


def delta_payload(load: ArrayLike, form: Payload = "tree", omega: float = OMEGA_LOAD) -> Any:
    """Return the cost of a load, a float or (n,).

    Args:
        load: [kg], one or (n,), not negative.
        form: "tree": 0 below 5 kg, 1 from 5 to 10 kg, 2 above, the decision tree of equation (3); "linear":
            load / omega, equation (4), which makes light loads cost something and has a gradient.
        omega: [kg] load that costs 1 in the linear form.

    Raises:
        ModelError: an unknown form, or a load that is negative or no number.

    Example:
        >>> delta_payload(7.0), delta_payload(7.0, "linear")
        (1.0, 1.4)
    """
    kilograms = np.asarray(load, np.float64)
    if not (np.isfinite(kilograms).all() and (kilograms >= 0).all()):
        raise ModelError(f"load is {load!r}; expected kilograms, 0 or more")
    if form == "linear":
        cost = kilograms / omega
    elif form == "tree":
        cost = (kilograms >= LOAD_EDGES[0]).astype(float) + (kilograms > LOAD_EDGES[1])
    else:
        raise ModelError(f"payload is {form!r}; expected one of {', '.join(PAYLOADS)}")
    return float(cost) if cost.ndim == 0 else cost
