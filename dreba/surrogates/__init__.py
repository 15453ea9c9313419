"""Surrogates: differentiable models of the REBA score, their fit, files and error metrics."""
