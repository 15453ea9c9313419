"""LGP: joint task and motion planning over human and robot with an ergonomic cost.

The package is empty for now: it will hold the logic-geometric program of Busch, Toussaint & Lopes 2018.
"""
