"""Lines of `reba live`: JSON of printable ASCII, with orjson and without."""

from __future__ import annotations

import io
import json
import sys
from unittest import mock

import pytest

from reba.live.output import encoder, write_lines

HIDDEN = "".join(map(chr, (0, 7, 27, 127, 155, 0x202E, 0x2028, 0xDCFF)))


@pytest.mark.parametrize("orjson", [True, False])
@pytest.mark.parametrize("text", [HIDDEN, *HIDDEN, "left arm"])
def test_no_line_has_a_control_character(text: str, orjson: bool) -> None:
    out = io.BytesIO()
    encoder.cache_clear()
    with mock.patch.dict(sys.modules, {} if orjson else {"orjson": None}):
        write_lines(out, [{"time": 0.5, text: [text]}])
    encoder.cache_clear()
    line = out.getvalue().decode("ascii")
    assert line[-1] == "\n"
    assert line[:-1].isprintable()
    assert json.loads(line) == {"time": 0.5, text: [text]}
