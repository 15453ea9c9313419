"""Texts from inputs in the terminal and on pages: characters that are not seen are shown as their escape codes.

A name may hold escape sequences, which a terminal obeys, line ends, which forge further lines, and characters that
change the direction of the text around them. Hidden are the Unicode general categories Cc (control characters), Cs
(surrogates: bytes of a file name that are no UTF-8), Zl, Zp and Cf (format characters; with the bidirectional controls
of Unicode Standard Annex #9), as in UTS #39, Unicode Security Mechanisms; https://trojansource.codes shows why.
"""

from __future__ import annotations

import html
import re
from typing import Final
from unicodedata import category

HIDDEN: Final = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""General categories of characters that are not seen."""
NONCHARACTERS: Final = "\ufffe\uffff"
"""Code points that no XML may contain, so that a drawing with them would not open."""
JOINERS: Final = "\u200c\u200d"
"""Format characters that Persian, the scripts of India and emoji are written with (Unicode Standard Annex #31)."""

UNITS: Final = "%|s|ms|min|h|Hz|deg|degrees|rad|kg|N|m|cm|mm|MB|percentage points"
"""Units of the numbers in texts, as a pattern."""
WITH_UNIT: Final = rf"(?<=\d) (?=(?:{UNITS})(?!\w))|(?<=\d min) (?=\d)|(?<=\d h) (?=\d)|(?<=REBA) (?=\d)"
"""Spaces at which no line may end: between a number and its unit (as a pattern of Python and of JavaScript)."""
_WITH_UNIT: Final = re.compile(WITH_UNIT)


def joined(text: str, by: str = "\xa0") -> str:
    """Return a text whose numbers stay on one line with their units.

    >>> joined("2 min 20 s at REBA 9", by="_")
    '2_min_20_s at REBA_9'
    """
    return _WITH_UNIT.sub(by, text)


def printable(text: str, keep: str = "") -> str:
    r"""Return a text with every hidden character, except those to `keep`, as its escape code.

    >>> print(printable("left\x1b[31m\nhand"), printable("a\tb", keep="\t") == "a\tb")
    left\x1b[31m\nhand True
    """
    if text.isprintable():
        return text
    shown = JOINERS + keep
    return "".join(
        repr(each)[1:-1] if each not in shown and (category(each) in HIDDEN or each in NONCHARACTERS) else each
        for each in text
    )


def as_markup(text: str) -> str:
    r"""Return a text as HTML and SVG show it, in elements and in quoted attributes.

    >>> as_markup('<b>"left"\x1b</b>')
    '&lt;b&gt;&quot;left&quot;\\x1b&lt;/b&gt;'
    """
    return html.escape(printable(text, "\n\t"))


def as_script_data(json_text: str) -> str:
    r"""Return JSON for a script element of a page, which nothing in it can end.

    >>> as_script_data('["</script>"]')
    '["\\u003c/script>"]'
    """
    return json_text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
