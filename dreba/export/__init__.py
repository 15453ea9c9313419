"""The same function for other toolchains: C99 without dependencies, and a CasADi function."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from dreba.errors import ModelError
from dreba.evaluation.evaluate import check_temperature
from dreba.export.c import c_source
from dreba.export.casadi import casadi_json
from dreba.surrogates.base import Surrogate
from dreba.surrogates.graduated import GraduatedModel
from dreba.surrogates.serialization import write
from reba.errors import did_you_mean

TARGETS: Final[dict[str, tuple[str, Callable[..., str]]]] = {
    "c": (".c", c_source),
    "casadi": (".casadi", casadi_json),
}
"""Targets by name: suffix of the file, and the function that gives its text."""
C_KEYWORDS: Final = frozenset({
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum", "extern",
    "float", "for", "goto", "if", "inline", "int", "long", "main", "register", "restrict", "return", "short",
    "signed", "sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "while",
    "load_points", "value_and_slope", "smooth_max", "cell_of", "trilinear", "table_a", "table_b", "table_c",
})  # fmt: skip
"""Names that the function may not have: C99's own, and those of the file."""


def export(
    model: Surrogate,
    target: str,
    path: str | Path,
    *,
    temperature: float | None = None,
    first: bool = False,
    name: str = "dreba",
) -> Path:
    """Write a model as a function of another toolchain.

    Args:
        model: fitted, any kind but a net; of a graduated model the soft tables are written.
        target: "c" or "casadi".
        path: file to write; the target's suffix is added if it has none.
        temperature: [deg] of a model with temperatures, None for its default.
        first: write the first stage of a graduated model instead.
        name: of the function.

    Raises:
        ModelError: an unknown target, a kind that cannot be exported, a bad name, or the file cannot be written.
    """
    if target not in TARGETS:
        raise ModelError(f"target {target!r} is unknown{did_you_mean(target, TARGETS)}; known: {', '.join(TARGETS)}")
    if not (name.isidentifier() and name.isascii()) or name in C_KEYWORDS:
        raise ModelError(f"name is {name!r}; expected letters, digits and underscores, such as 'dreba'")
    if first:
        if not isinstance(model, GraduatedModel):
            raise ModelError(f"kind {model.kind!r} has no first stage; only a graduated model has stages")
        model = model.first_
    check_temperature(model, temperature)
    suffix, text = TARGETS[target]
    out = Path(path)
    if not out.suffix:
        out = out.with_suffix(suffix)
    write(out, text(model, temperature=temperature, name=name))
    return out
