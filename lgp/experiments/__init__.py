"""Experiments of Busch, Toussaint & Lopes 2018 run again: their runs, their statistics, their pages."""

from __future__ import annotations
