"""Model files: strict, versioned JSON that reads back equal or is refused with one line.

Keys: `format` "dreba-model", `version`, `kind`, `joints` (names in order, unit), `parameters` (constructor parameters
and what was learned), `payload`, `domain`, `rmse` per class, `provenance`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, ClassVar, Final, Protocol

from dreba.domain import Domain
from dreba.errors import ModelError
from dreba.surrogates.registry import KINDS, ModelInfo
from dreba.surrogates.validation import check_parameters
from reba.errors import RebaError, did_you_mean
from reba.files import as_json, write_atomic, write_text
from reba.posture.columns import COLUMNS

FORMAT: Final = "dreba-model"
VERSION: Final = 1
"""Rises when a reader of the former version would misread a file."""
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
    """What a fitted surrogate answers so that it can be written."""

    kind: ClassVar[str]
    joints_: tuple[str, ...]
    about_: ModelInfo

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the constructor parameters."""

    def _state(self) -> dict[str, Any]:
        """Return what was learned."""

    def _payload(self) -> dict[str, Any]:
        """Return what the planner needs of a linear model."""


def to_dict(model: Serialisable) -> dict[str, Any]:
    """Return a fitted model as plain data, the content of its file.

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
        "payload": model._payload(),
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
    """Return the model of what `to_dict` gave.

    Raises:
        ModelError: not a model, a newer version, an unknown key or kind, or parameters that do not fit.
    """
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise ModelError(f'not a model file: its "format" is not "{FORMAT}"')
    version = data.get("version")
    if isinstance(version, int) and version > VERSION:
        raise ModelError(f"written as version {version}, this package reads up to {VERSION}; update dreba")
    for key in data:
        if key not in _KEYS:
            raise ModelError(f"unknown key {key!r}{did_you_mean(key, _KEYS)}; known: {', '.join(_KEYS)}")
    for key, expected in _KEYS.items():
        if not isinstance(data.get(key), expected) or isinstance(data[key], bool):
            raise ModelError(f"{key!r} is missing or no {expected.__name__}; the file is damaged")
    if version != VERSION:
        raise ModelError(f"version is {version}; expected {VERSION}")
    return _build(data)


def _build(data: dict[str, Any]) -> Any:
    kind = data["kind"]
    if kind not in KINDS:
        raise ModelError(f"kind {kind!r} is unknown{did_you_mean(kind, KINDS)}; known: {', '.join(sorted(KINDS))}")
    joints, parameters = data["joints"], data["parameters"]
    if set(joints) != {"names", "unit"} or joints["unit"] != "deg" or set(parameters) != {"options", "learned"}:
        raise ModelError("'joints' or 'parameters' do not hold what they must; the file is damaged")
    names = joints["names"]
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise ModelError("'joints' holds no list of names; the file is damaged")
    if len(set(names)) != len(names):
        raise ModelError("'joints' names a column twice; the file is damaged")
    unknown = [name for name in names if name not in COLUMNS]
    if unknown and not KINDS[kind].any_columns:
        raise ModelError(f"joint {unknown[0]!r} is not in the posture table{did_you_mean(unknown[0], COLUMNS)}")
    options, learned = parameters["options"], parameters["learned"]
    if not isinstance(options, dict) or not isinstance(learned, dict):
        raise ModelError("'parameters' do not hold what they must; the file is damaged")
    known = KINDS[kind]().get_params(deep=False)
    for name in options:
        if name not in known:
            raise ModelError(f"option {name!r} is unknown to kind {kind!r}{did_you_mean(name, known)}")
    model = KINDS[kind](**{name: _tuples(value) for name, value in options.items()})
    check_parameters(model.allowed, model.get_params(deep=False))
    if options.get("joints") not in (None, names):
        raise ModelError("option 'joints' does not agree with the names of the joints; the file is damaged")
    model.joints_ = tuple(names)
    model.n_features_in_ = len(names)
    model._restore(learned)
    if json.loads(as_json(model._payload())) != data["payload"]:
        raise ModelError("'payload' does not agree with the parameters; the file is damaged")
    if not all(isinstance(rmse, int | float) for rmse in data["rmse"].values()):
        raise ModelError("'rmse' holds something that is no number; the file is damaged")
    model.about_ = ModelInfo(data["domain"], data["rmse"], data["provenance"])
    return model


def save(model: Serialisable, path: str | Path) -> None:
    """Write a model file beside its target and rename it once it is whole.

    Raises:
        ModelError: the model is not fitted, or the file cannot be written.
    """
    write(path, json.dumps(to_dict(model), indent=1) + "\n")


def write(path: str | Path, text: str) -> None:
    """Write a text file whole or not at all.

    Raises:
        ModelError: the file cannot be written.
    """

    try:
        write_atomic(Path(path), lambda part: write_text(part, text))
    except RebaError as error:
        raise ModelError(str(error)) from error


def _tuples(value: Any) -> Any:
    """Return lists as tuples, the way constructor parameters are given in code."""
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value
