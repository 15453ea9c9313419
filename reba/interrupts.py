"""Ctrl-C and SIGTERM: a command that gets one says so in one line and exits with 128 + the number of the signal.

Python raises KeyboardInterrupt wherever the main thread happens to be. Three places lose it or print it: an import,
where extension modules turn it into another error or stay half initialised; a finalizer, whose exceptions are printed
and dropped; and the end of the interpreter. So the handlers are installed before anything large is imported, a signal
before the command begins ends the process at once, one during a later import is raised when the import is over, one
that a finalizer dropped is raised again, and signals are ignored once the command is over.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import time
from contextlib import contextmanager
from importlib import import_module

from reba.import_path import leave_out_current_folder

TYPE_CHECKING = False  # that of typing takes long to import, and no signal is handled yet
if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType
    from typing import Any, Final, NoReturn

WORDS: Final[dict[int, str]] = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
"""Signals that end a command, and the word for each."""
RAISE_AGAIN_SECONDS: Final = 0.02
"""[s] After which a signal that could not be raised is tried again."""
REPEAT_SECONDS: Final = 2.0
"""[s] Within which further signals are part of the first: impatient presses must not disturb the tidying up."""
_TIMER: Final = getattr(signal, "SIGALRM", None)  # Windows has none: signals are raised at once there


class _Received:
    """The first signal of this process, when an interrupt was last raised, and the command while it is imported."""

    number: int = signal.SIGINT
    importing: str = ""
    raised: float | None = None


def enter(module: str) -> NoReturn:
    """Import the module of a command, run its `main`, and exit; call it before anything large is imported.

    Args:
        module: such as "reba.cli"; its package is the name in the line that an interrupt prints.
    """
    code: Any = 0
    try:
        try:
            _Received.importing = module.partition(".")[0]
            _install()
            leave_out_current_folder()
            # Arrow's own pool takes 18 MB for a table of 2 MB; it is chosen when Arrow is imported.
            os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
            with no_garbage():
                main = import_module(module).main
            _Received.importing = ""
            main()
        except SystemExit as stop:
            code = stop.code
        finally:
            _ignore()
    except KeyboardInterrupt:
        _ignore()
        code = interrupted(module.partition(".")[0])
    if code in map(exit_code, WORDS):
        discard_output()  # a reader that has stopped reading would hold up the end
    sys.exit(code)


@contextmanager
def no_garbage() -> Iterator[None]:
    """Import large packages in here: a third of the time of importing is the search of what they define for garbage.

    What is there at the end is not searched later either, as at the end of the interpreter.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def interrupted(name: str) -> int:
    """Print the one line of an interrupted command, and return its exit code."""
    if sys.stderr is not None:  # None: the caller closed the stream
        sys.stderr.write(f"{name}: {WORDS[_Received.number]}\n")
        sys.stderr.flush()
    return exit_code()


def exit_code(number: int | None = None) -> int:
    """Return the exit code after a signal, by default after the one this process received first.

    >>> exit_code(signal.SIGINT), exit_code(signal.SIGTERM)
    (130, 143)
    """
    return 128 + (_Received.number if number is None else number)


def discard_output() -> None:
    """Redirect standard output to the null device: Python would write buffered text again at exit and fail again."""
    if sys.stdout is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def held_back() -> Iterator[None]:
    """Hold back the signals of this thread meanwhile; threads and processes started here hold them back for good."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, WORDS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _handled() -> list[int]:
    return [*WORDS] if _TIMER is None else [*WORDS, _TIMER]


def _install() -> None:
    sys.unraisablehook = _on_unraisable
    for number in _handled():
        if signal.getsignal(number) is not signal.SIG_IGN:  # as it is for a background job of a shell
            signal.signal(number, _on_signal)


def _ignore() -> None:
    for number in _handled():
        signal.signal(number, signal.SIG_IGN)


def _on_signal(number: int, frame: FrameType | None) -> None:
    now = time.monotonic()
    if number in WORDS:
        if _Received.raised is None:
            _Received.number = number
        elif now - _Received.raised < REPEAT_SECONDS:
            return
    if _Received.importing:
        os._exit(interrupted(_Received.importing))  # there is nothing to tidy up yet
    if _imports(frame) and _raise_later():
        return
    _Received.raised = now
    raise KeyboardInterrupt


def _imports(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False


def _raise_later() -> bool:
    """Have the signal handled again soon, and return whether this system can do that."""
    if _TIMER is None:
        return False
    signal.setitimer(signal.ITIMER_REAL, RAISE_AGAIN_SECONDS)
    return True


def _on_unraisable(dropped: Any) -> None:
    if not (issubclass(dropped.exc_type, KeyboardInterrupt) and _raise_later()):
        sys.__unraisablehook__(dropped)
