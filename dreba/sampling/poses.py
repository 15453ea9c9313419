"""Poses with their true REBA scores: the record, its Parquet file, and poses from the frames of recordings."""

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
from dreba.surrogates.task_factors import TaskFactors, task_factors_of
from reba.arrays import Array
from reba.checks import PATH, TEXT, Allowed, accepts, instance, is_finite, shown
from reba.files import write_atomic_stream
from reba.open_file import open_regular
from reba.posture.columns import BEST, COLUMNS, INDEX, by_column, columns_named
from reba.posture.factors import FACTORS, Factors
from reba.posture.named_angles import LARGEST, check_spelling, checked_poses, read_angles
from reba.provenance import parquet_metadata, provenance

METADATA: Final = b"dreba"
"""Metadata key of the provenance in a Parquet file."""


@dataclass(frozen=True)
class Poses:
    """Poses with their true REBA scores.

    Attributes:
        angles: (n, 22) [deg] in the order of `reba.COLUMNS`; of other data with column names the table is made.
        reba: (n,) true scores: exact REBA, or from the bins of the domain.
        factors: load, coupling and activity per pose, or None.
        provenance: domain, distribution, seed and version, from which the same poses can be drawn again.
    """

    angles: Array
    reba: NDArray[np.uint8]
    factors: Factors | None = None
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        scores = np.asarray(self.reba)
        if scores.ndim != 1 or scores.dtype.kind not in "iuf":
            raise SampleError(f"reba is {shown(self.reba)}; expected (n,) scores, one for each pose")
        object.__setattr__(self, "reba", scores)
        if not isinstance(self.angles, np.ndarray) or self.angles.dtype != np.float64:
            object.__setattr__(self, "angles", checked_poses(self.angles, error=SampleError)[0])
        if self.angles.shape != (len(self.reba), len(COLUMNS)):
            raise SampleError(
                f"angles have shape {self.angles.shape}; expected ({len(self.reba)}, {len(COLUMNS)}), a row for each "
                "score, in the order of reba.COLUMNS"
            )

    def __len__(self) -> int:
        return len(self.reba)

    @property
    def task_factors(self) -> TaskFactors:
        """Load, coupling and activity in the units that surrogates take."""
        return task_factors_of(self.factors, len(self))

    @property
    def counts(self) -> dict[int, int]:
        """Number of poses of each REBA class that occurs."""
        classes, counts = np.unique(self.reba, return_counts=True)
        return dict(zip(classes.tolist(), counts.tolist(), strict=True))

    def rows(self, which: NDArray[Any] | slice) -> Poses:
        """Return the selected poses (a slice, an index array or a boolean array); SampleError for anything else."""
        try:
            fits = np.ndim(self.reba[which]) == 1
        except (IndexError, TypeError, ValueError, OverflowError):
            fits = False
        if not fits:
            raise SampleError(f"rows are {shown(which)}; expected a slice, or an array of indices or of booleans")
        factors = None
        if self.factors is not None:
            values = {name: getattr(self.factors, name) for name in FACTORS}
            factors = Factors(**{name: np.asarray(v)[which] if np.ndim(v) else v for name, v in values.items()})
        return Poses(self.angles[which], self.reba[which], factors, self.provenance)

    @accepts(
        SampleError,
        share=Allowed("a share from 0 to 1", lambda value: is_finite(value) and 0 <= value <= 1),
        rng=instance("a numpy Generator", np.random.Generator),
    )
    def split(self, share: float, rng: np.random.Generator) -> tuple[Poses, Poses]:
        """Return training and held-out poses; the latter are a run of the share of each class from a random pose on.

        Frames beside each other in a recording are nearly equal, so a run of frames estimates the error on unseen
        frames better than single frames between those of the fit. Drawn poses are in random order anyway.
        """
        held_out = np.zeros(len(self), bool)
        for score in self.counts:
            rows = np.flatnonzero(self.reba == score)
            held_out[np.roll(rows, rng.integers(len(rows)))[: round(share * len(rows))]] = True
        return self.rows(~held_out), self.rows(held_out)

    def balancing_weights(self) -> Array:
        """Return weights (n,) of mean 1 with the same sum for every REBA class that occurs."""
        counts = np.bincount(self.reba)
        return np.asarray(len(self) / (np.count_nonzero(counts) * counts[self.reba]), np.float64)

    @accepts(SampleError, path=PATH)
    def save(self, path: str | Path) -> None:
        """Write a Parquet file: a posture table, readable by `reba score` too, with `reba` and the factors.

        Raises:
            SampleError: the file cannot be written.
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
        metadata = parquet_metadata(table.schema.metadata, {**provenance(), **self.provenance})
        table = table.replace_schema_metadata({**metadata, METADATA: json.dumps(self.provenance).encode()})
        write_atomic_stream(path, lambda part: pq.write_table(table, part, compression="zstd"), error=SampleError)

    @staticmethod
    @accepts(SampleError, path=PATH)
    def load(path: str | Path) -> Poses:
        """Read a file of `save`.

        Raises:
            SampleError: the file is not one of `save`, or damaged.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            with open_regular(path) as file:
                table = pq.read_table(file)
            note = (table.schema.metadata or {}).get(METADATA)
            if note is None:
                raise SampleError(
                    f"{path}: has no provenance of sampled poses; give a file of `dreba sample`, or use read_poses()"
                )
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


JOINTS: Final = Allowed(
    f"{MEASURED!r}, or names of columns, or None",
    lambda value: value is None or TEXT.fits(value) or (isinstance(value, list | tuple) and all(map(TEXT.fits, value))),
)


HOLD: Final = Allowed(
    f"{NEUTRAL!r}, or degrees by column, or None",
    lambda value: (
        value is None or isinstance(value, str) or (isinstance(value, Mapping) and all(map(TEXT.fits, value)))
    ),
)


@accepts(SampleError, path=PATH, joints=JOINTS, hold=HOLD)
def read_poses(
    path: str | Path, rules: reba.Rules | str = "measured", *, joints: Joints = None, hold: Hold = None
) -> Poses:
    """Read poses from a file of `dreba sample`, or score the frames of any readable recording.

    Frames without all angles are left out. Columns that are not joints of the model are held at an angle, in the poses
    and in their true scores; the provenance names them with this angle, and what the reader noticed of a recording
    (`warnings`).

    Args:
        path: file.
        rules: rules of the scores of a recording.
        joints: columns that vary (a name without a side stands for both), or "measured" for those of the recording;
            the others are held at their neutral angle. None for all.
        hold: angles [deg] by column, or "neutral" for the neutral angle of every column that is not measured.

    Raises:
        reba.RebaError: the file cannot be read.
        SampleError: a column is neither measured nor held, or no frame has all angles.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> import pandas as pd
        >>> with TemporaryDirectory() as folder:
        ...     path = Path(folder) / "lift.csv"
        ...     pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [5.0, 70.0]}).to_csv(path, index=False)
        ...     poses = read_poses(path, joints="measured")
        >>> poses.reba.tolist(), poses.provenance["joints"]
        ([1, 2], ['trunk_flexion'])
    """
    poses, recorded, names = (Poses.load(path), None, ()) if _is_sample(path) else _recorded(path, rules)
    measured = np.asarray(np.isfinite(poses.angles).any(axis=0))
    held = _held(joints, hold, tuple(np.array(COLUMNS)[measured]), str(path))
    missing = [column for column in COLUMNS if column not in held and not measured[INDEX[column]]]
    if missing:
        try:
            check_spelling(names, missing, SampleError)
        except SampleError as error:
            raise SampleError(f"{path}: {error}") from error
        raise SampleError(
            f"{path}: not measured: {', '.join(missing)}; a model needs every angle, so fit over the measured ones "
            f"(joints 'measured' or a list), or hold the others (hold 'neutral' or COLUMN=DEGREES)"
        )
    angles = poses.angles.copy()
    for column, angle in held.items():
        angles[:, INDEX[column]] = angle
    complete = np.asarray(np.isfinite(angles).all(axis=1))
    if not complete.any():
        raise SampleError(f"{path}: no frame has all angles; name fewer joints, or hold those that are often missing")
    if recorded is None and not held:
        return poses
    selected = Poses(angles, poses.reba, poses.factors, dict(poses.provenance)).rows(complete)
    if held:
        selected.provenance.update(joints=[column for column in COLUMNS if column not in held], held=held)
    if recorded is None:
        domain = Domain.from_dict(poses.provenance["domain"]).hold(**held)
    else:
        domain = _within(recorded, selected.angles)
        selected.provenance["left_out"] = int((~complete).sum())
    selected.provenance["domain"] = domain.to_dict()
    return dataclasses.replace(selected, reba=true_scores(domain, selected.angles, selected.factors))


def _within(domain: Domain, angles: Array) -> Domain:
    """Return the domain with the ranges of angles (n, 22) [deg] as limits."""
    low, high = angles.min(axis=0), angles.max(axis=0)
    ranges = zip(COLUMNS, low.tolist(), high.tolist(), strict=True)
    return dataclasses.replace(domain, limits={column: (lowest, highest) for column, lowest, highest in ranges})


def _held(joints: Joints, hold: Hold, measured: tuple[str, ...], path: str) -> dict[str, float]:
    """Return the angle [deg] of each held column."""
    if isinstance(joints, str) and joints != MEASURED:
        raise SampleError(f"joints are {shown(joints)}; expected 'measured' or a list of columns")
    if isinstance(hold, str) and hold != NEUTRAL:
        raise SampleError(f"hold is {shown(hold)}; expected 'neutral', or columns with their degrees")
    if not measured:
        raise SampleError(f"{path}: no angle is measured; `reba info` says why")
    held: dict[str, float] = {}
    if joints is not None:
        varying = measured if isinstance(joints, str) else columns_named(joints, SampleError)
        held = {column: best for column, best in BEST.items() if column not in varying}
    if isinstance(hold, str):
        held |= {column: best for column, best in BEST.items() if column not in measured}
    elif hold is not None:
        for name, angle in hold.items():
            if not is_finite(angle) or abs(angle) > LARGEST:
                raise SampleError(f"{name} is held at {angle}; expected degrees from -{LARGEST:g} to {LARGEST:g}")
            columns_named([name], SampleError)
        held |= {column: float(angle) for column, angle in by_column(hold).items()}
    return {column: held[column] for column in COLUMNS if column in held}


def _recorded(path: str | Path, rules: reba.Rules | str) -> tuple[Poses, Domain, tuple[str, ...]]:
    """Return the frames of a recording, unmeasured angles NaN, a domain of their rules without limits, and the columns
    of the recording.
    """
    scores = reba.score(reba.read(path), rules=rules, activity="none", missing="neutral")
    name = Path(path).name
    provenance: dict[str, Any] = {"recording": name, "frames": len(scores.angles), "rules": scores.rules.name}
    if notes := scores.postures.quality.notes(radians=False):
        provenance["warnings"] = notes
    domain = Domain(name, {}, scores.rules, source=f"smallest and largest angles in {name}")
    totals = np.asarray(scores.data["reba"], np.uint8)
    return Poses(scores.angles, totals, scores.factors, provenance), domain, tuple(map(str, scores.postures.data))


def _is_sample(path: str | Path) -> bool:
    """Return whether a file was written by `Poses.save`."""
    if Path(path).suffix.lower() != ".parquet":
        return False
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with open_regular(path) as file:
            return METADATA in (pq.read_schema(file).metadata or {})
    except (OSError, pa.ArrowException):
        return False
