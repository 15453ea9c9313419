"""Paired tests and effect sizes, for experiments and studies."""
