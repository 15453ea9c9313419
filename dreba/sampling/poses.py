"""Poses with their true scores: the record and its Parquet file."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

import reba
from dreba.domain import Domain
from dreba.errors import SampleError
from dreba.sampling.classes import true_scores
from dreba.surrogates.task_factors import TaskFactors, given_of
from reba.arrays import Array
from reba.errors import RebaError, did_you_mean
from reba.files import write_atomic
from reba.posture.columns import BEST, COLUMNS, COLUMNS_OF, INDEX
from reba.posture.factors import FACTORS, Factors
from reba.posture.named_angles import LARGEST, read_angles

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

    angles: Array
    reba: NDArray[np.uint8]
    factors: Factors | None = None
    provenance: dict[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.reba)

    @property
    def given(self) -> TaskFactors:
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

    def balancing_weights(self) -> Array:
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
            angles, _ = read_angles(data, COLUMNS, absent="refuse")
            return Poses(angles, data["reba"].to_numpy(np.uint8), factors, json.loads(note))
        except SampleError:
            raise
        except (OSError, pa.ArrowException, KeyError, ValueError, TypeError, RecursionError) as error:
            raise SampleError(f"{path}: cannot be read as poses ({error}); draw them again") from error


Joints = Iterable[str] | None
"""Columns, "measured" or None."""
Hold = str | Mapping[str, float] | None
"""Angles [deg] by column, "neutral" or None."""
MEASURED: Final = "measured"
NEUTRAL: Final = "neutral"


def read_poses(
    path: str | Path, rules: reba.Rules | str = "measured", *, joints: Joints = None, hold: Hold = None
) -> Poses:
    """Read poses from a file of `dreba sample`, or score the frames of any readable recording.

    Frames in which an angle that counts is not measured are left out. Columns that do not count are held at an angle,
    in the poses and in their true scores; provenance names them with it.

    Args:
        path: file.
        rules: of the scores of a recording.
        joints: columns that count (a name without a side stands for both), or "measured" for those that the recording
            has; the others are held at the angle of their lowest score. None for all.
        hold: columns held at an angle [deg], or "neutral": those that are not measured, at that of their lowest score.

    Raises:
        reba.RebaError: the file cannot be read.
        SampleError: a column that counts is not measured, or no frame has all of them.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> import pandas as pd
        >>> with TemporaryDirectory() as folder:
        ...     place = Path(folder) / "lift.csv"
        ...     pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [5.0, 70.0]}).to_csv(place, index=False)
        ...     poses = read_poses(place, joints="measured")
        >>> poses.reba.tolist(), poses.provenance["joints"]
        ([1, 2], ['trunk_flexion'])
    """
    if _is_sample(path):
        poses, domain = Poses.load(path), None
    else:
        poses, domain = _recorded(path, rules)
    measured = np.asarray(np.isfinite(poses.angles).any(axis=0))
    held = _held(joints, hold, tuple(np.array(COLUMNS)[measured]), str(path))
    missing = [column for column in COLUMNS if column not in held and not measured[INDEX[column]]]
    if missing:
        raise SampleError(
            f"{path}: not measured: {', '.join(missing)}; a model needs every angle, so fit over the measured ones "
            f"(joints 'measured' or a list), or hold the others (hold 'neutral' or COLUMN=DEGREES)"
        )
    angles = poses.angles.copy()
    for column, angle in held.items():
        angles[:, INDEX[column]] = angle
    whole = np.asarray(np.isfinite(angles).all(axis=1))
    if not whole.any():
        raise SampleError(f"{path}: no frame has all angles, each lacks another one; name fewer joints, or hold some")
    provenance = dict(poses.provenance)
    if held:
        provenance |= {"joints": [column for column in COLUMNS if column not in held], "held": held}
    if domain is None and not held:
        return poses
    kept = Poses(angles, poses.reba, poses.factors, provenance).rows(whole)
    if domain is None:
        domain = Domain.from_dict(provenance["domain"]).hold(**held)
    else:
        low, high = kept.angles.min(axis=0), kept.angles.max(axis=0)
        spans = zip(COLUMNS, low.tolist(), high.tolist(), strict=True)
        domain = dataclasses.replace(domain, limits={column: (a, b) for column, a, b in spans})
        provenance["left_out"] = int((~whole).sum())
    provenance["domain"] = domain.to_dict()
    return dataclasses.replace(kept, reba=true_scores(domain, kept.angles, kept.factors), provenance=provenance)


def columns_named(names: Iterable[str]) -> tuple[str, ...]:
    """Return the columns of names, of which one without a side stands for both, in the order of `reba.COLUMNS`.

    Raises:
        SampleError: a name is unknown, or there is none.

    Example:
        >>> columns_named(["knee_flexion", "trunk_flexion"])
        ('trunk_flexion', 'knee_flexion_left', 'knee_flexion_right')
    """
    found: set[str] = set()
    for name in names:
        columns = COLUMNS_OF.get(name, (name,))
        if columns[0] not in INDEX:
            known = (*COLUMNS_OF, *COLUMNS)
            raise SampleError(f"column {name!r} is unknown{did_you_mean(str(name), known)}; see reba.COLUMNS")
        found.update(columns)
    if not found:
        raise SampleError("no joint is named; expected columns such as trunk_flexion,knee_flexion")
    return tuple(column for column in COLUMNS if column in found)


def _held(joints: Joints, hold: Hold, measured: tuple[str, ...], path: str) -> dict[str, float]:
    """Return the columns that do not count, each with the angle [deg] it is held at."""
    if isinstance(joints, str) and joints != MEASURED:
        raise SampleError(f"joints are {joints!r}; expected 'measured' or a list of columns")
    if isinstance(hold, str) and hold != NEUTRAL:
        raise SampleError(f"hold is {hold!r}; expected 'neutral', or columns with their degrees")
    if not measured:
        raise SampleError(f"{path}: no angle is measured; see `reba info`")
    held: dict[str, float] = {}
    if joints is not None:
        counting = measured if isinstance(joints, str) else columns_named(joints)
        held = {column: best for column, best in BEST.items() if column not in counting}
    if isinstance(hold, str):
        held |= {column: best for column, best in BEST.items() if column not in measured}
    elif hold is not None:
        for name, angle in hold.items():
            if not abs(angle) <= LARGEST:
                raise SampleError(f"{name} is held at {angle}; expected degrees from -{LARGEST:g} to {LARGEST:g}")
            held |= dict.fromkeys(columns_named([name]), float(angle))
    return {column: held[column] for column in COLUMNS if column in held}


def _recorded(path: str | Path, rules: reba.Rules | str) -> tuple[Poses, Domain]:
    """Return the frames of a recording, unmeasured angles NaN, and the domain of their rules."""
    scores = reba.score(reba.read(path), rules=rules, activity="none", missing="neutral")
    name = Path(path).name
    provenance: dict[str, Any] = {"recording": name, "frames": len(scores.angles), "rules": scores.rules.name}
    domain = Domain(name, {}, scores.rules, source=f"smallest and largest angles in {name}")
    totals = np.asarray(scores.data["reba"], np.uint8)
    return Poses(scores.angles, totals, scores.factors, provenance), domain


def _is_sample(path: str | Path) -> bool:
    if Path(path).suffix.lower() != ".parquet":
        return False
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return METADATA in (pq.read_schema(path).metadata or {})
    except (OSError, pa.ArrowException):
        return False
