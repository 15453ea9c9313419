"""Text in the cells of tables that spreadsheets open: no text becomes a formula, and numbers stay numbers.

A cell that begins with one of `= + - @`, with a tab or with a line end is computed by spreadsheets, and a formula can
send or run what the reader of the table never sees. OWASP (https://owasp.org/www-community/attacks/CSV_Injection) has a
`'` put before it, which spreadsheets take as the sign of text.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    import pandas as pd

_FORMULA: Final = re.compile(r"'*(?:[\t\r\n\0]|\s*[=+\-@＝＋－＠])")
"""Begin of a text that a spreadsheet computes, also in the wide forms of East Asian keyboards, or of one that `cell_of`
has changed: both get one `'` more, so that `text_of` is exact."""
_NUMBER: Final = re.compile(r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*")


def cell_of(value: Any) -> Any:
    """Return a value as a cell has it: a text that a spreadsheet would compute gets a `'` before it.

    >>> [cell_of(value) for value in ("=1+1", "-knee", "-5.2", -5.2, "left arm", "'=1+1")]
    ["'=1+1", "'-knee", '-5.2', -5.2, 'left arm', "''=1+1"]
    """
    return f"'{value}" if isinstance(value, str) and _FORMULA.match(value) and not _NUMBER.fullmatch(value) else value


def text_of(cell: Any) -> Any:
    """Return the value that `cell_of` made a cell from; other cells are returned as they are.

    >>> [text_of(cell) for cell in ("'=1+1", "''=1+1", "'quoted'", -5.2)]
    ['=1+1', "'=1+1", "'quoted'", -5.2]
    """
    if isinstance(cell, str) and cell.startswith("'") and _FORMULA.match(cell) and not _NUMBER.fullmatch(cell[1:]):
        return cell[1:]
    return cell


def cells_of(data: pd.DataFrame) -> pd.DataFrame:
    """Return a table with headers and texts as `cell_of` gives them, for every writer that spreadsheets read.

    >>> import pandas as pd
    >>> cells_of(pd.DataFrame({"=time": [-1.0], "place": ["@home"]})).to_dict("list")
    {"'=time": [-1.0], 'place': ["'@home"]}
    """
    return _each_text(data.rename(columns=cell_of), cell_of)


def texts_of(cells: pd.DataFrame) -> pd.DataFrame:
    """Return a table whose texts are those that `cells_of` changed; its headers stay."""
    return _each_text(cells, text_of)


def _each_text(data: pd.DataFrame, change: Callable[[Any], Any]) -> pd.DataFrame:
    import pandas as pd

    changed = data.copy(deep=False)
    for at, kind in enumerate(data.dtypes):
        if not pd.api.types.is_numeric_dtype(kind):
            changed.isetitem(at, data.iloc[:, at].map(change).array)
    return changed
