"""Analyses of a scored recording: activity, exposure, worksheet of a frame, smallest improvements."""
