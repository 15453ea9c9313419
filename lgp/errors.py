"""Errors of `lgp`: one-line messages as in `reba`; `except ValueError` and `except RebaError` catch them all."""

from __future__ import annotations

from reba.errors import RebaError


class LgpError(RebaError):
    """Base class of the errors of this package."""


class LogicError(LgpError):
    """An invalid domain, atom, action or goal."""


class SceneError(LgpError):
    """An invalid scene file or entry."""


class WorldError(LgpError):
    """An invalid robot, joint, frame, configuration or switch."""
