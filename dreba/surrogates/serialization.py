"""Model files: versioned JSON with strict checks; a file reads back equal or is refused in one line.

Keys: `format` "dreba-model", `version`, `kind`, `joints` (names in order, unit), `parameters` (constructor options and
learned arrays), `payload`, `domain`, `rmse` per class, `provenance`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, ClassVar, Final, Protocol

from dreba.domain import Domain
from dreba.errors import ModelError
from dreba.surrogates.registry import KINDS, ModelInfo
from dreba.surrogates.validation import check_parameters
from reba.errors import did_you_mean
from reba.files import as_json, write_atomic, write_text
from reba.posture.columns import COLUMNS

FORMAT: Final = "dreba-model"
VERSION: Final = 1
"""Version of the format; it rises when an older reader would misread a file."""
_KEYS: Final[dict[str, type]] = {
    "format": str,
    "version": int,
    "kind": str,
    "joints": dict,
    "parameters": dict,
    "payload": dict,
    "domain": dict,
    "rmse": dict,
    "provenance": dict,
}


class Serialisable(Protocol):
    """Interface of a fitted surrogate for writing."""

    kind: ClassVar[str]
    joints_: tuple[str, ...]
    about_: ModelInfo

    @property
    def factors_(self) -> tuple[str, ...]:
        """Factors that the model knows."""

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the constructor parameters."""

    def _state(self) -> dict[str, Any]:
        """Return the learned state."""

    def _payload(self) -> dict[str, Any]:
        """Return the form of load, coupling and activity."""


def to_dict(model: Serialisable) -> dict[str, Any]:
    """Return a fitted model as the plain data of its file.

    Raises:
        ModelError: the model is not fitted, or a parameter cannot be written as JSON.
    """
    if not hasattr(model, "joints_"):
        raise ModelError(f"this {type(model).__name__} is not fitted; call fit first")
    # Of a domain the name is enough here: what was learned does not need it, and `about_` keeps it whole.
    options = {name: v.name if isinstance(v, Domain) else v for name, v in model.get_params(deep=False).items()}
    data = {
        "format": FORMAT,
        "version": VERSION,
        "kind": model.kind,
        "joints": {"names": list(model.joints_), "unit": "deg"},
        "parameters": {"options": options, "learned": model._state()},
        "payload": _payload(model),
        "domain": model.about_.domain,
        "rmse": model.about_.rmse,
        "provenance": model.about_.provenance,
    }
    try:
        plain: dict[str, Any] = json.loads(as_json(data, non_finite="refuse"))
    except (TypeError, ValueError) as error:
        raise ModelError(f"this {type(model).__name__} cannot be written as JSON: {error}") from error
    return plain


def from_dict(data: Any) -> Any:
    """Return the model of the plain data of `to_dict`.

    Raises:
        ModelError: the data are not a model, of a newer version, have an unknown key or kind, or wrong parameters.
    """
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise ModelError(f'not a model file; expected "format": "{FORMAT}"')
    version = data.get("version")
    if isinstance(version, int) and version > VERSION:
        raise ModelError(f"the file has version {version}; this package reads up to {VERSION}, so update dreba")
    for key in data:
        if key not in _KEYS:
            raise ModelError(f"unknown key {key!r}{did_you_mean(key, _KEYS)}; expected {', '.join(_KEYS)}")
    for key, expected in _KEYS.items():
        if not isinstance(data.get(key), expected) or isinstance(data[key], bool):
            raise ModelError(
                f"{key!r} is missing or has the wrong type; expected {expected.__name__}; the file is damaged"
            )
    if version != VERSION:
        raise ModelError(f"version is {version}; expected {VERSION}")
    return _build(data)


def _build(data: dict[str, Any]) -> Any:
    kind = data["kind"]
    if kind not in KINDS:
        raise ModelError(f"kind {kind!r} is unknown{did_you_mean(kind, KINDS)}; expected {', '.join(sorted(KINDS))}")
    joints, parameters = data["joints"], data["parameters"]
    if set(joints) != {"names", "unit"} or joints["unit"] != "deg" or set(parameters) != {"options", "learned"}:
        raise ModelError(
            "expected 'joints' with names and unit deg, and 'parameters' with options and learned; the file is damaged"
        )
    names = joints["names"]
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise ModelError("names of 'joints' are not a list of texts; the file is damaged")
    if len(set(names)) != len(names):
        raise ModelError("'joints' has a name twice; the file is damaged")
    unknown = [name for name in names if name not in COLUMNS]
    if unknown and not KINDS[kind].any_columns:
        raise ModelError(f"joint {unknown[0]!r} is not in the posture table{did_you_mean(unknown[0], COLUMNS)}")
    options, learned = parameters["options"], parameters["learned"]
    if not isinstance(options, dict) or not isinstance(learned, dict):
        raise ModelError("options and learned of 'parameters' are not tables; the file is damaged")
    known = KINDS[kind]().get_params(deep=False)
    for name in options:
        if name not in known:
            raise ModelError(f"option {name!r} is unknown for kind {kind!r}{did_you_mean(name, known)}")
    model = KINDS[kind](**{name: _tuples(value) for name, value in options.items()})
    check_parameters(model.allowed, model.get_params(deep=False))
    if options.get("joints") not in (None, names):
        raise ModelError("option 'joints' does not agree with the names of the joints; the file is damaged")
    model._set_joints(tuple(names))
    model._restore(learned)
    # Files written before a key was added lack it.
    own = json.loads(as_json(_payload(model)))
    if "form" not in data["payload"] or any(own.get(key, data) != value for key, value in data["payload"].items()):
        raise ModelError("'payload' does not agree with the parameters; the file is damaged")
    if not all(isinstance(rmse, int | float) for rmse in data["rmse"].values()):
        raise ModelError("'rmse' has a value that is not a number; the file is damaged")
    model.about_ = ModelInfo(data["domain"], data["rmse"], data["provenance"])
    return model


def _payload(model: Serialisable) -> dict[str, Any]:
    return {**model._payload(), "known": list(model.factors_)}


def save(model: Serialisable, path: str | Path) -> None:
    """Write a model file, completely or not at all (ModelError)."""
    write(path, json.dumps(to_dict(model), indent=1) + "\n")


def write(path: str | Path, text: str) -> None:
    """Write a text file, completely or not at all (ModelError)."""
    write_atomic(path, lambda part: write_text(part, text), error=ModelError)


def _tuples(value: Any) -> Any:
    """Return lists of JSON as tuples, the form of constructor parameters."""
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value
