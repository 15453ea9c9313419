"""QPs without rows far from their limit and zeros of the Hessian have the solution of the whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from lgp.sqp.active_set import ActiveSet
from lgp.sqp.qp import QP, QPResult, QPStatus, residuals
from lgp.sqp.reduced_qp import FEW, ReducedQP

N, ROWS = 40, 600


def random_qp(seed: int, width: float) -> QP:
    """Return a QP whose rows are `width` on average from their limits at 0, with stored zeros in its Hessian."""
    rng = np.random.default_rng(seed)
    dense = np.triu(np.ones((N, N)))
    hessian = sp.csc_matrix(dense)
    hessian.data[:] = np.eye(N)[np.nonzero(dense.T)[1], np.nonzero(dense.T)[0]] * rng.uniform(1.0, 2.0, hessian.nnz)
    chosen = rng.permuted(np.tile(np.arange(N), (ROWS, 1)), axis=1)[:, :4]
    rows = sp.csr_matrix((rng.normal(size=4 * ROWS), (np.repeat(np.arange(ROWS), 4), chosen.ravel())), shape=(ROWS, N))
    equal = sp.csr_matrix(rng.normal(size=(3, N)))
    return QP(
        hessian,
        rng.normal(size=N),
        equal,
        0.1 * rng.normal(size=3),
        rows,
        width * rng.uniform(0.1, 1.0, ROWS),
        np.full(N, -3.0),
        np.full(N, 3.0),
    )


@pytest.mark.parametrize("seed", range(6))
def test_the_solution_is_that_of_the_whole(seed: int) -> None:
    qp = random_qp(seed, 2.0)
    whole = ActiveSet().solve(qp)
    sizes: list[tuple[int, int]] = []
    backend, reduced = ActiveSet(), ReducedQP()

    def solve(part: QP, warm: QPResult | None) -> QPResult:
        sizes.append((part.h.size, part.P.nnz))
        return backend.solve(part, warm)

    found = reduced.solve(qp, None, solve)
    assert found.status is QPStatus.SOLVED
    assert np.allclose(found.x, whole.x, atol=1e-7)
    errors = residuals(qp, found)
    assert max(errors.primal, errors.dual, errors.gap) < 1e-6
    assert max(rows for rows, _ in sizes) < ROWS / 2
    assert {entries for _, entries in sizes} == {N}
    # What mattered is known: from the solution the next QP of the pattern takes one part.
    sizes.clear()
    again = reduced.solve(replace(qp, q=1.01 * qp.q), found, solve)
    assert again.status is QPStatus.SOLVED
    assert len(sizes) == 1


def test_inconsistent_rows_of_a_part_are_those_of_the_whole() -> None:
    qp = random_qp(0, 2.0)
    first = qp.G[:1]
    rows = sp.csr_matrix(sp.vstack([qp.G, -first]))
    inconsistent = replace(qp, G=rows, h=np.append(qp.h, -qp.h[0] - 1.0))
    found = ReducedQP().solve(inconsistent, None, ActiveSet().solve)
    assert found.status is QPStatus.INFEASIBLE
    assert found.z.shape == (ROWS + 1,)


def test_few_rows_are_all_kept() -> None:
    qp = random_qp(1, 2.0)
    few = replace(qp, G=sp.csr_matrix(qp.G[:FEW]), h=qp.h[:FEW])
    asked: list[QP] = []

    def solve(part: QP, warm: QPResult | None) -> QPResult:
        asked.append(part)
        return ActiveSet().solve(part, warm)

    ReducedQP().solve(few, None, solve)
    assert asked == [few]
