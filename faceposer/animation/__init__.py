"""Poses over time: keys with splines between them, and faces that follow the trajectories of a few points."""
