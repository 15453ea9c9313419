"""Tables A, B and C, cell by cell against a second transcription."""

from __future__ import annotations

import hashlib
import itertools

import numpy as np
import pytest

import reba
from reba.method.tables import LEVEL_OF, PART_MAXIMA, TABLES_SHA256
from tests.support import reference_reba as reference
from tests.support.says import says

TABLES = {"a": reba.TABLE_A, "b": reba.TABLE_B, "c": reba.TABLE_C}


@pytest.mark.parametrize(
    ("table", "grid", "shape", "total"),
    [
        ("a", reference.A, (5, 3, 4), 321),
        ("b", reference.B, (6, 2, 3), 177),
        ("c", reference.C, (12, 12), 1192),
    ],
)
def test_every_cell(table: str, grid: list[list[int]], shape: tuple[int, ...], total: int) -> None:
    cells = TABLES[table]
    assert cells.shape == shape
    assert cells.tolist() == grid
    assert int(cells.sum(dtype=int)) == total


def test_sha256_of_the_cells() -> None:
    blob = b"".join(np.ascontiguousarray(table, np.uint8).tobytes() for table in TABLES.values())
    assert hashlib.sha256(blob).hexdigest() == TABLES_SHA256
    assert TABLES_SHA256 == "41df1df3ee0cfb4e2bf3a369a6e79aeaffd465bb24dfb488606af7a9fa5fd395"


@pytest.mark.parametrize("table", [*TABLES.values(), LEVEL_OF])
def test_read_only(table: np.ndarray) -> None:
    with pytest.raises(ValueError, match="read-only"):
        table[(0,) * table.ndim] = 1


@pytest.mark.parametrize(
    ("table", "cell", "value"),
    [
        ("a", (1, 2, 1), 1),
        ("a", (1, 2, 4), 4),
        ("a", (1, 3, 1), 3),
        ("a", (1, 3, 2), 3),
        ("a", (1, 3, 3), 5),
        ("a", (1, 3, 4), 6),
        ("a", (2, 1, 1), 2),
        ("a", (3, 1, 1), 2),
        ("a", (2, 2, 3), 5),
        ("a", (5, 3, 2), 8),
        ("a", (5, 3, 3), 9),
        ("b", (1, 1, 3), 2),
        ("b", (3, 2, 3), 5),
        ("b", (6, 2, 3), 9),
        ("c", (2, 12), 8),
        ("c", (6, 9), 10),
        *(("c", (8, b), 10) for b in range(5, 10)),
        *(("c", (12, b), 12) for b in range(1, 13)),
    ],
)
def test_irregular_cells(table: str, cell: tuple[int, ...], value: int) -> None:
    assert TABLES[table][tuple(i - 1 for i in cell)] == value


@pytest.mark.parametrize("table", TABLES.values())
def test_no_cell_falls_along_any_index(table: np.ndarray) -> None:
    for axis in range(table.ndim):
        assert (np.diff(table.astype(int), axis=axis) >= 0).all()


def test_action_levels() -> None:
    assert LEVEL_OF.tolist() == reference.LEVEL_OF_SCORE
    assert [risk for risk, _ in reba.ACTION_LEVELS] == ["negligible", "low", "medium", "high", "very high"]


def test_every_part_score_state() -> None:
    """All 60 x 36 x 4 x 4 x 4 = 138,240 states, and all 15 scores occur."""
    names = ("trunk", "neck", "legs", "upper_arm", "lower_arm", "wrist", "load_force", "coupling", "activity")
    spans = [range(0 if name in names[6:] else 1, PART_MAXIMA[name] + 1) for name in names]
    states = np.array(list(itertools.product(*spans)))
    assert len(states) == 138_240
    result = reba.score_parts(**dict(zip(names, states.T, strict=True)))
    expected = np.array([_state(*state) for state in states.tolist()])
    for column, field in enumerate(result._fields):
        np.testing.assert_array_equal(getattr(result, field), expected[:, column], err_msg=field)
    assert set(result.reba.tolist()) == set(range(1, 16))
    assert (result.score_a.max(), result.score_b.max(), result.score_c.max()) == (12, 12, 12)


def _state(t: int, n: int, g: int, u: int, w: int, r: int, load: int, grip: int, active: int) -> tuple[int, ...]:
    a = reference.A[t - 1][n - 1][g - 1] + load
    b = reference.B[u - 1][w - 1][r - 1] + grip
    c = reference.C[a - 1][b - 1]
    return a, b, c, c + active, reference.LEVEL_OF_SCORE[c + active]


def test_scalars_give_python_integers() -> None:
    result = reba.score_parts(trunk=1, neck=1, legs=1, upper_arm=1, lower_arm=1, wrist=1)
    assert result == (1, 1, 1, 1, 0)
    assert all(type(value) is int for value in result)


def test_arrays_broadcast() -> None:
    result = reba.score_parts(trunk=[1, 4], neck=2, legs=1, upper_arm=[[1], [6]], lower_arm=2, wrist=3)
    assert result.reba.shape == (2, 2)


BODY = {"trunk": 1, "neck": 1, "legs": 1, "upper_arm": 1, "lower_arm": 1, "wrist": 1}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *((name, 0) for name in BODY),
        *((name, PART_MAXIMA[name] + 1) for name in PART_MAXIMA),
        ("load_force", -1),
        ("trunk", 1.5),
        ("trunk", float("nan")),
        ("trunk", float("inf")),
        ("trunk", "two"),
        ("trunk", None),
        ("neck", [1, 2, 4]),
    ],
)
def test_scores_out_of_range_are_refused(name: str, value: object) -> None:
    with pytest.raises(reba.PostureError) as caught:
        reba.score_parts(**{**BODY, name: value})
    says(caught, f"{name} score is", "expected whole numbers from")


def test_lengths_that_do_not_fit_are_refused() -> None:
    with pytest.raises(reba.PostureError) as caught:
        reba.score_parts(**{**BODY, "trunk": [1, 2], "neck": [1, 2, 3]})
    says(caught, "do not fit together")
