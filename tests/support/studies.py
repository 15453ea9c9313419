"""Recordings of studies with known effects: scored tables, and short posture logs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

import reba
from lgp.study.scoring import DEMANDING, LEVELS, PARTS, TOTAL
from reba.posture.table import table_of

CONDITIONS = ("ergonomic", "non-ergonomic")


def table(
    gap: float, people: int = 10, seed: int = 0, conditions: tuple[str, ...] = CONDITIONS, same: tuple[str, ...] = ()
) -> pd.DataFrame:
    """Return scored recordings whose last condition is `gap` points worse in everything but the parts in `same`."""
    rng = np.random.default_rng(seed)
    rows = []
    for person in range(people):
        base = rng.normal(4.0, 1.0)
        for place, condition in enumerate(conditions):
            worse = gap * (place == len(conditions) - 1)
            values = {name: 2.0 if name in same else base + worse + rng.normal(0, 0.3) for name in (TOTAL, *PARTS)}
            rows.append(
                {
                    "participant": f"p{person:02}", "condition": condition, "trial": "", "simulated": False,
                    "input": f"p{person:02}_{condition}", "frames": 100, "seconds": rng.uniform(8, 10), **values,
                    "reba_low": values[TOTAL], "reba_high": values[TOTAL], "determined": 1.0, DEMANDING: 0.5,
                    **dict.fromkeys(LEVELS, 0.2), "level_undetermined": 0.0,
                }
            )  # fmt: skip
    return pd.DataFrame(rows)


def log(path: Path, record: dict[str, str] | None = None, trunk: float = 10.0) -> Path:
    """Write a short posture log, with a `study` record if one is given."""
    frames = pd.DataFrame({"time": [0.0, 0.1, 0.2], "trunk_flexion": trunk})
    path.parent.mkdir(parents=True, exist_ok=True)
    reba.write_postures(table_of(frames), path, records=None if record is None else {"study": record})
    return path
