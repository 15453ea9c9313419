"""Opening files that a user names: regular files only, and no more bytes than a file of their kind can honestly hold.

A pipe may never end and a device may act when it is read, so both are refused before and after opening; a file that a
link names is opened as any other. Files that are shipped with the packages need none of this.
"""

from __future__ import annotations

import errno
import os
import stat
from typing import BinaryIO, Final

SETTINGS_BYTES: Final = 1 << 26
"""[bytes] Most that is read of a file that describes something (profile, rules, scene, model, plan); a choice."""
_FLAGS: Final = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)


def open_regular(
    path: str | os.PathLike[str], *, limit_bytes: int | None = None, append: bool = False, buffering: int = -1
) -> BinaryIO:
    """Open a regular file for reading bytes.

    Args:
        limit_bytes: largest size that is accepted; None for any.
        append: also for appending to it, such as a journal; it is created if missing.
        buffering: as of `open`; 0 for none.

    Raises:
        OSError: there is no such file, it cannot be read, is a folder, pipe, socket or device, or is larger; `strerror`
            says which, so that callers report it as any other failure to open.

    >>> open_regular(os.devnull)
    Traceback (most recent call last):
    OSError: [Errno 22] not a regular file: '/dev/null'
    """
    if not append or os.path.exists(path):
        _check(path, os.stat(path), limit_bytes)
    descriptor = os.open(path, _FLAGS | (os.O_RDWR | os.O_APPEND | os.O_CREAT if append else os.O_RDONLY), 0o666)
    try:
        _check(path, os.fstat(descriptor), limit_bytes)
        if not append:
            _refuse_pseudo_file(path, descriptor)
        return os.fdopen(descriptor, "a+b" if append else "rb", buffering)
    except BaseException:
        os.close(descriptor)
        raise


def read_regular(path: str | os.PathLike[str], *, limit_bytes: int | None = None) -> bytes:
    """Return the bytes of a regular file; arguments and errors as in `open_regular`."""
    with open_regular(path, limit_bytes=limit_bytes) as file:
        if limit_bytes is None:
            return file.read()
        data = file.read(limit_bytes + 1)  # the file may grow while it is read
        if len(data) > limit_bytes:
            raise _too_large(path, limit_bytes)
        return data


def read_settings(path: str | os.PathLike[str], encoding: str = "utf-8") -> str:
    """Return the text of a file that describes something, of at most `SETTINGS_BYTES`.

    Raises:
        OSError: as in `open_regular`.
        UnicodeDecodeError: the bytes are no text.
    """
    text = read_regular(path, limit_bytes=SETTINGS_BYTES).decode(encoding)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _check(path: str | os.PathLike[str], status: os.stat_result, limit_bytes: int | None) -> None:
    name = os.fspath(path)
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, "this is a folder, expected a file", name)
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "not a regular file", name)
    if limit_bytes is not None and status.st_size > limit_bytes:
        raise _too_large(path, limit_bytes)


def _refuse_pseudo_file(path: str | os.PathLike[str], descriptor: int) -> None:
    """Refuse what states to be a regular file of no bytes and gives some, as /proc/kmsg, which waits for more."""
    if os.fstat(descriptor).st_size == 0 and os.read(descriptor, 1):
        if os.fstat(descriptor).st_size == 0:
            raise OSError(errno.EINVAL, "not a regular file", os.fspath(path))
        os.lseek(descriptor, 0, os.SEEK_SET)  # it was just written


def _too_large(path: str | os.PathLike[str], limit_bytes: int) -> OSError:
    return OSError(errno.EFBIG, f"larger than {limit_bytes} bytes, which no file of this kind is", os.fspath(path))
