"""Tables A, B and C and the action levels of REBA, as printed.

Source: Hignett & McAtamney (2000), Rapid Entire Body Assessment (REBA), Applied Ergonomics 31:201-205. The cells were
compared with Hedge's worksheet (A, B whole, C to row 11), INSST "Posturas de trabajo" (C whole) and the tables of eight
public implementations; `TABLES_SHA256` pins them.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.posture.columns import GROUP_A, GROUP_B

# One line per trunk score 1-5; blocks for neck 1, 2, 3; in a block legs 1-4.
_A = """
1234 1234 3356
2345 3456 4567
2456 4567 5678
3567 5678 6789
4678 6789 7899
"""
# One line per upper arm score 1-6; blocks for lower arm 1, 2; in a block wrist 1-3.
_B = """
122 123
123 234
345 455
455 567
678 788
788 899
"""
# One line per Score A 1-12; columns Score B 1-12; one hexadecimal digit a cell (a = 10, b = 11, c = 12).
_C = """
111233456777
122344566778
233345677888
344456788999
444567889999
66678899aaaa
7778999aabbb
8889aaaaabbb
999aaabbbccc
aaabbbbccccc
bbbbcccccccc
cccccccccccc
"""
Scores8 = NDArray[np.uint8]
"""Part scores and totals of n frames."""
UNKNOWN: Final = 255
"""Stands in arrays of scores for one that the measured angles do not determine."""
TABLES_SHA256: Final = "41df1df3ee0cfb4e2bf3a369a6e79aeaffd465bb24dfb488606af7a9fa5fd395"
"""sha256 of the uint8 bytes of A[trunk][neck][legs], B[upper arm][lower arm][wrist] and C row-major, in this order."""
PART_MAXIMA: Final[dict[str, int]] = {
    "trunk": 5,
    "neck": 3,
    "legs": 4,
    "upper_arm": 6,
    "lower_arm": 2,
    "wrist": 3,
    "load_force": 3,
    "coupling": 3,
    "activity": 3,
}
"""Highest score of each part; body parts start at 1, load/force, coupling and activity at 0."""


def _cells(text: str, *shape: int) -> NDArray[np.uint8]:
    table = np.array([int(digit, 16) for digit in "".join(text.split())], np.uint8).reshape(shape)
    table.setflags(write=False)
    return table


TABLE_A: Final[NDArray[np.uint8]] = _cells(_A, *(PART_MAXIMA[part] for part in GROUP_A))
"""Trunk (1-5), neck (1-3), legs (1-4) -> 1-9. Read-only; indices are scores minus 1."""
TABLE_B: Final[NDArray[np.uint8]] = _cells(_B, *(PART_MAXIMA[part] for part in GROUP_B))
"""Upper arm (1-6), lower arm (1-2), wrist (1-3) -> 1-9. Read-only; indices are scores minus 1."""
TABLE_C: Final[NDArray[np.uint8]] = _cells(_C, 12, 12)
"""Score A (1-12), Score B (1-12) -> 1-12. Read-only; indices are scores minus 1."""
ACTION_LEVEL_FROM: Final[tuple[int, ...]] = (1, 2, 4, 8, 11)
"""Lowest REBA score of action levels 0 to 4 (the paper's numbering)."""
ACTION_LEVELS: Final[tuple[tuple[str, str], ...]] = (
    ("negligible", "none necessary"),
    ("low", "may be necessary"),
    ("medium", "necessary"),
    ("high", "necessary soon"),
    ("very high", "necessary now"),
)
"""Risk and action of levels 0 to 4."""


def _levels() -> NDArray[np.uint8]:
    levels = (np.arange(16)[:, None] >= np.array(ACTION_LEVEL_FROM)).sum(axis=1) - 1
    table = np.maximum(levels, 0).astype(np.uint8)
    table.setflags(write=False)
    return table


LEVEL_OF: Final[NDArray[np.uint8]] = _levels()
"""Action level of each REBA score; index 0 is not a score."""
