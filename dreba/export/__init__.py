"""Export of a fitted model to other toolchains: a C99 function without dependencies, or a CasADi function."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

from dreba.errors import ModelError
from dreba.evaluation.evaluate import MODEL, check_temperature
from dreba.export.c import c_source
from dreba.export.casadi import casadi_json
from dreba.surrogates.base import Surrogate
from dreba.surrogates.graduated import GraduatedModel
from dreba.surrogates.serialization import write
from reba.checks import PATH, TEXT, accepts
from reba.errors import did_you_mean
from reba.outputs import FileOutput, check_outputs

TARGETS: Final[dict[str, tuple[str, Callable[..., str]]]] = {
    "c": (".c", c_source),
    "casadi": (".casadi", casadi_json),
}
"""Suffix of the file and function that returns its text, by the name of the target."""
C_KEYWORDS: Final = frozenset({
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum", "extern",
    "float", "for", "goto", "if", "inline", "int", "long", "main", "register", "restrict", "return", "short",
    "signed", "sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "while",
    "load_points", "value_and_slope", "smooth_max", "cell_of", "trilinear", "table_a", "table_b", "table_c",
})  # fmt: skip
"""Names the exported function must not have: keywords of C99 and the other functions of the file."""


@accepts(ModelError, model=MODEL, path=PATH, to=TEXT, name=TEXT)
def export_model(
    model: Surrogate,
    path: str | Path,
    *,
    to: str,
    temperature: float | None = None,
    first: bool = False,
    name: str = "dreba",
) -> Path:
    """Write a model as a function of another toolchain.

    Args:
        model: fitted, any kind but a net; of a graduated model the soft tables are written.
        path: file to write; the target's suffix is added if it has none.
        to: target, "c" or "casadi".
        temperature: [deg] of a model with temperatures, None for its default.
        first: write the first stage of a graduated model instead.
        name: of the function.

    Returns:
        The file written.

    Raises:
        ModelError: an unknown target, a kind that cannot be exported, a bad name, or the file cannot be written.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> import dreba
        >>> with TemporaryDirectory() as folder:
        ...     export_model(dreba.load("quadratic"), Path(folder) / "cost", to="c").name
        'cost.c'
    """
    out = exported_file(path, to)
    if not (name.isidentifier() and name.isascii()) or name in C_KEYWORDS:
        raise ModelError(f"name is {name!r}; expected letters, digits and underscores, such as 'dreba'")
    if first:
        if not isinstance(model, GraduatedModel):
            raise ModelError(f"kind {model.kind!r} has no first stage; only a graduated model has stages")
        model = model.first_
    check_temperature(model, temperature)
    write(out, TARGETS[to][1](model, temperature=temperature, name=name))
    return out


def ending_of(to: str) -> str:
    """Return the ending of the files of a target; ModelError for an unknown one."""
    if to not in TARGETS:
        raise ModelError(f"target {to!r} is unknown{did_you_mean(to, TARGETS)}; expected {' or '.join(TARGETS)}")
    return TARGETS[to][0]


def exported_file(path: str | Path, to: str) -> Path:
    """Return the file that an export writes: the path, with the ending of the target if it has none.

    Raises:
        ModelError: an unknown target, or the file cannot be written.
    """
    ending, given = ending_of(to), FileOutput(path)
    file = Path(path)
    if file.name and not file.suffix and not os.path.isdir(file):
        given = FileOutput(file.with_suffix(ending))
    check_outputs(given, error=ModelError)
    return Path(given.path)
