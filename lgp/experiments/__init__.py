"""Experiments of Busch, Toussaint & Lopes 2018 run again: their runs, their statistics, their pages."""
