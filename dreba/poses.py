"""Poses with their true scores: the record and its Parquet file."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dreba.errors import SampleError
from dreba.given import Given, given_of
from reba.errors import RebaError
from reba.factors import FACTORS, Factors
from reba.posture import COLUMNS

METADATA: Final = b"dreba"
"""Key of the provenance in a Parquet file."""


@dataclass(frozen=True)
class Poses:
    """Postures with their true REBA.

    Attributes:
        angles: (n, 22) degrees in the order of `reba.COLUMNS`.
        reba: (n,) true scores: exact REBA, or from the bins of a domain that has its own.
        factors: load, coupling and activity per pose, or None.
        provenance: domain, distribution, seed, counts: enough to draw the same poses again.
    """

    angles: NDArray[np.float64]
    reba: NDArray[np.uint8]
    factors: Factors | None = None
    provenance: dict[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.reba)

    @property
    def given(self) -> Given:
        """Load, coupling and activity as a surrogate takes them."""
        return given_of(self.factors, len(self))

    @property
    def counts(self) -> dict[int, int]:
        """Number of poses of each REBA class that occurs."""
        classes, counts = np.unique(self.reba, return_counts=True)
        return dict(zip(classes.tolist(), counts.tolist(), strict=True))

    def rows(self, which: NDArray[Any] | slice) -> Poses:
        """Return some of the poses (a slice, an index or a boolean array)."""
        factors = None
        if self.factors is not None:
            given = {name: getattr(self.factors, name) for name in FACTORS}
            factors = Factors(**{name: np.asarray(v)[which] if np.ndim(v) else v for name, v in given.items()})
        return Poses(self.angles[which], self.reba[which], factors, self.provenance)

    def split(self, share: float, rng: np.random.Generator) -> tuple[Poses, Poses]:
        """Return two parts, the second holding `share` of the poses of each class: a run from a random one of them.

        Drawn poses stand in random order. In a recording neighbours are nearly alike, so a run of frames says more
        about unseen ones than frames taken from between those of the fit.
        """
        held = np.zeros(len(self), bool)
        for score in self.counts:
            rows = np.flatnonzero(self.reba == score)
            held[np.roll(rows, rng.integers(len(rows)))[: round(share * len(rows))]] = True
        return self.rows(~held), self.rows(held)

    def balancing_weights(self) -> NDArray[np.float64]:
        """Return weights (n,) of mean 1 that give every REBA class that occurs the same total."""
        counts = np.bincount(self.reba)
        return np.asarray(len(self) / (np.count_nonzero(counts) * counts[self.reba]), np.float64)

    def save(self, path: str | Path) -> None:
        """Write a Parquet file: a posture table (so that `reba score` reads it too) with `reba` and the factors.

        Raises:
            SampleError: the place cannot be written to.
        """
        import pandas as pd
        import pyarrow as pa
        import pyarrow.parquet as pq

        from reba.writers import write_atomic

        data = pd.DataFrame(self.angles, columns=list(COLUMNS))
        data.insert(0, "time", np.arange(len(self), dtype=float))
        for name in FACTORS if self.factors is not None else ():
            data[name] = getattr(self.factors, name)
        data["reba"] = self.reba
        table = pa.Table.from_pandas(data, preserve_index=False)
        note = json.dumps(self.provenance).encode()
        table = table.replace_schema_metadata({**(table.schema.metadata or {}), METADATA: note})
        try:
            write_atomic(Path(path), lambda part: pq.write_table(table, part, compression="zstd"))
        except RebaError as error:
            raise SampleError(str(error)) from error

    @staticmethod
    def load(path: str | Path) -> Poses:
        """Read what `save` wrote.

        Raises:
            SampleError: not such a file, or damaged.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            table = pq.read_table(path)
            note = (table.schema.metadata or {}).get(METADATA)
            if note is None:
                raise SampleError(f"{path}: holds no sampled poses; give a file of `dreba sample`, or read_poses()")
            data = table.to_pandas()
            factors = Factors(**{name: data[name].to_numpy() for name in FACTORS}) if "load" in data else None
            angles = data[list(COLUMNS)].to_numpy(np.float64)
            return Poses(angles, data["reba"].to_numpy(np.uint8), factors, json.loads(note))
        except SampleError:
            raise
        except (OSError, pa.ArrowException, KeyError, ValueError, TypeError, RecursionError) as error:
            raise SampleError(f"{path}: cannot be read as poses ({error}); draw them again") from error
