"""Marks of tests that need the packages of the extra `page`."""

from __future__ import annotations

import importlib.util

import pytest

needs_page = pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in ("pyvista", "trimesh", "collada")),
    reason="the extra `page` is not installed",
)
