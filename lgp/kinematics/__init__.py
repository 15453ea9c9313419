"""Kinematics of human, robots and objects: frames, postures, attachments and modes, with derivatives."""

from __future__ import annotations
