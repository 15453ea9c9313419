"""The world of a plan: one human, robots, tables and objects, and everything a planner asks of their geometry."""

from __future__ import annotations
