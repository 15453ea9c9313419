"""The files of a plan: `plan.json`, its motion, the actions as a temporal plan, and the postures of each person."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from lgp.errors import LgpError
from lgp.files import ACTIONS_FILE, PLAN_FILE, PLAN_FILES
from lgp.kinematics.interpolation import NAME as INTERPOLATION
from lgp.scene.model import Scene
from lgp.scene.scene_file import read_scene
from reba.arrays import Array, Indices
from reba.files import as_json, from_json, write_folder, write_text
from reba.open_file import open_regular, read_settings
from reba.posture.columns import COLUMNS
from reba.provenance import write_parquet

FORMAT: Final = "lgp-plan"
VERSION: Final = 1
"""Version of the format; increased when readers of the previous one would misread a plan."""
PLAIN: Final[dict[str, type]] = {
    "feasible": bool,
    "status": str,
    "reason": str,
    "costs": dict,
    "residuals": dict,
    "solver": dict,
    "search": dict,
    "variables": dict,
}
"""Fields that are saved as they are, with their JSON types."""
LATER: Final[dict[str, type]] = {"weights": dict, "audit": dict, "provenance": dict, "starts": dict, "concurrent": dict}
"""Fields that older plans do not have, with their JSON types."""
AS_THEY_ARE: Final = (*PLAIN, *LATER)
"""All fields that are saved as they are."""
NUMBERS: Final = ("costs", "residuals", "variables")
"""Fields whose values are numbers by name."""


@dataclass(frozen=True, eq=False)
class SavedMotion:
    """The motion of a plan.

    Attributes:
        time: of each slice (T,) [s].
        phase: number of the phase of each slice, from 0 (T,).
        path: configurations (T, nq) [rad, m].
        people: name -> posture angles (T, 22) [deg] and mass in the hands (T,) [kg], in the order of the scene.
    """

    time: Array
    phase: Indices
    path: Array
    people: Mapping[str, tuple[Array, Array]]


def write_plan(folder: Path, fields: Mapping[str, Any], motion: SavedMotion, actions: str) -> None:
    """Write a plan into a folder, which is created.

    Args:
        fields: what `plan.json` has besides its format.
        motion: is written if the plan is feasible.
        actions: text of the actions, written if the plan is feasible.

    Raises:
        LgpError: the folder cannot be written.
    """
    import pandas as pd

    data = {"format": FORMAT, "version": VERSION, "interpolation": INTERPOLATION, **fields}
    origin = fields["provenance"]

    def write(part: Path) -> None:
        write_text(part / PLAN_FILE, as_json(data, indent=1) + "\n")
        if fields["feasible"]:
            write_text(part / ACTIONS_FILE, actions)
            columns = dict(zip(fields["joints"], motion.path.T, strict=True))
            table = pd.DataFrame({"time": motion.time, "phase": motion.phase, **columns})
            write_parquet(table, part / "path.parquet", origin)
        for file, (own, carried) in zip(_posture_files(motion.people), motion.people.values(), strict=True):
            angles = dict(zip(COLUMNS, own.T, strict=True))
            write_parquet(pd.DataFrame({"time": motion.time, **angles, "load": carried}), part / file, origin)

    write_folder(folder, write, last=PLAN_FILE, stale=PLAN_FILES, error=LgpError)


def _posture_files(people: Iterable[str]) -> list[str]:
    """Return the name of the file of each person."""
    return [f"postures-{name}.parquet" if at else "postures.parquet" for at, name in enumerate(people)]


def read_plan(folder: Path) -> tuple[dict[str, Any], SavedMotion | None]:
    """Return the fields of the plan that `write_plan` wrote into a folder, and its motion, None if it is infeasible.

    Raises:
        LgpError: the folder has no plan, or it is damaged or of a newer version.
    """
    file = folder / PLAN_FILE
    data = _read(file)
    fields: dict[str, Any] = {name: data[name] for name in PLAIN}
    fields["search"] = {
        name: math.inf if value is None and name in ("bound", "gap") else value
        for name, value in data["search"].items()
    }
    fields["scene"] = _scene(file, data["scene"])
    fields |= {name: data.get(name, kind()) for name, kind in LATER.items()}
    fields |= {"actions": tuple(data["actions"]), "joints": tuple(data["joints"])}
    try:
        fields["start"] = np.array(data["start"], dtype=float)
    except (ValueError, TypeError, OverflowError) as error:
        raise LgpError(f"{file}: 'start' is {data['start']!r}, expected numbers ({error}); plan again") from error
    return fields, _motion(folder, fields["joints"], fields["scene"].humans) if data["feasible"] else None


def holds_plan(folder: Path) -> bool:
    """Return whether a folder has a plan, or what cannot be read as one; the record of a failed planning is none."""
    try:
        return bool(_read(folder / PLAN_FILE)["feasible"])
    except LgpError:
        return (folder / PLAN_FILE).exists()


def _read(file: Path) -> dict[str, Any]:
    try:
        data = from_json(read_settings(file))
    except (OSError, ValueError, RecursionError) as error:
        raise LgpError(f"{file}: cannot be read as a plan ({error}); give a folder that `lgp plan -o` wrote") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise LgpError(f'{file}: not a plan, expected "format": "{FORMAT}"; give a folder that `lgp plan -o` wrote')
    if not isinstance(data.get("version"), int) or data["version"] > VERSION:
        raise LgpError(f"{file}: version is {data.get('version')}, expected up to {VERSION}; update this package")
    between = data.get("interpolation", INTERPOLATION)
    if between != INTERPOLATION:
        raise LgpError(f"{file}: its motion between slices is {between!r}, expected {INTERPOLATION!r}; plan again")
    missing = [name for name in (*PLAIN, "scene", "actions", "joints", "start") if name not in data]
    if missing:
        raise LgpError(f"{file}: {missing[0]!r} is missing; the file is damaged, plan again")
    _check(file, data)
    return data


def _check(file: Path, data: dict[str, Any]) -> None:
    """Refuse fields of a wrong type."""
    kinds = {**PLAIN, **LATER}
    wrong = [name for name, kind in kinds.items() if not isinstance(data.get(name, kind()), kind)]
    wrong += [name for name in NUMBERS if name not in wrong and not all(map(_is_number, data[name].values()))]
    for name in ("actions", "joints"):
        if not isinstance(data[name], list) or not all(isinstance(part, str) for part in data[name]):
            wrong.append(name)
    if wrong:
        raise LgpError(f"{file}: {wrong[0]!r} has a wrong type; the file is damaged, plan again")


def _is_number(value: Any) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


def _scene(file: Path, data: Any) -> Scene:
    """Return the scene of a saved plan; LgpError where it is missing or invalid."""
    if not isinstance(data, dict) or not isinstance(data.get("values"), dict):
        raise LgpError(f"{file}: its scene is missing; the file is damaged, plan again")
    return read_scene(data["values"], str(data.get("name")))


def _motion(folder: Path, joints: tuple[str, ...], names: Iterable[str]) -> SavedMotion:
    import pandas as pd
    import pyarrow as pa

    def table(name: str) -> pd.DataFrame:
        with open_regular(folder / name) as file:
            return pd.read_parquet(file)

    try:
        path = table("path.parquet")
        if list(path.columns) != ["time", "phase", *joints]:
            raise LgpError(f"{folder}: columns of path.parquet differ from the joints of plan.json; plan again")
        people = {}
        for name, file in zip(names, _posture_files(names), strict=True):
            if (folder / file).exists():
                own = table(file)
                if len(own) != len(path):
                    raise LgpError(f"{folder}: {file} has {len(own)} rows, expected {len(path)}; plan again")
                people[name] = own[list(COLUMNS)].to_numpy(np.float64), own["load"].to_numpy(np.float64)
        return SavedMotion(
            time=path["time"].to_numpy(np.float64),
            phase=path["phase"].to_numpy(np.intp),
            path=path[list(joints)].to_numpy(np.float64),
            people=people,
        )
    except LgpError:
        raise
    except (OSError, ValueError, KeyError, TypeError, pa.ArrowException) as error:
        raise LgpError(f"{folder}: its motion cannot be read ({error}); plan again") from error
