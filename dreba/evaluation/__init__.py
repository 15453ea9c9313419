"""Evaluation of surrogates: errors, times, and the true REBA reached by minimising them on reach tasks."""
