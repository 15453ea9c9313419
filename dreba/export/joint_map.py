"""Maps of a caller's own joints, in its order, signs and unit, to the angles of a model: offset + matrix joints."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from dreba.errors import ModelError
from reba.arrays import Array
from reba.errors import RebaError, did_you_mean
from reba.open_file import read_settings
from reba.posture.columns import BEST, COLUMNS, COLUMNS_OF, by_column
from reba.posture.named_angles import LARGEST
from reba.readers.recording.profile import read_columns
from reba.toml_table import TomlTable

UNITS: Final = {"rad": float(np.degrees(1.0)), "deg": 1.0}
"""Units of joints, in degrees."""


@dataclass(frozen=True)
class JointMap:
    """Angles (d,) [deg] of a model as offset (d,) plus matrix (d, m) times joints (m,) in their unit.

    Attributes:
        joints: (m,) names in the order of the caller.
        unit: "rad" or "deg".
        matrix: (d, m) [deg per unit].
        offset: (d,) [deg].
        held: columns that no joint moves, with their angle [deg].
    """

    joints: tuple[str, ...]
    unit: str
    matrix: Array
    offset: Array
    held: dict[str, float]


def read_map(path: str | Path, columns: tuple[str, ...]) -> JointMap:
    """Read the map of a TOML file to the columns of a model.

    Keys: `joints`, the names in the order of the caller; `unit`, "rad" (default) or "deg"; `[columns]`, the joints of
    each column with their signs and degrees to add, as in a profile (`wrist_twist = ["+{side}_elbow_Y", -90]`);
    `[hold]`, degrees of the columns that no joint moves, or `hold = "neutral"`: elbows at 80 degrees, all others at 0.

    Raises:
        ModelError: the file cannot be read, a name is unknown, or a column of the model is neither moved nor held.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> with TemporaryDirectory() as folder:
        ...     file = Path(folder) / "arm.toml"
        ...     lines = ['joints = ["elbow", "slide"]', "[columns]", 'lower_arm_flexion_left = ["-elbow", 5]']
        ...     _ = file.write_text("\\n".join(lines))
        ...     own = read_map(file, ("lower_arm_flexion_left",))
        >>> own.matrix.round(3).tolist(), own.offset.tolist()
        ([[-57.296, 0.0]], [5.0])
    """
    try:
        table = TomlTable(str(path), tomllib.loads(read_settings(path)), ModelError)
        joints = table.names("joints")
        unit = table.text("unit", "rad", choices=UNITS)
        terms = read_columns(table, "columns")
        if isinstance(table.values.get("hold"), str):
            table.text("hold", choices=["neutral"])
            held = {column: BEST[column] for column in columns if column in BEST and column not in terms}
        else:
            table.table("hold").keys((*COLUMNS_OF, *COLUMNS), "column")
            held = by_column(table.numbers("hold"))
        table.done()
    except ModelError:
        raise
    except RebaError as error:
        raise ModelError(str(error)) from error
    except (OSError, UnicodeDecodeError, ValueError, RecursionError) as error:
        raise ModelError(f"{path}: cannot be read as a map of joints ({error}); give a TOML file") from error
    if not joints or len(set(joints)) != len(joints):
        raise ModelError(f"{path}: joints are {list(joints)[:8]}; expected each name once, at least one")
    absent = [column for column in columns if column not in terms and column not in held]
    if absent:
        raise ModelError(
            f"{path}: neither in [columns] nor in [hold]: {', '.join(absent)}; every angle of the model needs joints "
            f'or a degree to hold, or write hold = "neutral" before the tables'
        )
    matrix, offset = np.zeros((len(columns), len(joints))), np.zeros(len(columns))
    for row, column in enumerate(columns):
        if column in terms and column in held:
            raise ModelError(f"{path}: {column} is in [columns] and in [hold]; leave out one")
        offset[row] = held.get(column, 0.0)
        for term in terms.get(column, ()):
            if not term.name:
                offset[row] += term.degrees
            elif term.name in joints:
                matrix[row, joints.index(term.name)] += term.sign * UNITS[unit]
            else:
                near = did_you_mean(term.name, joints)
                raise ModelError(f"{path}: {column}: joint {term.name!r} is not in joints{near}; add it to the list")
        if abs(offset[row]) > LARGEST:
            raise ModelError(f"{path}: {column} has {offset[row]:g} degrees to add; expected up to {LARGEST:g}")
    if not matrix.any():
        raise ModelError(f"{path}: no joint moves a column of the model; name joints in [columns]")
    return JointMap(tuple(joints), unit, matrix, offset, {column: held[column] for column in columns if column in held})
