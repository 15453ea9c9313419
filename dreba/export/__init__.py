"""Export of a fitted model to other toolchains: C and C++, CasADi, PyTorch, JAX."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

from dreba.errors import ModelError
from dreba.evaluation.evaluate import MODEL, check_temperature
from dreba.export.c import HESSIANS, c_header, c_source
from dreba.export.casadi import casadi_json
from dreba.export.function_names import check_name
from dreba.export.joint_map import read_map
from dreba.export.python_source import jax_source, torch_source
from dreba.surrogates.base import Surrogate
from dreba.surrogates.graduated import GraduatedModel
from dreba.surrogates.serialization import write
from reba.checks import PATH, TEXT, YES_NO, accepts, one_of
from reba.errors import did_you_mean
from reba.outputs import FileOutput, check_outputs

TARGETS: Final[dict[str, tuple[str, Callable[..., str]]]] = {
    "c": (".c", c_source),
    "casadi": (".casadi", casadi_json),
    "torch": (".py", torch_source),
    "jax": (".py", jax_source),
}
"""Suffix of the file and function that returns its text, by the name of the target."""


@accepts(
    ModelError,
    model=MODEL,
    path=PATH,
    to=TEXT,
    first=YES_NO,
    name=TEXT,
    joint_map=PATH.or_none(),
    hessian=one_of(*HESSIANS).or_none(),
)
def export_model(
    model: Surrogate,
    path: str | Path,
    *,
    to: str,
    temperature: float | None = None,
    first: bool = False,
    name: str = "dreba",
    joint_map: str | Path | None = None,
    hessian: str | None = None,
) -> Path:
    """Write a model as a function of another toolchain; beside a C source a header with the ending .h.

    Args:
        model: fitted, any kind but a net; of a graduated model the soft tables are written.
        path: file to write; the target's suffix is added if it has none.
        to: target, "c", "casadi", "torch" or "jax".
        temperature: [deg] of a model with temperatures, None for its default.
        first: write the first stage of a graduated model instead.
        name: of the function.
        joint_map: TOML file of your own joints, see `read_map`; the function then takes these, in their order and unit.
        hessian: "exact" or "gauss-newton", for C and CasADi: second derivatives too.

    Returns:
        The file written.

    Raises:
        ModelError: an unknown target, a kind that cannot be exported, a reserved name, a wrong map, or a file that
            cannot be written.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> import dreba
        >>> with TemporaryDirectory() as folder:
        ...     export_model(dreba.load("quadratic"), Path(folder) / "cost", to="c").name
        'cost.c'
    """
    out = exported_file(path, to)
    check_name(name)
    if first:
        if not isinstance(model, GraduatedModel):
            raise ModelError(f"kind {model.kind!r} has no first stage; only a graduated model has stages")
        model = model.first_
    check_temperature(model, temperature)
    own = None if joint_map is None else read_map(joint_map, model.joints_)
    text = TARGETS[to][1](model, temperature=temperature, name=name, joint_map=own, hessian=hessian)
    if to == "c":
        write(out.with_suffix(".h"), c_header(model, file=out.name, name=name, joint_map=own, hessian=hessian))
    write(out, text)
    return out


def ending_of(to: str) -> str:
    """Return the ending of the files of a target; ModelError for an unknown one."""
    if to not in TARGETS:
        raise ModelError(f"target {to!r} is unknown{did_you_mean(to, TARGETS)}; expected {' or '.join(TARGETS)}")
    return TARGETS[to][0]


def exported_files(path: str | Path, to: str) -> list[Path]:
    """Return the files that an export writes: the path, with the ending of the target if it has none, and a header.

    Raises:
        ModelError: an unknown target, or a file cannot be written.
    """
    ending, given = ending_of(to), Path(path)
    if given.name and not given.suffix and (os.path.isfile(given) or not os.path.exists(given)):
        given = given.with_suffix(ending)
    outputs = [FileOutput(given if str(path) else path)]
    if to == "c" and given.name:
        outputs.append(FileOutput(given.with_suffix(".h")))
    check_outputs(*outputs, error=ModelError)
    return [Path(output.path) for output in outputs]


def exported_file(path: str | Path, to: str) -> Path:
    """Return the first of the files that an export writes, the function itself; errors as in `exported_files`."""
    return exported_files(path, to)[0]
