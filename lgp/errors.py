"""Errors of `lgp`: the same one-line family as `reba`, so `except ValueError` and `except RebaError` both work."""

from __future__ import annotations

from reba.errors import RebaError, did_you_mean

__all__ = ["LgpError", "LogicError", "SceneError", "WorldError", "did_you_mean"]


class LgpError(RebaError):
    """Base of every error that this package raises on purpose."""


class LogicError(LgpError):
    """A domain, an atom, an action or a goal cannot be used."""


class SceneError(LgpError):
    """A scene file or one of its entries cannot be used."""


class WorldError(LgpError):
    """A robot, joint, frame or switch cannot be used as asked."""
