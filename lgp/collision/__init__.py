"""Collision checks: shapes, signed distances with derivatives, random collision-free postures."""
