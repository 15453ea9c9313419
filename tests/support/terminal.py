"""A command in a terminal."""

from __future__ import annotations

import fcntl
import os
import pty
import struct
import subprocess
import termios
from collections.abc import Sequence

from tests.support.paths import ROOT

ROWS = 40


def in_a_terminal(call: Sequence[str], columns: int) -> str:
    """Return what a terminal of a width gets from a call that ends well, styles and line ends as they are."""
    primary, secondary = pty.openpty()
    fcntl.ioctl(secondary, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, columns, 0, 0))
    env = {key: value for key, value in os.environ.items() if key != "COLUMNS"} | {"TERM": "xterm-256color"}
    process = subprocess.Popen(
        call, stdin=secondary, stdout=secondary, stderr=secondary, cwd=ROOT, env=env, start_new_session=True
    )
    os.close(secondary)
    read = b""
    while True:
        try:
            part = os.read(primary, 65536)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        read += part
    os.close(primary)
    assert process.wait(60) == 0
    return read.decode("utf-8")
